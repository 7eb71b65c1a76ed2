"""What calls of the front door do while they work: a time limit, progress in a notebook, rules."""

import sys
import time
from types import SimpleNamespace

import pytest

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running import progress
from flexaxis.experiments.running.user_code import EstimatorCrash


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


def test_a_run_that_takes_too_long_is_ended(short):
    calls = [
        lambda: fx.estimate(fx.simulate(short), Endless, time_limit=0.2),
        lambda: fx.compare("frozen", Endless, scenarios=short, seeds=2, time_limit=0.2),
    ]
    for call in calls:
        begun = time.monotonic()
        with pytest.raises(EstimatorCrash, match=r"no end within 0.2 s.*time_limit="):
            call()
        assert time.monotonic() - begun < 20
    (failed, *_) = fx.benchmark(Endless, scenarios=short, seeds=1, time_limit=0.2).failures()
    assert "no end within 0.2 s" in failed["error"]
    with pytest.raises(EstimatorError, match="above 0"):
        fx.estimate(fx.simulate(short), Endless, time_limit=0)


def test_the_rules_in_a_table():
    found = {line["rule"]: line for line in fx.check(Peeks)}
    assert found["no look-ahead"]["holds"] is False and found["shapes"]["holds"] is True
    assert "BROKEN" in repr(fx.check(Peeks)) and found["no look-ahead"]["hint"]


@pytest.mark.parametrize("patience", [0.0, 60.0])
def test_a_notebook_has_one_line_that_is_wiped_off(monkeypatch, capsys, patience):
    shown = []

    class Handle:
        def display(self, data, raw):
            shown.append(("new", data["text/plain"]))

        def update(self, data, raw):
            shown.append(("same", data["text/plain"]))

    ipython = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(DisplayHandle=Handle))
    monkeypatch.setattr(progress, "PATIENCE", patience)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with progress.progress("4 cases", 4) as advance:
        for _ in range(4):
            advance(1)
    assert capsys.readouterr() == ("", "")
    if patience:  # what is quick says nothing
        assert not shown
        return
    assert [how for how, _ in shown] == ["new", "same", "same", "same", "same"]
    assert shown[1][1] == "4 cases: 50 %, 0 s left" and shown[-1][1] == ""
