"""Files that are whole or not there, whatever interrupts the writing."""

import os
import threading

import pytest

from flexaxis.sim.files import atomic


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


def test_a_name_as_long_as_names_may_be(tmp_path):
    path = tmp_path / ("ü" * 125 + ".csv")  # 254 bytes
    write(path, "x")
    assert path.read_text() == "x"


def test_a_pipe_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="a device or a pipe"):
        write(tmp_path / "pipe", "x")
    assert (tmp_path / "pipe").is_fifo() and os.listdir(tmp_path) == ["pipe"]


def test_a_folder_is_not_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError):
        write(tmp_path / "folder", "x")
    assert os.listdir(tmp_path) == ["folder"]


def test_writers_at_the_same_time_do_not_meet(tmp_path):
    """Many write one file; a reader always finds one of their texts, whole."""
    path = tmp_path / "study.json"
    texts = [str(n) * 5000 for n in range(4)]
    failed, found = [], set()

    def writer(text):
        try:
            for _ in range(50):
                write(path, text)
        except OSError as error:
            failed.append(error)

    write(path, texts[0])
    threads = [threading.Thread(target=writer, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        found.add(path.read_text())
    assert not failed and found <= set(texts) and os.listdir(tmp_path) == ["study.json"]
