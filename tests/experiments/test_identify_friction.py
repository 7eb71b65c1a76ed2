"""identify, validate and track on logs with dry friction, of which the truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identify_axes import VALUES, log

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.track import track
from flexaxis.experiments.logs.verdict import Fit, validate
from flexaxis.experiments.running.estimators import parse

F_C = 10 * VALUES[1]["f_m"]


@pytest.fixture(scope="module")
def record():
    return log(1, 10, "moves", seed=0, seconds=20.0)


@pytest.fixture(scope="module")
def found(record):
    return identify(record, find_axis("one_mass"), friction="auto")


def test_dry_friction_is_found_and_told_from_viscous(found):
    values = dict(zip(found.names, found.theta, strict=True))
    assert found.friction == "coulomb" and not found.warnings
    assert found.answer.fitted.converged
    assert values["f_m"] == pytest.approx(VALUES[1]["f_m"], rel=0.03)
    assert values["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.03)
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)
    errors = found.theta - [{**VALUES[1], "f_c": F_C}[name] for name in found.names]
    assert np.all(
        abs(errors) < 4 * found.deviations
    )  # of a few millionths: nothing is stepped over


@pytest.mark.slow
def test_without_a_law_the_answer_says_what_is_missing(record):
    found = identify(record, find_axis("one_mass"), friction="none")
    values = dict(zip(found.names, found.theta, strict=True))
    assert values["f_m"] > 1.3 * VALUES[1]["f_m"]  # which is the trap
    assert any("dry friction" in text and "--friction auto" in text for text in found.warnings)


def test_a_linear_axis_gets_no_law():
    found = identify(log(1, 0, "multisine", seed=0, seconds=20.0), find_axis("one_mass"))
    assert found.friction == "none" and not found.warnings
    assert not any(tried.taken for tried in found.tried)
    assert "dry friction not added" in " ".join(one.text for one in found.findings)


@pytest.mark.slow
def test_a_validation_on_another_log_fits_with_the_law_alone(found, record):
    other = log(1, 10, "multisine", seed=1, seconds=20.0)
    good = validate(other, found.axis)
    linear = identify(record, find_axis("one_mass"), friction="none")
    assert good.fit.percent > 95
    assert validate(other, linear.axis).fit.percent < good.fit.percent - 5


def test_without_errors_of_the_model_deviations_are_those_of_the_noise(found):
    white = found.answer.fitted.deviations[: len(found.names)]
    assert np.all((found.deviations >= white) & (found.deviations < 2 * white))


@pytest.mark.slow
def test_a_constant_torque_is_an_estimate_and_no_friction():
    found = identify(
        log(1, 10, "moves", seed=0, seconds=20.0, offset=0.02),
        find_axis("one_mass"),
        friction="coulomb",
    )
    assert found.axis.offset == pytest.approx(0.02, rel=0.05)
    assert found.axis.offset == found.estimates["offset"][0]
    values = dict(zip(found.names, found.theta, strict=True))
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)


@pytest.mark.slow
def test_what_identify_wrote_is_where_track_begins(record, found, tmp_path, capsys):
    path, axis = tmp_path / "rec.nc", tmp_path / "axis.toml"
    record.save(path)
    found.axis.save(axis)
    again = find_axis(str(axis))
    assert again.model.laws == found.axis.model.laws
    assert again.deviation.keys() == set(found.names)
    words = ["track", path, "--model", axis, "--identify", "1/J_m", "--identify", "f_m", "--json"]
    assert main([*map(str, words), "--estimator", "glr"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["last"]["1/J_m"] == pytest.approx(1 / VALUES[1]["J_m"], rel=0.05)
    assert told["last"]["f_c"] == pytest.approx(F_C, rel=0.1)
    assert main([*map(str, words), "--estimator", "ekf"]) == 2
    assert "glr" in capsys.readouterr().err


def test_a_law_that_there_is_not_is_refused(record):
    with pytest.raises(LogError, match="one of auto, none"):
        identify(record, find_axis("one_mass"), friction="dry")


def test_the_units_of_values_are_stated(found):
    assert found.units.startswith("SI, if a logged torque of 1 equals 1 N m; give")
    assert "equals 1 N; give" in replace(found, linear=True).units
    assert replace(found, torque_unit="kNm").units == "SI"  # it was read in N m
    known = replace(found, torque_unit="A", axis=found.axis.having({"k_T": 0.6}))
    assert known.units == "SI, if a logged torque of 1 A equals 0.6 N m"


@pytest.mark.slow
def test_a_validation_can_fail(found, record, tmp_path, capsys):
    other = log(1, 10, "moves", seed=1, seconds=20.0)
    assert validate(other, found.axis).unlike == ""
    heavier = validate(replace(other, torque=0.5 * other.torque), found.axis)
    assert "a simulation from the torque explains only" in heavier.unlike
    turned = validate(replace(other, torque=-other.torque), replace(found.axis, error=None))
    assert turned.fit.percent < 0 and "unit or sign" in turned.unlike
    here, there = tmp_path / "here.nc", tmp_path / "there.nc"
    record.save(here)
    replace(other, torque=0.5 * other.torque).save(there)
    words = ["identify", here, "--model", "one_mass", "-o", tmp_path / "axis.toml"]
    assert main([*map(str, words), "--validate", str(there)]) == 1
    assert "on the other log, a simulation from the torque explains" in capsys.readouterr().out


def test_less_motion_is_a_poorer_fit_and_no_contradiction():
    assert Fit(80.0, 0.2, 1.0).unlike(0.2) == ""
    assert "80.0 % is expected" in Fit(60.0, 0.4, 1.0).unlike(0.2)
    assert "explains only -3.0 %" in Fit(-3.0, 0.1, 0.097).unlike(0.1)


def test_an_axis_knows_the_rate_of_its_noise(found, tmp_path):
    found.axis.save(tmp_path / "axis.toml")
    axis = find_axis(str(tmp_path / "axis.toml"))
    assert axis.rate == pytest.approx(500.0)
    other = log(1, 10, "moves", seed=1, seconds=5.0, period=0.004)
    with pytest.raises(LogError, match="--resample 500"):
        validate(other, axis)
    with pytest.raises(LogError, match="identified at 500 Hz"):
        track(other, axis, parse("ekf"), identify=("1/J_m",))
