"""Standard output whose reader has gone, or that is full, ends no command."""

import os
import sys

import pytest

from flexaxis.experiments.streams import Stream, forgiving

pytestmark = pytest.mark.skipif(os.name == "nt", reason="these are streams of Unix")


def test_text_for_a_reader_that_has_gone_is_dropped():
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w", encoding="utf-8") as file:
        stream = Stream(file)
        stream.write("a line\n" * 10_000)
        stream.flush()
        assert stream.problem == ""  # as with `| head`, which has read enough


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
def test_a_full_disk_is_a_problem():
    with open("/dev/full", "w", encoding="utf-8") as file:
        stream = Stream(file)
        stream.write("a line\n" * 10_000)
        stream.flush()
        assert "No space left" in stream.problem


def test_letters_that_an_encoding_lacks_are_written_as_numbers(tmp_path, monkeypatch):
    path = tmp_path / "out"
    with path.open("w", encoding="ascii") as file:
        monkeypatch.setattr(sys, "stdout", file)
        with forgiving():
            print("θ")
        assert sys.stdout is file and file.errors == "strict"
    assert path.read_text() == "\\u03b8\n"
