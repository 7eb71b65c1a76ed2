"""identify, validate and track on logs with dry friction, of which the truth is known."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexaxis.experiments.building.specs import parse
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.friction import guessed_level
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.track import with_forgetting
from flexaxis.experiments.logs.validate import validate

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
    assert values["f_m"] == pytest.approx(VALUES[1]["f_m"], rel=0.03)
    assert values["J_m"] == pytest.approx(VALUES[1]["J_m"], rel=0.03)
    assert values["f_c"] == pytest.approx(F_C, rel=0.05)
    assert np.all(found.deviations >= found.noise_deviations)


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


def test_what_identify_wrote_is_where_track_begins(record, found, tmp_path, capsys):
    path, axis = tmp_path / "rec.nc", tmp_path / "axis.toml"
    record.save(path)
    found.axis.save(axis)
    again = find_axis(str(axis))
    assert again.model.laws == found.axis.model.laws
    assert again.deviation.keys() == set(found.names)
    words = ["track", path, "--model", axis, "--identify", "1/J_m", "--identify", "f_m", "--json"]
    status = main([*map(str, words), "--estimator", "imm-friction"])
    told = json.loads(capsys.readouterr().out)
    assert status == 0, told
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
