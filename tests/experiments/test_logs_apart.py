"""Logs in HDF5 and MAT are read in a process of their own, whatever becomes of that one."""

import os
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import mat_file
from flexaxis.experiments.logs.reading.log import columns_of, open_log

N = 2000
TIME = np.arange(N) / 200
SIGNALS = {"time": TIME, "torque": np.sin(9 * TIME), "speed": np.cos(9 * TIME)}
linux = pytest.mark.skipif(sys.platform != "linux", reason="signals and limits differ")

# What becomes of a process when it reads, instead of what broken bytes would make of it.
ENDS = {
    "crash": "os.kill(os.getpid(), signal.SIGSEGV)",
    "memory": f"[numpy.empty(1 << 27) for _ in range({mat_file.MEMORY >> 30})]",  # none is touched
    "file": f"given[0].truncate({mat_file.MEMORY} + 1)",
    "hang": "time.sleep(600)",
    "leave": "os._exit(3)",
}
SAYS = {
    "crash": "reading it was ended by SIGSEGV",
    "memory": "takes more than the 8 GB of memory",
    "file": "no room for its columns",
    "hang": "not read within 1 s",
    "leave": "reading it was ended with status 3",
}
PLANTED = """
import os, signal, sys, time
if {module!r} in sys.orig_argv:
    import h5py, numpy, scipy.io
    def end(*given, **options):
        {end}
        return real(*given, **options)
    real = {place}
    {place} = end
"""


def netcdf(path):
    from h5netcdf.legacyapi import Dataset

    with Dataset(path, "w") as file:
        file.createDimension("time", N)
        for name, values in SIGNALS.items():
            file.createVariable(name, float, ("time",))[:] = values


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in SIGNALS.items():
            file[name] = values


def matlab73(path):
    """A file of MATLAB: a block of text before that of HDF5, matrices of one row."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in SIGNALS.items():
            file[name] = values[np.newaxis]
        file["#refs#/a"] = TIME
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(128))


def mat(path):
    scipy.io.savemat(path, SIGNALS)


KINDS = {"log.h5": hdf5, "log.nc": netcdf, "log73.mat": matlab73, "log.mat": mat}


@pytest.fixture(params=KINDS)
def log(request, tmp_path):
    path = tmp_path / request.param
    KINDS[request.param](path)
    return path


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The folder for what is temporary, of this process and of those it starts."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@pytest.fixture
def plant(tmp_path, monkeypatch):
    """Let the process that reads a MAT file come to an end as soon as it reads or writes.

    That of HDF5 is tried by tests/sim/test_hdf5_apart.py.
    """
    folder = tmp_path / "planted"
    folder.mkdir()

    def planted(end):
        at = "numpy.save" if end == "file" else "scipy.io.loadmat"
        text = PLANTED.format(module=mat_file.MODULE, place=at, end=ENDS[end])
        (folder / "sitecustomize.py").write_text(text)
        monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
        monkeypatch.setattr(mat_file, "PATIENCE", 1.0 if end == "hang" else mat_file.PATIENCE)

    return planted


@linux
@pytest.mark.parametrize("end", ENDS)
def test_whatever_ends_it_is_one_line(end, tmp_path, plant, temporary, capsys):
    plant(end)
    log, out = tmp_path / "log.mat", tmp_path / "rec.nc"
    mat(log)
    words = ["--torque", "torque", "--speed", "speed", "-o", str(out)]
    assert main(["import", str(log), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert SAYS[end] in line and line.count(str(log)) == 1 and "lost" not in line
    assert not out.exists() and not any(temporary.iterdir())


def test_the_values_are_those_of_the_file(log, temporary):
    found = open_log(log)
    assert set(found.names) == set(SIGNALS)
    for name, values in found.load(["speed", "time"]).items():
        assert values.dtype == float
        np.testing.assert_array_equal(values, SIGNALS[name])
    assert set(found.numbers()) == set(SIGNALS)
    assert not any(temporary.iterdir())


def test_every_kind_of_number_and_place(tmp_path):
    """Held against the library itself, in this process."""
    path, rng = tmp_path / "log.h5", np.random.default_rng(4)
    with h5py.File(path, "w") as file:
        file["a/wide"] = rng.normal(size=(3, 70)).astype(">f4")
        file["a/tall"] = rng.integers(-9, 9, (70, 2), np.int16)
        file.create_dataset("packed", data=rng.normal(size=N), compression="gzip", shuffle=True)
        file["on"] = rng.random(50) > 0.5
        file["a/tall"].attrs["units"] = "rad"
        file["text"] = "no column"
        file["one"] = 1.0
        file["größe \u2028x"] = np.arange(5.0)
    with h5py.File(path) as file:
        expected = {
            name: column
            for place in ("a/tall", "a/wide", "on", "packed", "größe \u2028x")
            for name, column in columns_of(place.replace("/", "."), file[place][()])
        }
    log = open_log(path)
    assert set(log.names) == set(expected) and log.units == {"a.tall[0]": "rad", "a.tall[1]": "rad"}
    for name, values in log.numbers().items():
        np.testing.assert_array_equal(values, expected[name])


@pytest.mark.slow
def test_a_thousand_names_are_no_command_line(tmp_path):
    """One word of it may have 128 kB, and all of them 2 MB."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for i in range(3000):
            file[f"{i:01000}"] = [i, 0.0]
    found = open_log(path).numbers()
    assert len(found) == 3000 and all(int(name) == values[0] for name, values in found.items())


def test_a_long_unit_is_cut(tmp_path):
    """The memory of what reads them has an end, and so has what it hands on."""
    path = tmp_path / "log.h5"
    hdf5(path)
    with h5py.File(path, "a") as file:
        file["time"].attrs["units"] = "x" * 50_000
    assert open_log(path).units == {"time": "x" * 4096}


def test_no_room_for_columns(tmp_path, monkeypatch):
    path = tmp_path / "log.mat"
    mat(path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(LogError, match=r"log\.mat: lost in the folder for temporary files"):
        open_log(path)


def test_a_log_that_is_gone(tmp_path):
    path = Path(tmp_path / "log.h5")
    hdf5(path)
    log = open_log(path)
    path.unlink()
    with pytest.raises(LogError, match=r"log\.h5: no HDF5 file, or a broken one"):
        log.load(["time"])
