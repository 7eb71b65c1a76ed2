"""What an estimate is worth to the controller: the score, and the loops that it compares."""

import numpy as np
import pytest
from engine_cases import BenchHere

from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring import recovered as module
from flexaxis.experiments.scoring.recovered import COSTS, TrueParameters, recovered, tracking
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
    from flexaxis.sim.streams import stream

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


@pytest.mark.parametrize("name", ["control_ja_moves-v1", "control_wg_kt_moves-v1"])
def test_who_is_told_recovers_most_of_any_fault(name):
    scenario = find_scenario(name).override(SHORT)
    found = tracking(scenario, 3, frozen(scenario))
    assert recovered(found, "told") > 80


class Slipped(TrueParameters):
    """Told the truth, and the fault taken the wrong way round."""

    def step(self, u, y):
        theta = np.array(super().step(u, y))
        return 2 * np.array([MOVES.initial[name] for name in self.names]) - theta


def test_who_takes_the_fault_the_wrong_way_round_loses(monkeypatch):
    right = recovered(tracking(MOVES, 3, frozen(MOVES)), "told")
    monkeypatch.setattr(module, "TrueParameters", Slipped)
    module._baselines.cache_clear()
    wrong = recovered(tracking(MOVES, 3, frozen(MOVES)), "told")
    module._baselines.cache_clear()
    assert right > 95 and wrong < -50


def test_the_score():
    found = {"without_fault": 1.0, "frozen": 3.0, "told": 1.0, "estimated": 4.0}
    assert recovered(found, "told") == 100 and recovered(found, "estimated") == -50
    assert recovered(found | {"estimated": 3.0}, "estimated") == 0
    assert recovered(None, "told") is None
    least = found | {"frozen": 1 + COSTS}
    assert recovered(least, "told") == pytest.approx(100)
    assert recovered(least | {"frozen": 1 + COSTS - 1e-9}, "told") is None


def test_rows_have_numerator_and_denominator():
    rows = BenchHere().runs([MOVES], ["rpem-forgetting", "frozen"], [3])
    for (_, name), (run,) in rows.items():
        first = run[0]
        parts = first["tracking"]
        worst, best = parts["frozen"], parts["without_fault"]
        assert first["recovered"] == pytest.approx(
            100 * (worst - parts["estimated"]) / (worst - best)
        )
        assert all(row["recovered"] == first["recovered"] for row in run)
        assert first["recovered_told"] > 95
        assert (first["recovered"] > 50) == (name == "rpem-forgetting")  # and nothing for frozen
    plain = find_scenario("fm_step-v1").override({"duration": 6.0, "fault[0].at": 3.0})
    ((run,),) = BenchHere().runs([plain], ["frozen"], [3]).values()
    assert run[0]["recovered"] is None and run[0]["tracking"] is None


@pytest.mark.parametrize("name", find_suite("control").scenarios)
def test_every_scenario_of_the_suite_feeds_forward(name):
    scenario = find_scenario(name)
    assert scenario.controller.adapt and len(scenario.fault) == 1 and not scenario.nuisance
