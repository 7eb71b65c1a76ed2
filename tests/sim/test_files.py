"""Files that are whole or not there, whatever interrupts the writing."""

import errno
import os
import subprocess
import sys
import threading

import pytest

from flexaxis.sim.storage.atomic_files import atomic


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


HALF = """
import sys, time
from flexaxis.sim.storage.atomic_files import atomic
with atomic(sys.argv[1]) as new:
    new.write_text("half")
    print("there", flush=True)
    time.sleep(60)
"""


def test_what_a_killed_writer_left_goes_with_the_next_and_that_of_a_living_one_stays(tmp_path):
    path = tmp_path / "table.csv"
    writers = [
        subprocess.Popen([sys.executable, "-c", HALF, path], stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    try:
        assert [writer.stdout.readline() for writer in writers] == [b"there\n"] * 2
        writers[0].kill()
        writers[0].wait()
        assert len(os.listdir(tmp_path)) == 2
        run = (
            "import sys; from flexaxis.sim.storage.atomic_files import atomic\n"
            "with atomic(sys.argv[1]) as new:\n"
        )
        run += "    new.write_text('whole')"
        subprocess.run([sys.executable, "-c", run, path], check=True)
        (left,) = set(os.listdir(tmp_path)) - {"table.csv"}
        assert (tmp_path / left / "table.csv").read_text() == "half"
        assert path.read_text() == "whole"
    finally:
        for writer in writers:
            writer.kill()
            writer.communicate()


@pytest.mark.parametrize(
    "name", [".backup.part", ".x.flexaxis", f".t.{'0' * 32}-00000000.flexaxis", f".t.{'0' * 32}"]
)
def test_what_is_not_ours_or_of_another_machine_stays(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / name / "file").touch()
    write(tmp_path / "table.csv", "x")
    assert sorted(os.listdir(tmp_path)) == sorted([name, "table.csv"])
    assert (tmp_path / name / "file").exists()


def test_a_lock_comes_too_late_where_the_folder_was_cleared_before_it(tmp_path, monkeypatch):
    """Between the making of a folder and its lock another process may take it for a dead one."""
    from flexaxis.sim.storage import atomic_files as files

    locked, taken = files._locked, []

    def late(folder, *, wait):
        if wait and not taken:
            taken.append(folder)
            files._clear.__wrapped__(tmp_path, 0)
        return locked(folder, wait=wait)

    monkeypatch.setattr(files, "_locked", late)
    write(tmp_path / "table.csv", "x")
    assert taken and not taken[0].exists() and os.listdir(tmp_path) == ["table.csv"]


def test_a_drive_without_locks_is_written_to_all_the_same(tmp_path, monkeypatch):
    from flexaxis.sim.storage import atomic_files as files

    def refuse(file, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(files.fcntl, "flock", refuse)
    write(tmp_path / "table.csv", "x")
    assert os.listdir(tmp_path) == ["table.csv"]


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
