"""Size and colour of innovations: against numbers that are known, and through a whole run."""

from pathlib import Path

import numpy as np
import pytest
from engine_cases import nested, runner_here

from flexaxis.experiments.scoring.consistency import nis, whiteness

LAGS = 20


def claims(epsilon, variance=1.0):
    return np.column_stack([epsilon, np.broadcast_to(variance, np.shape(epsilon))])


def white(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


def test_nis_is_the_squared_innovation_over_its_claim():
    assert nis(claims([1.0, -2.0, 3.0], [1.0, 4.0, 3.0])) == pytest.approx((1 + 1 + 3) / 3)
    assert nis(claims(3 * white(100_000), 9.0)) == pytest.approx(1.0, rel=0.02)
    assert nis(claims(white(100_000), 0.25)) == pytest.approx(4.0, rel=0.02)


def test_whiteness_is_the_statistic_of_ljung_and_box():
    z = white(500, seed=3)
    rho = np.array([z[lag:] @ z[:-lag] for lag in range(1, LAGS + 1)]) / (z @ z)
    Q = 500 * 502 * np.sum(rho**2 / (500 - np.arange(1, LAGS + 1)))
    assert whiteness(claims(z), LAGS) == pytest.approx(Q / LAGS, rel=1e-12)
    assert whiteness(claims(7 * z, 49.0), LAGS) == pytest.approx(Q / LAGS, rel=1e-12)


class Told:
    """It says nothing of θ, and of its innovations what a number of the sample makes of them.

    ε is ±2 in turn, S is 4 up to the fault and 1 from there, and the first 100 are far too large.
    """

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.f_m, self.k, self.period = nominal["f_m"], 0, period

    def step(self, u, y):
        raise AssertionError("it has a run")

    def run(self, u, y, valid=None):
        k = self.k + np.arange(len(u))
        self.k += len(u)
        variance = np.where(
            k * self.period < 6.0 - 1e-9, 4.0, 1.0
        )  # the fault of `short` is at 6 s
        epsilon = np.where(k < 100, 1e6, 2.0) * (-1.0) ** k
        self.innovations = np.column_stack([epsilon, variance])
        return np.full((len(u), 1), self.f_m)


class Claiming(Told):
    """It claims a covariance too, for which a run is stopped at the fault and goes on."""

    covariance = np.eye(1)


@pytest.mark.parametrize("name", ["Told", "Claiming"])
def test_they_are_taken_before_the_fault_of_all_the_run(short, name):
    """Both pieces of the run count: with the last one only, S would be 1."""
    (row,) = nested(runner_here().rows([short], [f"{Path(__file__)}:{name}"], [0]))
    assert row["nis"] == pytest.approx(1.0, rel=1e-12)
    # alternating signs have r_l = (−1)^l; of n in a row (n+2)/n Σ(n−l) over the lags
    n = 1000
    expected = (n + 2) / n * np.mean(n - np.arange(1, LAGS + 1))
    assert row["whiteness"] == pytest.approx(expected, rel=1e-9)
