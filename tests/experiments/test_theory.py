"""Scores beside theory: fixed points of the score, consistency, what counts as an alarm."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.bounds import bounded
from flexaxis.experiments.scoring.detection import detection
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.experiments.scoring.score_table import rows
from flexaxis.experiments.scoring.scores import Track

NAMES = ("k_T", "1/J_a", "f_m")


def score_rows(scenario, names, theta, truth):
    return [SimpleNamespace(**row) for row in rows(Track(scenario, names, theta, truth))]


@dataclass(frozen=True)
class Finding:
    alarm: int
    parameters: tuple[str, ...]


@pytest.mark.parametrize(
    "name",
    [
        "fm_ramp-v1",
        "repair-v1",
        "temperature_fm_step-v1",
        "pause_fm_step-v1",
        "kg_step-v1",
        "speed_filter_fm_step-v1",
        "torque_delay_fm_step-v1",
        "warming_fm_step-v1",
    ],
)
def test_no_bound_where_it_is_not_defined(name):
    assert not bounded(find_scenario(name), NAMES)


def test_which_parameters_have_a_bound():
    assert list(bounded(find_scenario("fm_step-v1"), NAMES)) == ["f_m"]
    assert list(bounded(find_scenario("three_faults-v1"), NAMES)) == ["k_T", "1/J_a", "f_m"]
    estimated = find_scenario("kg_step-v1").override({"identify": [*NAMES, "k_g"]})
    assert list(bounded(estimated, (*NAMES, "k_g"))) == ["k_g"]
    (window,) = bounded(find_scenario("moves_fm_step-v1"), NAMES).values()
    assert (window.start, window.stop) == (2070, 3070)


def test_a_fault_beside_a_nuisance_is_scored():
    scenario = find_scenario("warming_fm_step-v1")
    truth = scenario.true_parameters()
    theta = true_theta(NAMES, truth)
    theta[6000:, 2] -= 0.01
    f_m = score_rows(scenario, NAMES, theta, truth)[2]
    # 0.01 off over 5 s, relative to the half of the friction that is left at 30 s
    size = 0.5 * 0.05 * (0.7 + 0.3 * np.exp(-25 / 20))
    assert f_m.changed and f_m.lag == pytest.approx(5 * 0.01 / size, rel=1e-3)
    found = detection(scenario, NAMES, [Finding(1500, ("f_m",)), Finding(6010, ("f_m",))])
    assert (found["alarms"], found["false_alarms"], found["missed"]) == (2, 1, 0)


def test_faults_in_one_sample_are_isolated_by_naming_both():
    scenario = find_scenario("together-v1")
    for names, share in ((("k_T", "f_m"), 1.0), (("f_m",), 0.0)):
        assert detection(scenario, NAMES, [Finding(2010, names)])["isolated"] == share


def test_what_counts_as_an_alarm():
    scenario = find_scenario("two_faults-v1")  # f_m at 2000, J_a at 2200
    given = [(900, ()), (2010, ("f_m",)), (2100, ("k_T",)), (2220, ("k_a",))]
    found = detection(scenario, NAMES, [Finding(*finding) for finding in given])
    assert (found["alarms"], found["false_alarms"], found["missed"]) == (4, 1, 0)
    # 20 s, of which 1 + 5 s are windows
    assert found["false_alarms_per_1000_s"] == pytest.approx(1000 / 14)
    assert found["delay"] == pytest.approx((10 + 20) / 2 * 0.005)
    assert found["isolated"] == 0.5
    nothing = detection(scenario, NAMES, [])
    assert nothing["missed"] == 2 and nothing["delay"] is None and nothing["isolated"] is None
    assert detection(scenario, NAMES, None) is None
    assert detection(scenario, NAMES, [Finding(2210, ("1/J_a",))])["isolated"] == 1.0
