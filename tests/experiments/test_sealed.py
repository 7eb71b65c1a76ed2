"""A result that is not as it was written says so."""

import json

import pytest

from flexaxis.experiments.running.files import OutputError
from flexaxis.experiments.running.sealed import SEAL, as_written, read_sealed, write_sealed


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "study.json"
    write_sealed(path, {"a": [1, 2.5, None], "b": {"ü": "x"}})
    return path


def test_what_was_written_is_read(file):
    assert read_sealed(file, OutputError) == {"a": [1, 2.5, None], "b": {"ü": "x"}}


def test_another_order_of_keys_is_the_same(file):
    content = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(dict(reversed(content.items()))))
    assert read_sealed(file, OutputError)["a"][1] == 2.5


def test_a_change_is_told(file):
    file.write_text(file.read_text("utf-8").replace("2.5", "2.6"), "utf-8")
    with pytest.raises(OutputError, match=r"study.json: is not as it was written"):
        read_sealed(file, OutputError)


def test_none_at_all_is_an_older_version(file):
    file.write_text('{"a": 1}')
    assert read_sealed(file, OutputError) == {"a": 1}
    file.write_text("[1]")
    with pytest.raises(OutputError, match="no table"):
        read_sealed(file, OutputError)


def test_only_what_may_be_damaged_is_called_damaged(file, tmp_path):
    with pytest.raises(KeyError), as_written(tmp_path):  # our own mistake
        raise KeyError("a")
    content = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps({key: content[key] for key in content if key != SEAL}))
    with pytest.raises(OutputError, match="damaged, changed by hand"), as_written(tmp_path):
        raise KeyError("a")
    with pytest.raises(OutputError, match=r"^said$"), as_written(tmp_path):
        raise OutputError("said")
