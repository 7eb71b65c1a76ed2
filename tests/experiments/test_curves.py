"""What trajectories are drawn from: full rate about the fault."""

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.case import pack, run_case, unpack
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


def test_without_a_fault_or_at_the_edge_there_is_what_there_is(short):
    quiet = find_scenario("paper_nominal-v1")
    assert quiet.times[near_fault(quiet)].size == 0
    late = short.override({"fault": [{"kind": "step", "parameter": "f_m", "at": 7.5, "factor": 2}]})
    np.testing.assert_allclose(late.times[near_fault(late)][[0, -1]], [7.4, 7.995])


def test_traces_come_back_as_they_were(short, record):
    case = case_on(short, record)
    back = unpack(pack(case))
    assert back.names == case.names
    np.testing.assert_array_equal(back.curve, case.curve)
    np.testing.assert_array_equal(back.near, case.near)
