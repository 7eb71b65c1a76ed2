"""identify, validate and track on logs with dry friction, of which the truth is known."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identify_axes import VALUES, log

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.identify import identify, units_of
from flexaxis.experiments.logs.track import track
from flexaxis.experiments.logs.verdict import unlike, validate
from flexaxis.experiments.running.estimators import parse

F_C = 10 * VALUES[1]["f_m"]


@pytest.fixture(scope="module")
def record():
    return log(1, 10, "moves", seed=0, seconds=20.0)


@pytest.fixture(scope="module")
def found(record):
    return identify(record, find_axis("one_mass"), friction="auto")


def test_dry_friction_is_found_and_told_from_viscous(found):
    values = found.estimates.loc["value"]
    assert found.friction == "coulomb" and not found.warnings
    assert found.answer.fitted.converged
    assert values["f_m"] == pytest.approx(VALUES[1]["f_m"], rel=0.03)
    assert values["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.03)
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)
    for name in ("J_m", "f_m", "f_c"):  # sd of a few millionths: nothing is stepped over
        value, sd = found.estimates[name]
        assert abs(value - {**VALUES[1], "f_c": F_C}[name]) < 4 * sd


@pytest.mark.slow
def test_without_a_law_the_answer_says_what_is_missing(record):
    found = identify(record, find_axis("one_mass"), friction="none")
    values = found.estimates.loc["value"]
    assert values["f_m"] > 1.3 * VALUES[1]["f_m"]  # which is the trap
    assert any("dry friction" in text and "--friction auto" in text for text in found.warnings)


def test_a_linear_axis_gets_no_law():
    found = identify(log(1, 0, "multisine", seed=0, seconds=20.0), find_axis("one_mass"))
    assert found.friction == "none" and not found.warnings
    assert "dry friction not added" in " ".join(one.text for one in found.findings)


@pytest.mark.slow
def test_a_validation_on_another_log_fits_with_the_law_alone(found, record):
    other = log(1, 10, "multisine", seed=1, seconds=20.0)
    good = validate(other, found.axis)
    linear = identify(record, find_axis("one_mass"), friction="none")
    assert good.percent > 95
    assert validate(other, linear.axis).percent < good.percent - 5


def test_without_errors_of_the_model_deviations_are_those_of_the_noise(found):
    white, sd = found.answer.fitted.deviations[:3], found.answer.deviations[:3]
    assert np.all((sd >= white) & (sd < 2 * white))


@pytest.mark.slow
def test_a_constant_torque_is_an_estimate_and_no_friction():
    found = identify(
        log(1, 10, "moves", seed=0, seconds=20.0, offset=0.02),
        find_axis("one_mass"),
        friction="coulomb",
    )
    assert found.axis.offset == pytest.approx(0.02, rel=0.05)
    assert found.axis.offset == found.estimates["offset"]["value"]
    values = found.estimates.loc["value"]
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)


@pytest.mark.slow
def test_what_identify_wrote_is_where_track_begins(record, found, tmp_path, capsys):
    path, axis = tmp_path / "rec.nc", tmp_path / "axis.toml"
    record.save(path)
    found.axis.save(axis)
    again = find_axis(str(axis))
    assert again.model.laws == found.axis.model.laws
    assert again.deviation.keys() == {"J_m", "f_m", "f_c"}
    words = ["track", path, "--model", axis, "--identify", "1/J_m", "--identify", "f_m", "--json"]
    known_k_T = 'glr[track=["f_c"]]'  # the log determines only ratios to k_T
    assert main([*map(str, words), "--estimator", known_k_T]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["last"]["1/J_m"] == pytest.approx(1 / VALUES[1]["J_m"], rel=0.05)
    assert told["last"]["f_c"] == pytest.approx(F_C, rel=0.1)
    assert main([*map(str, words), "--estimator", "ekf"]) == 2
    assert "glr" in capsys.readouterr().err


def test_a_law_that_there_is_not_is_refused(record):
    with pytest.raises(LogError, match="one of auto, none"):
        identify(record, find_axis("one_mass"), friction="dry")


def test_the_units_of_values_are_stated(found, record):
    assert found.units.startswith("SI, if a logged torque of 1 equals 1 N m; give")
    linear = replace(record, versions={"motion": "linear"})
    assert "equals 1 N; give" in units_of(linear, {"k_T": 1.0})
    assert units_of(replace(record, versions={"torque_unit": "kNm"}), {}) == "SI"  # read in N m
    amperes = replace(record, versions={"torque_unit": "A"})
    assert units_of(amperes, {"k_T": 0.6}) == "SI, if a logged torque of 1 A equals 0.6 N m"


@pytest.mark.slow
def test_a_validation_can_fail(found, record, tmp_path, capsys):
    other = log(1, 10, "moves", seed=1, seconds=20.0)
    assert unlike(validate(other, found.axis), found.axis.error) == ""
    heavier = validate(replace(other, torque=0.5 * other.torque), found.axis)
    assert "a simulation from the torque explains only" in unlike(heavier, found.axis.error)
    turned = validate(replace(other, torque=-other.torque), found.axis)
    assert turned.percent < 0 and "unit or sign" in unlike(turned, None)
    here, there = tmp_path / "here.nc", tmp_path / "there.nc"
    record.save(here)
    replace(other, torque=0.5 * other.torque).save(there)
    words = ["identify", here, "--model", "one_mass", "-o", tmp_path / "axis.toml"]
    assert main([*map(str, words), "--validate", str(there)]) == 1
    assert "on the validation log, a simulation from the torque explains" in capsys.readouterr().out


def test_less_motion_is_a_poorer_fit_and_no_contradiction():
    def fit(percent, left, size):
        return SimpleNamespace(percent=percent, left=left, size=size)

    assert unlike(fit(80.0, 0.2, 1.0), 0.2) == ""
    assert "at least 70.0 % is expected" in unlike(fit(60.0, 0.4, 1.0), 0.2)
    assert "explains only -3.0 %" in unlike(fit(-3.0, 0.1, 0.097), 0.1)


def test_an_axis_knows_the_rate_of_its_noise(found, tmp_path):
    found.axis.save(tmp_path / "axis.toml")
    axis = find_axis(str(tmp_path / "axis.toml"))
    assert axis.rate == pytest.approx(500.0)
    other = log(1, 10, "moves", seed=1, seconds=5.0, period=0.004)
    with pytest.raises(LogError, match="--resample 500"):
        validate(other, axis)
    with pytest.raises(LogError, match="identified at 500 Hz"):
        track(other, axis, parse("ekf"), identify=("1/J_m",))
