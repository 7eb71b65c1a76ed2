"""A file of HDF5 that says its data lie in another file does not get at that file."""

import h5py
import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.hdf5_file import open_file
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import count_samples, load_record
from flexaxis.sim.storage.hdf5_inside import only_inside

N = 400
SECRET = np.arange(N) + 0.5


def external(file, name, other):
    file.create_dataset(name, (N,), "<f8", external=[(str(other / "secret.bin"), 0, 8 * N)])


def virtual(file, name, other):
    layout = h5py.VirtualLayout((N,), "<f8")
    layout[:] = h5py.VirtualSource(str(other / "secret.h5"), "x", (N,))
    file.create_virtual_dataset(name, layout)


def linked(file, name, other):
    file[name] = h5py.ExternalLink(str(other / "secret.h5"), "/x")


@pytest.fixture
def secret(tmp_path):
    folder = tmp_path / "private"
    folder.mkdir()
    SECRET.tofile(folder / "secret.bin")
    with h5py.File(folder / "secret.h5", "w") as file:
        file["x"] = SECRET
    return folder


@pytest.fixture(params=[external, virtual, linked])
def stranger(request, tmp_path, secret):
    """A file with time and torque of its own, and a speed that is not."""
    path = tmp_path / "stranger.nc"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(N) / 200
        file["torque"] = np.zeros(N)
        request.param(file, "speed", secret)
    return path


def test_the_secret_would_be_read(stranger):
    with h5py.File(stranger) as file:
        assert file["speed"][()].tolist() == SECRET.tolist()


def test_neither_as_a_record_nor_as_a_log(stranger):
    for read in (load_record, count_samples):
        with pytest.raises(RecordError, match=r"stranger\.nc: speed lies in another file"):
            read(stranger)
    with pytest.raises(LogError, match="speed lies in another file"):
        open_file(stranger)


def test_the_answer_is_one_line(stranger, tmp_path, capsys):
    words = ["--torque", "torque", "--speed", "speed", "-o", str(tmp_path / "rec.nc")]
    assert main(["import", str(stranger), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "stranger.nc: speed lies in another file" in line and "secret" in line
    assert not (tmp_path / "rec.nc").exists()


def test_what_lies_in_the_file_itself_is_taken(tmp_path):
    path = tmp_path / "own.h5"
    with h5py.File(path, "w") as file:
        file["a/x"] = SECRET
        file["soft"] = h5py.SoftLink("/a/x")
        file["a/round"] = file["a"]
        layout = h5py.VirtualLayout((N,), "<f8")
        layout[:] = h5py.VirtualSource(file["a/x"])
        file.create_virtual_dataset("y", layout)
    with h5py.File(path) as file:
        only_inside(file, ValueError)
        assert file["y"][0] == 0.5


def test_what_a_file_holds_itself_may_be_of_any_kind(tmp_path, monkeypatch):
    """Types with names of their own, as NetCDF has them, and a virtual set of the file itself."""
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["kind"] = h5py.enum_dtype({"ok": 0, "lost": 1}, basetype="i1")
        file["speed"] = SECRET
        for number, name in enumerate([".", "log.h5"]):
            layout = h5py.VirtualLayout((N,), "<f8")
            layout[:] = h5py.VirtualSource(name, "speed", (N,))
            file.create_virtual_dataset(f"copy{number}", layout)
    monkeypatch.chdir(tmp_path.parent)
    log = open_file(tmp_path / "log.h5")
    np.testing.assert_array_equal(log.load(["copy1"])["copy1"], SECRET)
