"""The rules catch what they are for, and nothing else."""

from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.check.check import RULES, check, no_look_ahead
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.estimators import parse

CONTROLS = str(Path(__file__).with_name("wrong.py"))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """One record for all of them."""
    return RecordCache(tmp_path_factory.mktemp("records"))


def broken(text, store):
    return {finding.rule for finding in check(parse(text), store=store) if finding.holds is False}


SLOW = pytest.param("glr", marks=pytest.mark.slow)


@pytest.mark.parametrize("name", [*(n for n in REGISTRY if n != "glr"), SLOW])
def test_registered_estimators_keep_the_rules(name, store):
    findings = {finding.rule: finding for finding in check(parse(name), store=store)}
    assert {rule for rule, finding in findings.items() if finding.holds is False} == set()
    moves = findings["a shift of u hurts"].holds
    assert moves is (None if name == "frozen" else True)


@pytest.mark.slow
def test_the_example_of_an_own_estimator_keeps_the_rules(store):
    path = Path(__file__).parents[2] / "docs" / "examples" / "ukf.py"
    assert "flexaxis" not in path.read_text(encoding="utf-8").partition("import numpy")[2]
    findings = {finding.rule: finding for finding in check(parse(f"{path}:Ukf"), store=store)}
    assert {rule for rule, finding in findings.items() if finding.holds is False} == set()
    assert findings["a shift of u hurts"].holds


def test_the_cheater_is_caught(store):
    assert {"no look ahead", "step equals run"} <= broken(f"{CONTROLS}:Cheater", store)


def test_hindsight_is_caught(store):
    """Statistics of a whole record look ahead as well."""
    assert broken(f"{CONTROLS}:Hindsight", store) == {"no look ahead", "step equals run"}


def test_the_sloppy_one_is_caught(store):
    assert broken(f"{CONTROLS}:Sloppy", store) == {
        "keeps no reference",
        "reset",
        "survives a gap",
        "a shift of u hurts",
    }


class Base:
    """Harmless: follows a part of y, and can be spoilt in one way at a time."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.theta, self.u = nominal["f_m"], 0.0

    def step(self, u, y):
        self.theta += 0.0 if y is None else 1e-6 * y * self.u
        self.u = u
        return [self.theta]


class WrongShape(Base):
    def step(self, u, y):
        return [1.0, 2.0]


class NotFinite(Base):
    def step(self, u, y):
        return [np.nan]


class Random(Base):
    def step(self, u, y):
        return [np.random.default_rng().random()]


class Writes(Base):
    def run(self, u, y):
        y -= y[0]
        y += 1.0
        return np.full((len(u), 1), 0.05)


class Spiked(Base):
    def step(self, u, y):
        return [0.05 if y is None or abs(y) < 50 else np.inf]


class Slow(Base):
    def step(self, u, y):
        import time

        time.sleep(0.006)
        return super().step(u, y)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("WrongShape", "shapes"),
        ("NotFinite", "finite"),
        ("Random", "deterministic"),
        ("Writes", "keeps no reference"),
        ("Spiked", "finite"),
        ("Negative", "covariance"),
        ("Indefinite", "covariance"),
    ],
)
def test_each_rule_catches_its_mistake(name, rule, store):
    assert rule in broken(f"{Path(__file__)}:{name}", store)


class Claims(Base):
    """Claims a covariance that is right up to a sample."""

    def __init__(self, nominal, period):
        super().__init__(nominal, period)
        self.k, p = 0, len(self.names)
        self.covariance = 1e-6 * np.eye(p)

    def step(self, u, y):
        self.k += 1
        if self.k > 500:
            self.covariance = self.wrong(self.covariance.copy())
        return super().step(u, y)


class Negative(Claims):
    """A variance that rounding has made negative, as (I − K H) P does."""

    def wrong(self, P):
        P[0, 0] = -1e-9
        return P


class Indefinite(Claims):
    names = ("f_m", "k_T")

    def step(self, u, y):
        return [super().step(u, y)[0], 1.0]

    def wrong(self, P):
        P[0, 1] = P[1, 0] = 2e-6
        return P


@pytest.mark.slow
def test_a_slow_step_is_caught(store):
    assert "cost" in broken(f"{Path(__file__)}:Slow", store)


def test_reads_increments_only(store, tmp_path):
    path = tmp_path / "increments.py"
    path.write_text(
        "from flexaxis.estimators.registry import REGISTRY\n"
        "def make(nominal, period):\n"
        "    return REGISTRY['rpem-forgetting'].factory(nominal, period, output='increment')\n"
    )
    assert broken(f"{path}:make", store) == set()


def test_as_a_program(capsys):
    assert main(["check", f"{CONTROLS}:Cheater"]) == 1
    out = capsys.readouterr().out
    reason, hint = RULES[no_look_ahead]
    assert "BROKEN" in out and reason in out and hint in out
    assert main(["check", "frozen", "--json"]) == 0
