"""What a case is scored by, against estimators and numbers that are known exactly."""

from pathlib import Path

import numpy as np
import pytest
from engine_cases import nested, runner_here

from flexaxis.sim.simulate import simulate


class Counter:
    """θ is f_m times 1 + a thousandth of the samples taken; the claim is their number, scaled."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.f_m, self.count = nominal["f_m"], 0

    @property
    def covariance(self):
        return np.array([[1e-6 * self.count]])

    def step(self, u, y):
        self.count += 1
        return [self.f_m * (1 + 1e-3 * self.count)]


class Silent(Counter):
    covariance = None


def row_of(scenario, name):
    (row,) = nested(runner_here().rows([scenario], [f"{Path(__file__)}:{name}"], [0]))
    return row


def test_error_and_claim_are_those_before_the_fault(short):
    """At 6 s 1200 samples are taken: .05·1.2 over a variance of .0012; none of the fault yet."""
    assert row_of(short, "Counter")["nees"] == pytest.approx((0.05 * 1.2) ** 2 / 1.2e-3, rel=1e-9)


def test_without_a_fault_they_are_those_at_the_end(short):
    quiet = short.override({"fault": []})
    assert row_of(quiet, "Counter")["nees"] == pytest.approx((0.05 * 1.6) ** 2 / 1.6e-3, rel=1e-9)


def test_who_claims_nothing_is_not_judged(short):
    row = row_of(short, "Silent")
    assert row["nees"] is row["nis"] is row["whiteness"] is None


def noises(scenario, seeds, *, repeat=0):
    made = simulate(scenario, seeds, repeat=repeat)
    return np.array([record.speed - record.true_speed for record in made])


def test_every_seed_and_every_repeat_has_noise_of_its_own(short):
    noise = np.vstack([noises(short, range(4)), noises(short, range(2), repeat=1)])
    # of independent white noise the correlation has a standard deviation of 1/√1600
    apart = np.corrcoef(noise)[~np.eye(6, dtype=bool)]
    assert abs(apart).max() < 5 / np.sqrt(noise.shape[1])
    # the deviation of 9600 samples is known to 0.7 %
    assert noise.std() == pytest.approx(0.1, rel=0.04)
