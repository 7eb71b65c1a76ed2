"""What `flexaxis check --long` runs an estimator through, and what it says of those that fall."""

import json
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.estimator_text import parse
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.conformance import endurance
from flexaxis.experiments.conformance.check import check
from flexaxis.experiments.conformance.subject import Subject
from flexaxis.experiments.running.cache import RecordCache, records

WRONG = str(Path(__file__).with_name("wrong.py"))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return RecordCache(tmp_path_factory.mktemp("records"))


@pytest.fixture(scope="module")
def axis(store):
    scenario = find_scenario("fm_step-v1").override({"name": "check", "duration": 12.0})
    record = records(scenario, [0], store)[0][0]
    return endurance.Axis(Subject(parse("frozen"), scenario, record), store)


def long(text, store):
    """Findings of the rules that only `--long` looks at, by name."""
    found = {finding.rule: finding for finding in check(parse(text), long=True, store=store)}
    return {name: found[name] for name in endurance.DISTURBANCES}


# The paper word for word winds up where nothing is excited, and its step takes a millisecond.
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in REGISTRY if name != "literal-rpem"])
def test_registered_estimators_live_through_everything(name, store):
    assert {r: f.seen for r, f in long(name, store).items() if f.holds is not True} == {}


@pytest.mark.slow
def test_the_textbook_is_caught(store):
    found = long(f"{WRONG}:Unguarded", store)
    fallen = {name for name, finding in found.items() if not finding.holds}
    assert {"off for 20 minutes", "one y of 1e300"} <= fallen
    assert "not finite" in found["off for 20 minutes"].seen
    assert "start in mid-motion" not in fallen  # that it survives, and as well as without


class Alarmist:
    """Finds something in every second, moving or not."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self._theta, self._k, self.findings = nominal["f_m"], 0, []

    def step(self, u, y):
        if self._k % 200 == 0:
            self.findings.append(type("Finding", (), {"alarm": self._k}))
        self._k += 1
        return [self._theta]


class Hollow:
    """Gives the same θ for ever, and is lost inside from the first large y on."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self._theta, self.innovation_variance = nominal["f_m"], 1.0

    def step(self, u, y):
        if y is not None and abs(y) > 1e6:
            self.innovation_variance = float("nan")
        return [self._theta]


def test_a_filter_that_is_lost_inside_is_caught(store):
    found = long(f"{__file__}:Hollow", store)
    fallen = {name for name, finding in found.items() if not finding.holds}
    assert fallen == {"one y 1e9 times too large", "one y of 1e300"}
    assert "innovation_variance" in found["one y of 1e300"].seen


def test_an_alarm_where_nothing_moves_is_caught(store):
    found = long(f"{__file__}:Alarmist", store)
    assert "nothing can be learnt" in found["off for 20 minutes"].seen
    assert found["off for 20 minutes"].holds is False
    assert found["one y of 1e300"].holds is True  # motion all along: it may find what it likes


def test_the_drive_is_off_where_the_axis_stands(axis):
    """Nothing jumps where the zeros begin and end: the axis had come to rest."""
    given = endurance.drive_off(axis, seconds=5.0)
    zeros = np.flatnonzero((given.u == 0) & (given.y == 0))
    assert len(zeros) == 1000
    first, last = zeros[0], zeros[-1]
    assert given.rest[0] < first < last < given.rest[1] <= last + 1
    still = slice(first - 100, first)
    assert np.abs(given.u[still]).max() < 1e-3 * given.u.std()
    assert given.y[still].std() < 0.1 * given.y.std()  # the noise alone


def test_each_disturbance_is_one(axis):
    """All are finite, differ from good data only where they say, and end in a good minute."""
    for name, disturb in endurance.DISTURBANCES.items():
        given = disturb(axis)
        assert len(given.u) == len(given.y) == len(given.valid), name
        assert np.isfinite(given.u).all() and np.isfinite(given.y).all(), name
        good = axis.samples(endurance.AFTER)
        assert given.valid[-good:].all(), name
        assert given.rest[1] <= len(given.u) - good, name
    moving = axis.moving.y
    changed = np.flatnonzero(endurance.outlier(axis, times=1e3).y != moving)
    assert changed.tolist() == [axis.samples(endurance.BEFORE)]


@pytest.mark.slow
def test_long_is_an_option_of_check(capsys):
    assert main(["check", f"{WRONG}:Unguarded", "--long", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)["rules"]
    assert {rule["rule"] for rule in said} > set(endurance.DISTURBANCES)
    assert main(["check", "frozen", "--json"]) == 0
    short = json.loads(capsys.readouterr().out)["rules"]
    assert not {rule["rule"] for rule in short} & set(endurance.DISTURBANCES)
