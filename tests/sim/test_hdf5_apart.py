"""HDF5 files of strangers are gone through in a process that may end instead of ours."""

import multiprocessing
import os
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import load_record, record_pieces
from flexaxis.sim.storage import hdf5_apart
from flexaxis.sim.storage.hdf5_apart import gone_through

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


def _large(file, name):
    values = np.random.default_rng(0).random(1 << 23)
    file.create_dataset(name, data=values, chunks=values.shape, compression="gzip", shuffle=True)


def _bomb(file, name):
    """Make a piece that says it holds N numbers, and unpacks to 320 MB."""
    data = file.create_dataset(name, (N,), float, chunks=(N,), compression="gzip")
    pack = zlib.compressobj(1)
    packed = [pack.compress(bytes(1 << 24)) for _ in range(19)]
    data.id.write_direct_chunk((0,), b"".join([*packed, pack.flush()]))


@pytest.mark.skipif(os.name == "nt", reason="no limits of memory there")
@pytest.mark.parametrize(
    ("read", "memory"),
    [(READS[0], 600 << 20), (READS[0], hdf5_apart.MEMORY), (READS[1], 600 << 20)],
)
def test_a_piece_that_unpacks_to_far_more_than_it_says_is_not_unpacked_here(
    read, memory, tmp_path, reader, monkeypatch
):
    monkeypatch.setattr(hdf5_apart, "MEMORY", memory)
    taken = bytearray(1 << 29)  # as much as the piece: a peak of ours is none of the other process
    taken[::4096] = b"x" * len(taken[::4096])
    _record(tmp_path / "bomb.nc", speed=_bomb)
    with pytest.raises(RecordError, match=r"bomb\.nc: /speed unpacks to more than the 8000 bytes"):
        read(tmp_path / "bomb.nc")


@pytest.mark.slow
def test_a_large_piece_that_is_what_it_says_is_fine(tmp_path, reader):
    """Four times and some megabytes are spared: a filter has its own copies."""
    _record(tmp_path / "large.nc", notes=_large)
    assert len(load_record(tmp_path / "large.nc").time) == N


@pytest.mark.skipif(not Path("/proc/self/limits").exists(), reason="Linux tells its limits")
def test_whoever_reads_has_so_much_memory_and_no_more(good, reader):
    """Else a piece that unpacks to all memory would take it before anybody can look."""
    load_record(good)
    limits = Path(f"/proc/{reader._process.pid}/limits").read_text().splitlines()
    (told,) = [line.split()[3:5] for line in limits if line.startswith("Max address space")]
    assert told == 2 * [str(hdf5_apart.MEMORY)]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="Linux forgets a peak")
def test_what_a_file_took_before_hides_no_other(tmp_path, reader):
    def zeros(file, name):
        file.create_dataset(name, data=np.zeros(5 << 23), chunks=(5 << 23,), compression=1)

    _record(tmp_path / "large.nc", notes=zeros)
    load_record(tmp_path / "large.nc")
    _record(tmp_path / "bomb.nc", speed=_bomb)
    with pytest.raises(RecordError, match="unpacks to more than"):
        load_record(tmp_path / "bomb.nc")


def test_what_is_damaged_and_not_wanted_does_no_harm(tmp_path, reader):
    def damaged(file, name):
        data = file.create_dataset(name, (N,), float, chunks=(N,), compression="gzip")
        data.id.write_direct_chunk((0,), b"no gzip at all")

    _record(tmp_path / "log.nc", notes=damaged)
    assert len(load_record(tmp_path / "log.nc").time) == N
    _record(tmp_path / "log.nc", speed=damaged)
    with pytest.raises(RecordError, match=r"or a broken one \("):
        load_record(tmp_path / "log.nc")


@pytest.mark.parametrize("read", READS)
def test_of_a_file_that_ends_its_reader_we_hear_in_one_line_and_go_on(
    read, good, tmp_path, dying, monkeypatch
):
    with monkeypatch.context():
        dying("os.kill(os.getpid(), 11)")
        with pytest.raises(
            RecordError, match=r"good\.nc: the process .* was ended by signal 11; is it broken"
        ):
            read(good)
    monkeypatch.setattr(hdf5_apart, "MODULE", "flexaxis.sim.storage.hdf5_apart")
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
def test_a_fork_has_a_process_of_its_own(good, monkeypatch):
    monkeypatch.setattr(hdf5_apart, "PATIENCE", 60.0)  # if two ask one, each may miss its answer
    load_record(good)
    os.utime(good)  # so that both ask again
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    forks = [
        context.Process(target=_whether_it_reads, args=(good, answers), daemon=True)
        for _ in range(3)
    ]
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
    with pytest.raises(RecordError, match=r"true_parameters has shape \(1000, 1000000000\)"):
        read(tmp_path / "wide.nc")


def _never_written(shape, kind=float):
    """Make what takes no room in the file, and a lot where it is read."""
    chunks = tuple(min(n, 1000) for n in shape)
    return lambda file, name: file.create_dataset(name, shape, kind, chunks=chunks)


def _names(rows):
    return lambda file, name: file.create_dataset(name, (rows,), h5py.string_dtype(), chunks=(1,))


FEW = (N, 2)
NEVER_WRITTEN = [
    ({"speed": _never_written((N,), "S2000000")}, "speed holds no numbers"),
    ({"valid": _never_written((N,), "S2000000")}, "valid holds no numbers"),
    ({"true_parameters": _never_written((N, 1000, 300))}, r"has shape \(1000, 1000, 300\)"),
    ({"true_parameters": _never_written((10**9, 1))}, r"has shape \(1000000000, 1\)"),
    (
        {"true_parameters": _never_written(FEW), "parameter": _names(10**9)},
        r"has shape \(1000000000,\); it names 2 columns",
    ),
]


@pytest.mark.parametrize("read", READS)
@pytest.mark.parametrize(("variables", "told"), NEVER_WRITTEN, ids=lambda each: str(each)[:20])
def test_what_was_never_written_fills_no_memory(read, variables, told, tmp_path):
    _record(tmp_path / "small.nc", **variables)
    assert (tmp_path / "small.nc").stat().st_size < 50_000
    with pytest.raises(RecordError, match=told):
        read(tmp_path / "small.nc")


@pytest.mark.parametrize("read", READS)
def test_what_lies_in_other_files_is_found_though_a_name_is_no_text(read, tmp_path):
    """h5py stumbles over that name: who cannot tell where data lie does not read them."""
    (tmp_path / "secret").write_bytes(bytes(8 * N))

    def virtual(file, name):
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        space = h5py.h5s.create_simple((N,))
        how.set_virtual(space, b"\xff\xfe.h5", b"x", space)
        h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_DOUBLE, space, how)

    def external(file, name):
        place = [(str(tmp_path / "secret"), 0, 8 * N)]
        file.create_dataset(name, (N,), float, external=place)

    _record(tmp_path / "log.nc", aaa=virtual, speed=external)
    with pytest.raises(RecordError, match=r"log\.nc: "):
        read(tmp_path / "log.nc")


def test_what_a_site_says_when_its_python_starts_is_no_answer(good, tmp_path, monkeypatch, reader):
    (tmp_path / "sitecustomize.py").write_text("print('good morning')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert len(load_record(good).time) == N


@pytest.mark.parametrize("program", [None, "/bin/true", "/no/such/python"])
def test_where_there_is_no_python_the_file_is_not_blamed(program, good, monkeypatch, reader):
    monkeypatch.setattr(sys, "executable", program)
    with pytest.raises(RecordError, match=r"good\.nc: no process to read it with"):
        load_record(good)


def test_a_name_that_no_system_has_is_no_file():
    with pytest.raises(RecordError, match="no such file"):
        load_record("a\0b.nc")


def test_the_reader_runs_nothing_of_the_current_folder(good, tmp_path, monkeypatch, reader):
    (tmp_path / "h5py.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    load_record(good)
    assert not Path("ran").exists()
