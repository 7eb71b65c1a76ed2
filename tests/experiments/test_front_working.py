"""What calls of the front door do while they work: a time limit, progress in a notebook, rules."""

import time

import pytest

import flexaxis as fx
from flexaxis.experiments.running import progress
from flexaxis.experiments.running.user_code import EstimatorCrash
from flexaxis.sim.errors import FlexaxisError


class Endless:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        pass

    def step(self, u, y):
        time.sleep(0.02)  # 1600 samples take half a minute
        return [0.05]


class Peeks:
    """Knows the whole record before it answers for its first sample."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.nominal = nominal["f_m"]

    def step(self, u, y):
        return [self.nominal]

    def run(self, u, y, valid=None):
        import numpy as np

        return np.full((len(u), 1), self.nominal * (1 + 1e-3 * float(np.mean(u))))


@pytest.mark.slow
def test_a_run_that_takes_too_long_is_ended(short):
    with pytest.raises(EstimatorCrash, match=r"no end within 0.2 s.*time_limit="):
        fx.compare("frozen", Endless, scenarios=short, seeds=2, time_limit=0.2)
    failures = fx.benchmark(Endless, scenarios=short, seeds=1, time_limit=0.2).failures
    assert "no end within 0.2 s" in failures["error"][0]


def test_a_time_limit_that_is_none_is_refused(short):
    with pytest.raises(FlexaxisError, match="above 0"):
        fx.benchmark(Endless, scenarios=short, seeds=1, time_limit=0)


def test_the_rules_in_a_table():
    found = {line["rule"]: line for line in fx.check(Peeks)}
    assert found["no look ahead"]["holds"] is False and found["shapes"]["holds"] is True
    assert "BROKEN" in repr(fx.check(Peeks)) and found["no look ahead"]["hint"]


def test_progress_is_for_terminals(capsys):
    with progress.progress("4 cases", 4) as advance:
        advance(4)
    assert capsys.readouterr() == ("", "")
