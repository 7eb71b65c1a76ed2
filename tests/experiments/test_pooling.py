"""Pooling over seeds: what is averaged how, and that losing a run never pays."""

import numpy as np
import pandas as pd
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.case import run_case
from flexaxis.experiments.running.estimators import parse
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.experiments.scoring.score_table import SCORES, rows, undefined
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.summary import pool_rows
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")


def case(scenario, seed, **scores):
    row = undefined() | {
        "seed": seed,
        "parameter": "f_m",
        "changed": True,
        "lag": 1.0,
        "t10": 2.0,
        "std": 3.0,
        "bias": 0.0,
        "diverged": False,
        "lost_before": False,
        "never_settled": False,
    }
    return [row | scores]


def all_pooled(scenario, cases):
    return pool_rows(pd.json_normalize([row for run in cases for row in run]), scenario)


def pooled(scenario, cases):
    (row,) = all_pooled(scenario, cases)
    return row


def test_a_lag_is_the_geometric_mean_of_all_runs_lost_ones_too(short):
    runs = [case(short, s, lag=lag) for s, lag in enumerate((1.0, 4.0, 2.0))]
    assert pooled(short, runs)["lag"] == pytest.approx(2.0)
    lost = case(short, 3, lag=16.0, diverged=True, t10=None, never_settled=True)
    row = pooled(short, [*runs, lost])
    assert row["lag"] == pytest.approx(128 ** (1 / 4)) and row["diverged"] == 1
    assert row["never_settled"] == 0 and row["seeds"] == 4  # it is counted once


def test_never_settled_and_lost_runs_count_as_never(short):
    never = {"t10": None, "never_settled": True}
    row = pooled(short, [case(short, 0), case(short, 1, **never), case(short, 2, **never)])
    assert row["t10"] is None and row["never_settled"] == 2
    row = pooled(short, [case(short, 0), case(short, 1), case(short, 2, **never)])
    assert row["t10"] == 2.0 and row["never_settled"] == 1
    lost = {"t10": None, "never_settled": False, "diverged": True}
    assert pooled(short, [case(short, 0), *[case(short, s, **lost) for s in (1, 2)]])["t10"] is None


def test_only_the_common_bias_is_taken_out_of_the_pooled_std(short):
    row = pooled(short, [case(short, s, std=5.0, bias=4.0) for s in range(4)])
    assert row["std"] == pytest.approx(3.0)
    # Each run off by 4 to its own side: that is spread, for nobody knows which side it will be.
    row = pooled(short, [case(short, s, std=5.0, bias=4.0 * (-1) ** s) for s in range(4)])
    assert row["std"] == pytest.approx(5.0) and row["bias"] == pytest.approx(0.0)


def test_the_excess_error_is_that_of_the_prediction():
    """θ̂ off by a constant: the predictor's error is then ψᵀθ̃, and its variance over σ² the excess.

    Predicted by the axis itself: the record of an axis whose friction is 2 % higher, less that of
    the nominal one on the same torque, computed by hand-driven simulation of the linear model.
    """
    from flexaxis.estimators.models.axis_models import three_mass
    from flexaxis.estimators.offline.predictor import predict

    scenario = find_scenario("paper_nominal-v1").override({"start": 1.0})
    (record,) = simulate(scenario, [0])
    truth = true_theta(NAMES, scenario.true_parameters())
    theta = truth * [1.0, 1.0, 1.02]
    row = rows(Track(scenario, NAMES, theta, scenario.true_parameters()))[0]
    model = three_mass(scenario.nominal.as_dict()).parametrize(["f_m"])
    off, right = (predict(model, [f], record.torque, period=0.005)[0] for f in (0.051, 0.05))
    wanted = np.mean((off - right)[-4000:] ** 2) / 0.1**2
    assert row["excess"] == pytest.approx(wanted, rel=0.03)  # linear in θ̃ to 2 %


def test_the_pooled_excess_leaves_the_common_bias_out_and_lost_runs_in():
    scenario = find_scenario("paper_nominal-v1").override({"start": 1.0})
    (record,) = simulate(scenario, [0])
    truth = true_theta(NAMES, scenario.true_parameters())

    def of(factor):
        theta = truth * [1.0, 1.0, factor]
        track = Track(scenario, NAMES, theta, scenario.true_parameters(), record.torque)
        return rows(track)

    alike = all_pooled(scenario, [of(1.02) for _ in range(6)])
    assert alike[0]["excess"] == pytest.approx(0.0, abs=1e-12)
    apart = all_pooled(scenario, [of(f) for f in (0.98, 1.02) * 3])
    one = of(1.02)[0]["excess"]
    assert apart[0]["excess"] == pytest.approx(one, rel=1e-9) == apart[2]["excess"]


def test_a_row_has_all_scores_and_a_pooled_one_those_that_pool(short):
    (record,) = simulate(short, [0])
    found = run_case(short, record, parse("frozen"))
    assert list(found.rows[0])[4:-1] == ["parameter", "changed", *SCORES]
    whole = all_pooled(short, [found.rows])[2]
    assert {s.name for s in SCORES.values() if s.pool} <= set(whole)


def test_missed_is_a_share_of_all_faults(short):
    def of(faults, missed):
        part = {
            "alarms": 1,
            "false_alarms": 0,
            "false_alarms_per_1000_s": 0.0,
            "delay": None,
            "calm": 15.0,
        }
        return part | {"faults": faults, "missed": missed, "isolated": None}

    runs = [case(short, s, detection=of(2, missed)) for s, missed in enumerate((0, 1, 2))]
    found = pooled(short, runs)["detection"]
    assert found["missed"] == pytest.approx(0.5) and found["alarms"] == 1.0
    assert pooled(short, [case(short, 0, detection=of(0, 0))])["detection"]["missed"] == 0.0
