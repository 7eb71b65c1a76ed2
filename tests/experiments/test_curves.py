"""What trajectories are drawn from: full rate about the fault, residual, findings, old folders."""

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.case import pack, run_case, unpack
from flexaxis.experiments.running.estimators import parse
from flexaxis.experiments.scoring.curves import near_fault, residual
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
    np.testing.assert_allclose(case.detail.near, expected, rtol=1e-6)


def test_without_a_fault_or_at_the_edge_there_is_what_there_is(short):
    quiet = find_scenario("paper_nominal-v1")
    assert quiet.times[near_fault(quiet)].size == 0
    late = short.override({"fault": [{"kind": "step", "parameter": "f_m", "at": 7.5, "factor": 2}]})
    np.testing.assert_allclose(late.times[near_fault(late)][[0, -1]], [7.4, 7.995])


def test_the_residual_is_the_rms_of_what_the_predictor_misses(short, record):
    case = case_on(short, record, "rpem-forgetting")
    assert case.detail.residual.shape == case.curve[:, 0].shape
    quiet = case.detail.residual[60:118]  # 3 … 5.9 s
    assert np.sqrt(np.mean(quiet**2)) == pytest.approx(0.1, rel=0.1)  # σ of the speed, rad/s
    assert case_on(short, record, "frozen").detail.residual is None  # it predicts nothing
    whole = np.arange(25.0)
    parts = whole[:10], whole[10:20], whole[20:]  # the last one is shorter
    expected = [np.sqrt(np.mean(part**2)) for part in parts]
    np.testing.assert_allclose(residual(whole), expected, rtol=1e-6)
    assert np.isnan(residual(np.full(20, np.nan))).all()


def test_traces_come_back_as_they_were(short, record):
    cases = [case_on(short, record, text) for text in ("glr", "frozen")]
    for case in cases:
        back = unpack(pack(case))
        np.testing.assert_array_equal(back.curve, case.curve)
        np.testing.assert_array_equal(back.detail.near, case.detail.near)
        assert back.detail.findings == case.detail.findings
        if case.detail.residual is None:
            assert back.detail.residual is None
        else:
            np.testing.assert_array_equal(back.detail.residual, case.detail.residual)
