"""Pooling over seeds: what is averaged, what is counted beside it."""

import numpy as np
import pytest

from flexaxis.experiments.harness import Case
from flexaxis.experiments.scoring.pooling import interval, pool, rmse, settling


def case(scenario, seed, *, lag=1.0, t10=2.0, std=3.0, bias=0.0, lost=False, never=False):
    row = {
        "hash": scenario.hash,
        "scenario": scenario.name,
        "estimator": "e",
        "seed": seed,
        "parameter": "f_m",
        "changed": True,
        "lag": lag,
        "t10": t10,
        "std": std,
        "bias": bias,
        "cross_talk": None,
        "diverged": lost,
        "never_settled": never,
        "cost": {"us_per_sample": 1.0},
    }
    curve = np.ones((-(-scenario.samples // 10), 1), np.float32)
    relative = np.exp(-np.arange(400) * 0.005 / 0.5).astype(np.float32)
    return Case(scenario.name, "e", seed, ("f_m",), [row], curve, {"f_m": relative})


def pooled(scenario, cases):
    (row,), _ = pool(cases, [scenario])
    return row


def test_lost_runs_are_counted_and_not_averaged(short):
    row = pooled(
        short, [case(short, 0), case(short, 1, lag=3.0), case(short, 2, lag=99, lost=True)]
    )
    assert row["lag"] == 2.0 and row["diverged"] == 1 and row["seeds"] == 3


def test_never_settled_runs_count_as_infinite(short):
    open_ = {"t10": None, "never": True}
    row = pooled(short, [case(short, 0), case(short, 1, **open_), case(short, 2, **open_)])
    assert row["t10"] is None and row["never_settled"] == 2
    row = pooled(short, [case(short, 0), case(short, 1), case(short, 2, **open_)])
    assert row["t10"] == 2.0 and row["never_settled"] == 1


def test_the_bias_is_taken_out_of_the_pooled_std(short):
    row = pooled(short, [case(short, s, std=5.0, bias=4.0) for s in range(4)])
    assert row["std"] == pytest.approx(3.0)


def test_settling_times_of_the_median_run(short):
    row = pooled(short, [case(short, s) for s in range(3)])
    assert row["t63"] == pytest.approx(0.5 * np.log(1 / 0.37), abs=0.005)
    assert row["t90"] == pytest.approx(0.5 * np.log(10), abs=0.005)
    assert row["rmse"]["100"] == pytest.approx(np.exp(-1))


def test_settling_is_for_good():
    run = np.array([1.0, 0.05, 0.5, 0.05, 0.05], np.float32)
    assert settling([run], 0.1, 1.0) == 3.0
    assert settling([run[:3]], 0.1, 1.0) is None
    assert settling([], 0.1, 1.0) is None
    assert rmse([]) == {}


def test_the_interval_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hit = 0
    for _ in range(200):
        low, high = interval(rng.standard_normal(30).tolist())
        hit += low <= 0.0 <= high
    # A percentile bootstrap of 30 is a little too narrow; binomial sd of 200 draws is 1.5 %.
    assert 0.88 <= hit / 200 <= 0.99
    assert interval([1.0]) is None
    assert interval([2.0, 2.0]) == [2.0, 2.0]
