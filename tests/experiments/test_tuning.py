"""Tuning: what it finds, what it writes, and that the registry takes what was written."""

import json
import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from engine_cases import runner_here

from flexaxis.estimators.knob import tunings
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.cli import main
from flexaxis.experiments.comparison.sweep import TURNS, with_knob
from flexaxis.experiments.comparison.tune import (
    TOLERANCE,
    Trials,
    match_noise,
)
from flexaxis.experiments.running.estimators import parse

PAPER = {"rpem-forgetting", "rpem-drift"}
# not tuned to equal noise on the linear axis: what dry friction does not do there costs them noise
LAWS = {entry.name for entry in REGISTRY.values() if entry.laws}
OWN = PAPER | LAWS | {"oracle-reset"}  # these keep the value they are known for


def test_tuning_finds_the_reference_itself_and_its_equal(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tune", "rpem-forgetting", "--seeds", "0:2", "--jobs", "1"]) == 0
    ratio = float(re.search(r"their excess scores is ([\d.]+)\.", capsys.readouterr().out)[1])
    assert abs(ratio - 1) < TOLERANCE
    assert main(["tune", "frozen", "--seeds", "0:2"]) == 1
    assert "no tuning parameter" in capsys.readouterr().out


def logs(**noises):
    return np.log(pd.Series(noises))


class Powers(Trials):
    """Instead of runs: noise goes as the root of 1−λ."""

    def noises(self, setting):
        options = parse(setting).options
        quiet = 1.0 if setting.startswith("rpem") else 2.0
        return logs(f_m=1.0, excess=quiet * (1 - options["forgetting"]) ** 0.5)


def test_secants_find_the_match():
    found = match_noise("cusum-reset", Powers(range(2), runner_here().rows))
    assert found.value == pytest.approx(1 - 0.005 / 4, abs=0.005 / 4 * 0.025)
    assert abs(found.ratio - 1) < TOLERANCE and found.knob == "forgetting"


def test_no_match_and_wrong_words_are_said(capsys):
    class Flat(Powers):
        def noises(self, setting):
            return logs(excess=1.0 if setting.startswith("rpem") else 2.0)

    with pytest.raises(ValueError, match=r"no value of .*last attempt, ekf"):
        match_noise("ekf", Flat(range(1), runner_here().rows))
    assert main(["tune", "ekff"]) == 2
    assert "Did you mean 'ekf'" in capsys.readouterr().err


LAM = """
class Mine:
    names, output, knob, seen = ("f_m",), "speed", "lam", []
    def __init__(self, nominal, period, *, lam=0.99, low=0.1, high=0.2):
        Mine.seen.append(lam)
        assert 0 < lam < 1, f"asked for {lam}"
class Window(Mine):
    knob = "1/low"
class Wrong(Mine):
    knob = "lwo"
"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(LAM, encoding="utf-8")
    return lambda name: f"{tmp_path / 'own.py'}:{name}"


@pytest.mark.parametrize("factor", [*TURNS, 99.0, 101.0])
def test_a_forgetting_factor_by_any_name_stays_below_one(own, factor):
    """Nobody is asked for 1.99, or 0."""
    text = with_knob(own("Mine"), factor)
    assert (text is None) == (factor >= 100)
    assert text is None or 0 < parse(text).options["lam"] < 1


def test_an_option_is_turned_as_its_class_says(own):
    assert parse(with_knob(own("Mine"), 2.0)).options == {"lam": 0.98}
    assert parse(with_knob(own("Window"), 2.0)).options == {"low": 0.05}
    with pytest.raises(ValueError, match=r"'lwo', which is not an option.*did you mean 'low'"):
        with_knob(own("Wrong"), 2.0)


def test_what_is_found_is_saved_in_the_place_of_what_was(tmp_path, monkeypatch, capsys):
    path = tmp_path / "tuned.toml"
    monkeypatch.setattr("flexaxis._results.Trials", Powers)
    monkeypatch.chdir(tmp_path)
    words = ["tune", "cusum-reset", "--seeds", "0:2", "--save", str(path)]
    for other in ("variable-forgetting", "cusum-reset", "cusum-reset"):
        assert main(["tune", other, *words[2:], "--json"]) == 0
        (found,) = json.loads(capsys.readouterr().out)["rows"]
    before, plain = tomllib.loads(path.read_text(encoding="utf-8"))["tuned"]
    assert plain["value"] == found["value"] and plain["setting"] == found["setting"]
    assert (before["estimator"], plain["estimator"]) == ("variable-forgetting", "cusum-reset")
    assert (plain["model"], plain["period"], plain["noise"]) == ("n1", 0.005, 0.1)
    assert plain["identify"] == ["k_T", "1/J_a", "f_m"]
    assert plain["command"].startswith("flexaxis tune cusum-reset --seeds 0:2")


def test_the_registry_has_what_was_tuned():
    for entry in REGISTRY.values():
        if entry.knob and entry.name not in OWN:
            knob, found = entry.turning, tunings()[entry.name]
            there = knob.at(knob.position(found["value"]))
            assert {knob.name: entry.options[knob.name]} == pytest.approx(there)
    assert set(tunings()) == {e.name for e in REGISTRY.values() if e.knob} - LAWS
    for found in tunings().values():
        assert abs(found["ratio"] - 1) < TOLERANCE
        assert found["command"].startswith(f"flexaxis tune {found['estimator']} --seeds 0:16")
        options = parse(found["setting"]).options
        assert REGISTRY[found["estimator"]].turning.name == found["knob"]
        there = REGISTRY[found["estimator"]].turning
        assert options | there.at(there.position(found["value"])) == pytest.approx(options)
    assert REGISTRY["rpem-forgetting"].options["forgetting"] == 0.995


@pytest.mark.slow
def test_tuning_again_finds_the_same():
    stored = tunings()["ekf"]
    found = match_noise("ekf", Trials(range(16), runner_here().rows))
    # it starts from the stored value, which other processors leave within the tolerance
    assert found.value == pytest.approx(stored["value"])
    assert found.ratio == pytest.approx(stored["ratio"], rel=1e-3)
