"""Files that are whole or not there, whatever interrupts the writing."""

import os

import pytest

from flexaxis.sim.text_files import atomic


def write(path, text):
    with atomic(path) as new:
        new.write_text(text)


def test_nothing_is_seen_before_the_end(tmp_path):
    path = tmp_path / "table.csv"
    write(path, "old")
    with atomic(path) as new:
        new.write_text("half")
        assert (new.parent.parent, new.name, new.parent.name[0]) == (tmp_path, "table.csv", ".")
        assert path.read_text() == "old"
    assert path.read_text() == "half" and os.listdir(tmp_path) == ["table.csv"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("written", [True, False])
def test_what_fails_leaves_the_old_file_and_nothing_else(tmp_path, error, written):
    path = tmp_path / "table.csv"
    write(path, "old")
    with pytest.raises(type(error)), atomic(path) as new:
        if written:
            new.write_text("half")
        raise error
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["table.csv"]
