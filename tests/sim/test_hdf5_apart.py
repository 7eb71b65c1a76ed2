"""HDF5 files of strangers are gone through in a process that may end instead of ours."""

import multiprocessing
import os
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexaxis.sim import hdf5_apart
from flexaxis.sim.errors import RecordError
from flexaxis.sim.hdf5_apart import gone_through
from flexaxis.sim.record import load_record, record_pieces

N = 1000
READS = (load_record, lambda path: list(record_pieces(path)))


@pytest.fixture
def reader(monkeypatch):
    """A process of its own for a test, and none when it is over."""
    one = hdf5_apart._Reader()
    monkeypatch.setattr(hdf5_apart, "_reader", one)
    yield one
    one.end()


@pytest.fixture
def dying(monkeypatch, tmp_path, reader):
    """Let the process do something else than to answer."""

    def do(what):
        (tmp_path / "dying.py").write_text(f"import os, sys, time\nsys.stdin.readline()\n{what}\n")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        monkeypatch.setattr(hdf5_apart, "MODULE", "dying")

    return do


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "good.nc"
    _record(path)
    return path


def _record(path, **others):
    """Write a record, as of somebody else; a function makes a variable its own way."""
    with h5py.File(path, "w") as file:
        for name in dict.fromkeys(("time", "torque", "speed", *others)):
            if callable(make := others.get(name)):
                make(file, name)
            else:
                file[name] = np.arange(N) * 1e-3


def _bomb(file, name):
    """Make a piece that says it holds N numbers, and unpacks to 800 MB."""
    data = file.create_dataset(name, (N,), float, chunks=(N,), compression="gzip")
    pack = zlib.compressobj(1)
    packed = [pack.compress(bytes(1 << 24)) for _ in range(48)]
    data.id.write_direct_chunk((0,), b"".join([*packed, pack.flush()]))


@pytest.mark.parametrize("read", READS)
def test_a_piece_that_unpacks_to_far_more_than_it_says_is_not_unpacked_here(
    read, tmp_path, reader, monkeypatch
):
    monkeypatch.setattr(hdf5_apart, "MEMORY", 700 << 20)
    _record(tmp_path / "bomb.nc", speed=_bomb)
    with pytest.raises(RecordError, match=r"bomb\.nc: /speed cannot be unpacked"):
        read(tmp_path / "bomb.nc")


@pytest.mark.parametrize("read", READS)
def test_of_a_file_that_ends_its_reader_we_hear_in_one_line_and_go_on(
    read, good, tmp_path, dying, monkeypatch
):
    with monkeypatch.context():
        dying("os.kill(os.getpid(), 11)")
        with pytest.raises(RecordError, match=r"good\.nc: the process .* status -11; is it broken"):
            read(good)
    monkeypatch.setattr(hdf5_apart, "MODULE", "flexaxis.sim.hdf5_apart")
    read(good)  # by the next process


def test_one_that_was_ended_since_is_no_fault_of_the_file(good, reader):
    load_record(good)
    reader._process.kill()
    os.utime(good)
    assert len(load_record(good).time) == N


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_what_is_no_file_is_not_opened(tmp_path, reader):
    os.mkfifo(tmp_path / "pipe.nc")  # to open it is to wait for a writer
    gone_through(tmp_path / "pipe.nc", RecordError)
    with pytest.raises(RecordError, match="no such file"):
        load_record(tmp_path / "pipe.nc")


def test_nobody_waits_for_ever(good, dying, monkeypatch):
    monkeypatch.setattr(hdf5_apart, "PATIENCE", 0.5)
    dying("time.sleep(60)")
    with pytest.raises(RecordError, match=r"not read within 0\.5 s"):
        load_record(good)


def test_a_file_that_does_not_change_is_gone_through_once(good, reader, monkeypatch):
    asked = []
    answer = reader.ask
    monkeypatch.setattr(reader, "ask", lambda *words: asked.append(words) or answer(*words))
    for _ in range(3):
        load_record(good)
        gone_through(good, RecordError, data=False)
    assert asked == [(str(good), True)]
    before = good.stat().st_mtime_ns
    _record(good, increment=0)
    os.utime(good, ns=(before + 1, before + 1))
    load_record(good)
    assert len(asked) == 2


def test_what_describes_it_can_be_enough(tmp_path, reader):
    _record(tmp_path / "bomb.nc", speed=_bomb)
    gone_through(tmp_path / "bomb.nc", RecordError, data=False)


def test_what_is_packed_in_an_unknown_way_and_not_wanted_does_no_harm(tmp_path, reader):
    def unknown(file, name):
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk((N,))
        how.set_filter(40_000, h5py.h5z.FLAG_OPTIONAL, ())  # a number that nobody has
        space = h5py.h5s.create_simple((N,))
        data = h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_DOUBLE, space, how)
        data.write_direct_chunk((0,), bytes(8))

    _record(tmp_path / "log.nc", other=unknown)
    assert len(load_record(tmp_path / "log.nc").time) == N


def _whether_it_reads(path, answers):
    own = hdf5_apart._reader._process is None  # else two would ask one, and take its answers
    answers.put((own, load_record(path).time.size))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")
def test_a_fork_has_a_process_of_its_own(good):
    load_record(good)
    os.utime(good)  # so that both ask again
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    forks = [context.Process(target=_whether_it_reads, args=(good, answers)) for _ in range(3)]
    for fork in forks:
        fork.start()
    load_record(good)
    assert [answers.get(timeout=60) for _ in forks] == [(True, N)] * 3
    for fork in forks:
        fork.join()


def _long(file, name):
    file.create_dataset(name, (10**9,), float, chunks=(1 << 16,), compression="gzip")


def _wide(file, name):
    file.create_dataset(name, (N, 10**9), float, chunks=(1, 1 << 16), compression="gzip")


def test_what_takes_more_than_the_memory_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "long.nc"
    _record(path, time=_long, torque=_long, speed=_long)
    with pytest.raises(RecordError, match="1000000000 samples take 24 GB at once"):
        load_record(path)


@pytest.mark.parametrize("read", READS)
def test_there_are_no_more_columns_than_parameters(read, tmp_path):
    _record(tmp_path / "wide.nc", true_parameters=_wide)
    with pytest.raises(RecordError, match="true_parameters has 1000000000 columns"):
        read(tmp_path / "wide.nc")


def test_the_reader_runs_nothing_of_the_current_folder(good, tmp_path, monkeypatch, reader):
    (tmp_path / "h5py.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    load_record(good)
    assert not Path("ran").exists()
