"""Estimates from file to file."""

import h5netcdf
import numpy as np
import pytest

import flexaxis as fx
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record
from flexaxis.sim.simulate import simulate
from tests.experiments.command import flexaxis


@pytest.fixture(scope="module")
def record(short):
    return simulate(short, [0])[0]


def test_the_command_writes_what_the_estimator_gives(short, record, tmp_path, capsys):
    source, target = record.save(tmp_path / "rec.nc"), tmp_path / "est.nc"
    assert flexaxis(capsys, "estimate", source, "-o", target)[0] == 0
    whole = run_estimator(build(parse("rpem-forgetting"), short), record.torque, record.speed)
    with h5netcdf.File(target) as file:
        np.testing.assert_array_equal(file["theta"][...], whole)
        np.testing.assert_array_equal(file["time"][...], record.time)
        assert "covariance" in file.variables


def test_a_log_without_a_scenario_needs_one(short, record, tmp_path):
    log = Record(time=record.time, torque=record.torque, speed=record.speed)
    source = log.save(tmp_path / "log.nc")
    with pytest.raises(RecordError, match="does not contain its scenario"):
        fx.estimate(source, "frozen")
    assert not fx.estimate(source, "frozen", scenario=short).truth
