"""Logs in HDF5 and MAT are read in a process of their own, whatever becomes of that one."""

import os
import sys
import tempfile
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import apart, hdf5_file, mat_file
from flexaxis.experiments.logs.reading.log import columns_of, open_log
from flexaxis.experiments.logs.trend.covariates import begun

N = 2000
TIME = np.arange(N) / 200
SIGNALS = {"time": TIME, "torque": np.sin(9 * TIME), "speed": np.cos(9 * TIME)}
linux = pytest.mark.skipif(sys.platform != "linux", reason="signals and limits differ")

# What becomes of a process when it reads, instead of what broken bytes would make of it.
ENDS = {
    "crash": "os.kill(os.getpid(), signal.SIGSEGV)",
    "memory": f"[numpy.empty(1 << 27) for _ in range({apart.MEMORY >> 30})]",  # none is touched
    "file": f"given[0].truncate({apart.MEMORY} + 1)",
    "hang": "time.sleep(600)",
    "leave": "os._exit(3)",
}
SAYS = {
    "crash": "reading it was ended by SIGSEGV",
    "memory": "takes more than the 8 GB of memory",
    "file": "no room for its columns",
    "hang": "not read within 1 s",
    "leave": "reading it ended with status 3",
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
def plant(log, tmp_path, monkeypatch):
    """Let the process that reads a log come to an end as soon as it reads or writes."""
    module, place = "hdf5_file", "h5py.File"
    if log.name == "log.mat":
        module, place = "mat_file", "scipy.io.loadmat"
    module = f"flexaxis.experiments.logs.reading.{module}"
    folder = tmp_path / "planted"
    folder.mkdir()

    def planted(end):
        at = "numpy.save" if end == "file" else place
        text = PLANTED.format(module=module, place=at, end=ENDS[end])
        (folder / "sitecustomize.py").write_text(text)
        monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
        monkeypatch.setattr(apart, "PATIENCE", 1.0 if end == "hang" else apart.PATIENCE)

    return planted


@linux
@pytest.mark.parametrize("end", ENDS)
def test_whatever_ends_it_is_one_line(end, log, plant, temporary, capsys):
    plant(end)
    out = log.with_name("rec.nc")
    words = ["--torque", "torque", "--speed", "speed", "-o", str(out)]
    assert main(["import", str(log), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert SAYS[end] in line and str(log) in line
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


def test_only_what_is_wanted_is_carried(tmp_path, temporary, monkeypatch):
    path = tmp_path / "log.h5"
    hdf5(path)
    with h5py.File(path, "a") as file:
        file["others"] = np.zeros((100_000, 60))  # 48 MB
    sizes = []
    original = np.load
    monkeypatch.setattr(
        np, "load", lambda file: [sizes.append(os.fstat(file.fileno()).st_size), original(file)][1]
    )
    open_log(path).load(["torque", "others[7]"])
    assert sizes == [8 * N + 8 * 100_000 + 2 * 128] * 2  # numbers, and a head for each column


def test_a_thousand_names_are_no_command_line(tmp_path):
    """One word of it may have 128 kB, and all of them 2 MB."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for i in range(3000):
            file[f"{i:01000}"] = [i, 0.0]
    found = open_log(path).numbers()
    assert len(found) == 3000 and all(int(name) == values[0] for name, values in found.items())


def test_dates_come_from_elsewhere(tmp_path, monkeypatch):
    path = tmp_path / "log.h5"
    hdf5(path)
    with h5py.File(path, "a") as file:
        file.attrs["Date"] = "2026-02-03 04:05:06"
        file.attrs["other"] = "2020-01-01"
        file.attrs["start"] = 1.7e9
    monkeypatch.setattr(h5py, "File", None)
    assert begun(path) == datetime(2026, 2, 3, 4, 5, 6)
    assert hdf5_file.texts_of(path, ["start", "none"]) == ["1700000000.000000"]
    path.write_bytes(path.read_bytes()[:200])
    assert begun(path) is None
    with pytest.raises(LogError, match="no HDF5 file, or a broken one"):
        hdf5_file.texts_of(path, ["date"])


def test_long_texts_are_cut(tmp_path):
    """The memory of what reads them has an end, and so has what it hands on."""
    ours, theirs = tmp_path / "log.mat", tmp_path / "log.h5"
    scipy.io.savemat(ours, {"date": "x" * 100_000})
    hdf5(theirs)
    with h5py.File(theirs, "a") as file:
        file.attrs["date"] = file["time"].attrs["units"] = "x" * 50_000
    assert mat_file.texts_of(ours, ["date"]) == hdf5_file.texts_of(theirs, ["date"]) == ["x" * 4096]
    assert open_log(theirs).units == {"time": "x" * 4096}


def test_no_room_for_columns(tmp_path, monkeypatch):
    path = tmp_path / "log.h5"
    hdf5(path)
    log = open_log(path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(LogError, match=r"log\.h5: lost in the folder for temporary files"):
        log.load(["time"])


def test_a_log_that_is_gone(tmp_path):
    path = Path(tmp_path / "log.h5")
    hdf5(path)
    log = open_log(path)
    path.unlink()
    with pytest.raises(LogError, match=r"log\.h5: no HDF5 file, or a broken one"):
        log.load(["time"])
