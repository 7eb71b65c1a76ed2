"""What an estimate is worth to the controller: the score, and the loops that it compares."""

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.control_benefit import COSTS, TrueParameters, recovered, tracking
from flexaxis.sim.simulate import simulate

SHORT = {"duration": 9.0, "fault[0].at": 4.0, "burn_in": 1.0}
MOVES = find_scenario("control_fm_moves-v1").override(SHORT)


def frozen(scenario):
    return build(parse("frozen"), scenario.drawn(3))


def rms(path, record):
    return np.sqrt(np.mean((path - record.true_angle_m)[840:1800] ** 2))  # from its next move on


def test_it_is_of_the_loop_that_the_record_is_of():
    """Frozen is the record's own loop, and without the fault it is that of a scenario without."""
    found = tracking(MOVES, 3, frozen(MOVES))
    assert found["estimated"] == pytest.approx(found["frozen"], rel=1e-12) and not found["limited"]
    whole = MOVES.override({"fault": []}, inherit=True)
    (faulty,), (intact,) = simulate(MOVES, [3]), simulate(whole, [3])
    from flexaxis.sim.random_draws import stream

    path = MOVES.excitation.reference(MOVES.grid, stream(MOVES.key, 3, "excitation"))
    assert found["frozen"] == pytest.approx(rms(path, faulty), rel=1e-12)
    assert found["without_fault"] == pytest.approx(rms(path, intact), rel=1e-12)
    assert found["told"] < 0.05 * found["frozen"]


def test_the_told_one_is_told_in_time():
    told = TrueParameters(MOVES)
    theta = np.array([told.step(0.0, 0.0) for _ in range(MOVES.samples)])
    truth = MOVES.true_parameters()
    assert np.array_equal(theta[:-1], truth[1:]) and np.array_equal(theta[-1], truth[-1])
    assert told.names == MOVES.parameter_names


@pytest.mark.slow
@pytest.mark.parametrize("name", ["control_ja_moves-v1", "control_wg_kt_moves-v1"])
def test_who_is_told_recovers_most_of_any_fault(name):
    scenario = find_scenario(name).override(SHORT)
    found = tracking(scenario, 3, frozen(scenario))
    assert recovered(found, "told") > 80


def test_the_score():
    found = {"without_fault": 1.0, "frozen": 3.0, "told": 1.0, "estimated": 4.0}
    assert recovered(found, "told") == 100 and recovered(found, "estimated") == -50
    assert recovered(found | {"estimated": 3.0}, "estimated") == 0
    assert recovered(None, "told") is None
    least = found | {"frozen": 1 + COSTS}
    assert recovered(least, "told") == pytest.approx(100)
    assert recovered(least | {"frozen": 1 + COSTS - 1e-9}, "told") is None
