"""What trajectories are drawn from: full rate about the fault."""

import numpy as np
import pytest

from flexaxis.experiments.running.case import run_case
from flexaxis.experiments.running.estimators import parse
from flexaxis.experiments.scoring.curves import near_fault
from flexaxis.sim.simulate import simulate


@pytest.fixture(scope="module")
def record(short):
    return simulate(short, [1000])[0]


def case_on(scenario, record, text="glr"):
    return run_case(scenario, record, parse(text))


def test_every_estimate_about_the_fault_is_kept(short, record):
    case = case_on(short, record)
    # -.1 … 1 s about the fault at 6 s, both ends with it: at 200 Hz samples 1180 … 1400
    np.testing.assert_array_equal(short.times[near_fault(short)][[0, -1]], [5.9, 7.0])
    nominal = case.theta[0] / case.curve[0]
    expected = (case.theta[1180:1401] / nominal).astype(np.float32)
    np.testing.assert_allclose(case.near, expected, rtol=1e-6)
