"""Estimates from file to file: the pieces make no difference, the memory does not grow."""

import subprocess
import sys

import h5netcdf
import h5py
import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.running import estimate as module
from flexaxis.experiments.running.estimate import estimate
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, record_pieces
from flexaxis.sim.simulate import simulate


@pytest.fixture(scope="module")
def record(short):
    return simulate(short, [0])[0]


def read(path, name):
    with h5netcdf.File(path) as file:
        return file[name][...]


@pytest.fixture(params=[1599, 700, 100_000])
def piece(request, monkeypatch):
    """Length of the pieces [samples]."""
    monkeypatch.setattr(module, "PIECE", request.param)


@pytest.mark.usefixtures("piece")
@pytest.mark.parametrize("covariance", [True, False])
def test_pieces_make_no_difference(short, record, tmp_path, covariance):
    source, target = record.save(tmp_path / "rec.nc"), tmp_path / "est.nc"
    spec = parse("rpem-forgetting")
    found = estimate(source, spec, target, covariance=covariance)
    whole = run_estimator(build(spec, short), record.torque, record.speed)
    np.testing.assert_array_equal(read(target, "theta"), whole)
    np.testing.assert_array_equal(read(target, "time"), record.time)
    np.testing.assert_array_equal([*found.last.values()], whole[-1])
    np.testing.assert_allclose([*found.truth.values()], [1.0, 1.25, 0.075])
    with h5netcdf.File(target) as file:
        assert ("covariance" in file.variables) == covariance


def test_a_bad_sample_in_a_later_piece_is_named_and_leaves_no_file(record, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "PIECE", 500)
    source, target = record.save(tmp_path / "rec.nc"), tmp_path / "est.nc"
    with h5netcdf.File(source, "a") as file:
        file["speed"][1234] = np.nan
    with pytest.raises(RecordError, match=r"rec\.nc: speed is nan at sample 1234"):
        estimate(source, parse("frozen"), target)
    assert [f.name for f in tmp_path.iterdir() if f.suffix == ".nc"] == ["rec.nc"]
    with h5netcdf.File(source, "a") as file:
        file["speed"][1234] = 0.0
        file["time"][1000:] = file["time"][1000:] + 0.001  # a gap between two pieces
    with pytest.raises(RecordError, match=r"rec\.nc: time is not even: .* sample 99. to"):
        estimate(source, parse("frozen"), target)


def test_a_log_without_a_scenario_needs_one(short, record, tmp_path):
    log = Record(time=record.time, torque=record.torque, speed=record.speed)
    source = log.save(tmp_path / "log.nc")
    with pytest.raises(RecordError, match=r"log\.nc does not say its scenario.*--scenario"):
        estimate(source, parse("frozen"), tmp_path / "est.nc")
    found = estimate(source, parse("frozen"), tmp_path / "est.nc", scenario=short)
    assert not found.truth and found.samples == 1600
    with pytest.raises(EstimatorError, match=r"reads 'increment', which .* lacks"):
        other = short.override({"output": "increment"})
        estimate(source, parse("frozen"), tmp_path / "est.nc", scenario=other)


def test_the_last_piece_is_never_a_single_sample(record, tmp_path):
    source = record.save(tmp_path / "rec.nc")
    sizes = [len(piece.time) for piece in record_pieces(source, samples=1599)]
    assert sizes == [1600]
    firsts = [piece.first for piece in record_pieces(source, samples=500)]
    assert firsts == [0, 500, 1000, 1500]


@pytest.mark.parametrize("length", [1599, 1601])
def test_signals_of_different_length_are_refused(record, tmp_path, length):
    source = record.save(tmp_path / "rec.nc")
    with h5py.File(source, "a") as file:
        del file["speed"]
        file["speed"] = np.zeros(length)
    with pytest.raises(RecordError, match=rf"rec\.nc: speed has shape \({length},\)"):
        estimate(source, parse("frozen"), tmp_path / "est.nc")
    assert not (tmp_path / "est.nc").exists()


PROGRAM = """
import sys
from pathlib import Path
from flexaxis.experiments.running.estimate import estimate
from flexaxis.experiments.running.estimators import parse
estimate(Path(sys.argv[1]), parse("rpem-forgetting"), Path(sys.argv[2]), covariance=False)
status = Path("/proc/self/status").read_text()
print(status.split("VmHWM:")[1].split()[0])
"""


def peak_memory(record, repeats, folder):
    """Peak memory [kB] of a process that estimates over the record, repeated."""
    samples = repeats * len(record.time)
    long = Record(
        time=np.arange(samples) * 0.005,
        torque=np.tile(record.torque, repeats),
        speed=np.tile(record.speed, repeats),
        scenario=record.scenario,
    )
    source = long.save(folder / f"{repeats}.nc")
    command = [sys.executable, "-c", PROGRAM, str(source), str(folder / "est.nc")]
    return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc for the peak")
def test_memory_does_not_grow_with_the_record(record, tmp_path):
    """Ten hours, 7.2 million samples, against twenty minutes."""
    short, long = peak_memory(record, 150, tmp_path), peak_memory(record, 4500, tmp_path)
    print(f"peak {short / 1024:.0f} MB for 20 min, {long / 1024:.0f} MB for 10 h")
    # The record alone is 173 MB and the estimates as much; the allocator's noise is a few MB.
    assert long < short + 40 * 1024
