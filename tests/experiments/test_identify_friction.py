"""identify, validate and track on logs with dry friction, of which the truth is known."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.offline.descent import ROUGH
from flexaxis.experiments.building.specs import parse
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.fits import Fits, contradictions
from flexaxis.experiments.logs.forgetting import with_forgetting
from flexaxis.experiments.logs.friction import guessed_level
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.remedies import remedied
from flexaxis.experiments.logs.track import track
from flexaxis.experiments.logs.validate import validate
from flexaxis.experiments.logs.verdict import judge

sys.path.insert(0, str(Path(__file__).parent))
from identify_axes import VALUES, log

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
    assert found.fitted.converged
    assert values["f_m"] == pytest.approx(VALUES[1]["f_m"], rel=0.03)
    assert values["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.03)
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)
    assert np.all(found.deviations >= found.noise_deviations)
    errors = found.theta - [{**VALUES[1], "f_c": F_C}[name] for name in found.names]
    assert np.all(
        abs(errors) < 4 * found.deviations
    )  # of a few millionths: nothing is stepped over


def test_without_a_law_the_answer_says_what_is_missing(record):
    found = identify(record, find_axis("one_mass"), friction="none")
    values = dict(zip(found.names, found.theta, strict=True))
    assert values["f_m"] > 1.3 * VALUES[1]["f_m"]  # which is the trap
    assert any("dry friction" in text and "--friction auto" in text for text in found.warnings)


def test_a_linear_axis_gets_no_law():
    found = identify(log(1, 0, "multisine", seed=0, seconds=20.0), find_axis("one_mass"))
    assert found.friction == "none" and not found.warnings
    assert [tried.taken for tried in found.tried] == [False]


def test_the_guess_of_the_level_needs_no_model(record):
    level = guessed_level(record.torque, record.speed, period=record.period)
    assert level == pytest.approx(F_C, rel=0.3)
    linear = log(1, 0, "moves", seed=0, seconds=20.0)
    assert guessed_level(linear.torque, linear.speed, period=linear.period) < 0.2 * F_C


def test_a_validation_on_another_log_fits_with_the_law_alone(found, record):
    other = log(1, 10, "multisine", seed=1, seconds=20.0)
    good = validate(other, found.axis)
    linear = identify(record, find_axis("one_mass"), friction="none")
    assert good.simulation > 95 and good.prediction > 95
    assert validate(other, linear.axis).simulation < good.simulation - 5


def test_a_constant_torque_is_an_estimate_and_no_friction():
    found = identify(
        log(1, 10, "moves", seed=0, seconds=20.0, offset=0.02),
        find_axis("one_mass"),
        friction="coulomb",
    )
    assert found.offset == pytest.approx(0.02, rel=0.05)
    assert found.axis.offset == found.offset
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
    assert main([*map(str, words), "--estimator", "imm-friction"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["last"]["1/J_m"] == pytest.approx(1 / VALUES[1]["J_m"], rel=0.05)
    assert told["last"]["f_c"] == pytest.approx(F_C, rel=0.1)
    assert main([*map(str, words), "--estimator", "ekf"]) == 2
    assert "relocate-friction" in capsys.readouterr().err


def test_friction_needs_the_motion_as_it_was(record):
    filtered = replace(record, versions={"highpass": "5"})
    with pytest.raises(LogError, match="slow motion was filtered away"):
        identify(filtered, find_axis("one_mass"), friction="coulomb")
    with pytest.raises(LogError, match="one of auto, none"):
        identify(record, find_axis("one_mass"), friction="dry")


@pytest.mark.parametrize(
    ("text", "period", "factor"),
    [("1 s", 0.005, 0.995), ("500ms", 0.001, 0.998), ("0.99", 0.005, 0.99)],
)
def test_forgetting_is_a_time_or_a_factor(text, period, factor):
    spec = with_forgetting(parse("rpem-forgetting"), text, period)
    assert spec.options["forgetting"] == pytest.approx(factor)


@pytest.mark.parametrize("text", ["1", "1 ms", "0 s", "soon", "-1 s"])
def test_forgetting_that_cannot_be(text):
    with pytest.raises(LogError, match="'1 s'"):
        with_forgetting(parse("rpem-forgetting"), text, 0.005)


def test_a_log_without_slow_motion_says_that_friction_was_not_looked_for(record, tmp_path, capsys):
    path = tmp_path / "rec.nc"
    remedied(record, {"highpass": 0.5}).save(path)
    words = ["identify", str(path), "--model", "one_mass", "-o", str(tmp_path / "axis.toml")]
    assert main(words) == 1
    assert "friction was not looked for" in capsys.readouterr().out


@pytest.mark.slow
def test_a_filter_of_residuals_leaves_friction_to_be_found(record):
    found = identify(record, find_axis("one_mass"), highpass=0.5)
    values = dict(zip(found.names, found.theta, strict=True))
    assert found.friction == "coulomb" and found.tried
    assert values["f_m"] == pytest.approx(VALUES[1]["f_m"], rel=0.05)
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)


def test_a_law_at_its_bound_and_a_fit_that_moves_on_are_said(found, record):
    axis = replace(found.axis, model=replace(found.axis.model, laws=()))
    attempt = Attempt(log_of(record, axis), found.axis.model, found.names)
    fitted, deviations = found.fitted, found.fitted.deviations
    z = fitted.z.copy()
    z[found.names.index("f_c")] = 0.0

    def said(fitted):
        told = {"seen": None, "tried": (), "word": "coulomb"}
        return judge(attempt, fitted, deviations, **told).warnings

    assert any("f_c: at the bound" in text for text in said(replace(fitted, z=z)))
    assert any("did not converge" in text for text in said(replace(fitted, converged=False)))
    assert not any("bound" in text or "converge" in text for text in said(fitted))


def test_how_a_law_is_solved_is_part_of_the_deviation(found):
    # reversals are met exactly: what is left is a step that gains nothing
    assert np.all(found.discretisation < ROUGH * found.noise_deviations)
    wider = np.hypot(np.maximum(found.noise_deviations, found.spread), found.discretisation)
    np.testing.assert_allclose(found.deviations, wider)


@pytest.mark.slow
def test_a_validation_can_fail(found, record, tmp_path, capsys):
    other = log(1, 10, "moves", seed=1, seconds=20.0)
    assert validate(other, found.axis, found.fits).warnings == ()
    heavier = validate(replace(other, torque=0.5 * other.torque), found.axis, found.fits)
    assert any("on the other log the fit of a simulation" in text for text in heavier.warnings)
    quiet = validate(replace(other, torque=-other.torque), found.axis)
    assert quiet.simulation < 0 and quiet.warnings == ()  # nothing to compare with
    here, there = tmp_path / "here.nc", tmp_path / "there.nc"
    record.save(here)
    replace(other, torque=0.5 * other.torque).save(there)
    words = ["identify", here, "--model", "one_mass", "-o", tmp_path / "axis.toml"]
    assert main([*map(str, words), "--validate", str(there)]) == 1
    assert "on the other log the fit of a" in capsys.readouterr().out


def test_less_motion_is_a_poorer_fit_and_no_contradiction():
    own = Fits(98.0, 98.5, 0.2, 0.15)
    assert contradictions(own, Fits(80.0, 85.0, 0.2, 0.15)) == ()
    assert len(contradictions(own, Fits(80.0, 85.0, 0.4, 0.3))) == 2
    assert len(contradictions(own, Fits(-3.0, 98.0, 0.1, 0.1))) == 1


def test_an_axis_knows_the_rate_of_its_noise(found, tmp_path):
    found.axis.save(tmp_path / "axis.toml")
    axis = find_axis(str(tmp_path / "axis.toml"))
    assert axis.rate == pytest.approx(500.0)
    other = log(1, 10, "moves", seed=1, seconds=5.0, period=0.004)
    with pytest.raises(LogError, match="--resample 500"):
        validate(other, axis)
    with pytest.raises(LogError, match="identified at 500 Hz"):
        track(other, axis, parse("ekf"), identify=("1/J_m",))
