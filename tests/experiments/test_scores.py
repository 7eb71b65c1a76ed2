"""Scores against hand-made trajectories whose scores are known in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.score_table import rows as score
from flexaxis.experiments.scoring.scores import Track, loss
from flexaxis.experiments.scoring.windows import quiet

NAMES = ("k_T", "1/J_a", "f_m")
T = 0.005


def truth_of(scenario):
    """The true θ (N, 3), written out by hand: columns 0, 3 and 8 of the twelve parameters."""
    values = scenario.true_parameters()
    return np.column_stack([values[:, 0], 1 / values[:, 3], values[:, 8]])


def track(scenario, theta):
    return Track(scenario, NAMES, theta, scenario.true_parameters())


def rows_of(scenario, theta):
    rows = score(track(scenario, theta))
    return {row["parameter"]: SimpleNamespace(**row) for row in rows}


@pytest.mark.parametrize(
    ("name", "parameter"), [("fm_step-v1", "f_m"), ("ja_step-v1", "1/J_a"), ("kt_step-v1", "k_T")]
)
def test_an_estimator_that_never_moves_has_five_seconds_of_lag(name, parameter):
    scenario = find_scenario(name)
    theta = np.tile(truth_of(scenario)[0], (scenario.samples, 1))
    row = rows_of(scenario, theta)[parameter]
    assert row.changed
    assert row.lag == pytest.approx(5.0, abs=1e-12)
    assert row.never_settled and row.t10 is None
    assert row.std == 0.0


def test_exponential_tracking():
    """θ̃/D = exp(−t/τ) has lag τ (1 − e^(−5/τ)) and leaves ±10 % at τ ln 10."""
    scenario, tau = find_scenario("fm_step-v1"), 0.8
    theta = truth_of(scenario)
    t = np.arange(2000) * T
    theta[2000:, 2] -= 0.025 * np.exp(-t / tau)
    row = rows_of(scenario, theta)["f_m"]
    # The sum of a geometric series is exact; the integral would be T/2 smaller.
    assert row.lag == pytest.approx(T * (1 - np.exp(-5 / tau)) / (1 - np.exp(-T / tau)), rel=1e-9)
    assert row.t10 == pytest.approx(tau * np.log(10), abs=T)
    assert not row.never_settled


def test_std_is_about_zero_and_in_per_cent_of_nominal():
    scenario = find_scenario("fm_step-v1")
    theta = truth_of(scenario)
    noise = np.random.default_rng(0).standard_normal(scenario.samples)
    theta[:, 2] += 0.05 * (0.02 * noise + 0.01)
    row = rows_of(scenario, theta)["f_m"]
    window = 100 * (0.02 * noise + 0.01)[1000:2000]
    assert row.std == pytest.approx(np.sqrt(np.mean(window**2)))
    assert row.bias == pytest.approx(window.mean())


def test_cross_talk_is_of_the_parameters_that_did_not_change():
    scenario = find_scenario("fm_step-v1")
    theta = truth_of(scenario)
    theta[2000:3000, 0] += 0.03
    theta[3000:, 0] += 10.0  # outside the window
    rows = rows_of(scenario, theta)
    assert rows["k_T"].cross_talk == pytest.approx(3.0)
    assert rows["1/J_a"].cross_talk == 0.0
    assert rows["f_m"].cross_talk is None
    assert rows["k_T"].lag is None and rows["k_T"].t10 is None


def test_without_a_fault_the_last_ten_seconds_are_scored():
    scenario = find_scenario("paper_nominal-v1")
    assert (quiet(scenario)[0], quiet(scenario)[-1]) == (6000, 7999)
    row = rows_of(scenario, truth_of(scenario))["k_T"]
    assert row.lag is None and row.never_settled is None and not row.changed


def test_lost_means_not_finite_or_long_at_an_edge_of_the_one_box():
    edges = (np.array([0.1]), np.array([1.0]))
    theta = np.full((1000, 1), 0.5)
    assert loss(theta, edges, T) is None
    theta[300:500] = 1.0  # 200 samples, exactly one second
    assert loss(theta, edges, T) is None
    theta[500] = 2.0  # beyond counts as at
    assert loss(theta, edges, T) == 300
    theta[100] = np.nan
    assert loss(theta, edges, T) == 100
    low = np.full((300, 1), 0.1)
    assert loss(low, edges, T) == 0


def test_a_lost_run_is_scored_at_the_farther_edge_from_there_on():
    scenario = find_scenario("fm_step-v1")
    theta = truth_of(scenario)
    theta[2200:] = np.nan  # 1 s after the fault
    row = rows_of(scenario, theta)["f_m"]
    # f_m is .075 after the fault, the farther edge .5, and D .025: 4 s at 17 D
    assert row.diverged and row.lost_at == pytest.approx(11.0) and not row.lost_before
    assert row.lag == pytest.approx(4 * (0.5 - 0.075) / 0.025)
    assert row.t10 is None and row.never_settled and row.std == 0.0
    theta[1500:] = np.inf
    row = rows_of(scenario, theta)["f_m"]
    # half of the 5 s before the fault at 9 times nominal off
    assert row.std == pytest.approx(900 / np.sqrt(2)) and row.bias == pytest.approx(450)
    assert row.lost_before


def test_a_run_lost_after_it_had_settled_has_never_settled():
    scenario = find_scenario("fm_step-v1")
    theta = truth_of(scenario)
    assert rows_of(scenario, theta)["f_m"].t10 == 0.0
    theta[3500:] = np.nan
    assert rows_of(scenario, theta)["f_m"].t10 is None


def test_the_deviation_after_a_fault_is_of_the_last_two_seconds():
    scenario = find_scenario("fm_step-v1")
    theta = truth_of(scenario)
    theta[2000:2600, 2] += 0.03
    theta[2600:2800, 2] += 0.002
    theta[2800:3000, 2] -= 0.001
    row = rows_of(scenario, theta)["f_m"]
    assert row.bias_after == pytest.approx(1.0)
    assert row.std_after == pytest.approx(np.sqrt((4.0**2 + 2.0**2) / 2))
    assert rows_of(scenario, theta)["k_T"].std_after is None
