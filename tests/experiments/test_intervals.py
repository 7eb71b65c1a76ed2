"""Intervals: what each covers, how often, and what is said where nothing can be."""

import math

import numpy as np
import pytest

from flexaxis.experiments.scoring import intervals, pooling
from flexaxis.experiments.scoring.intervals import (
    by_seed,
    mean_interval,
    median_interval,
    spread_interval,
)

DRAWS = 4000  # binomial standard deviation .35 %
ALLOWED = (0.925, 0.975)


def coverage(interval, draws, wanted):
    inside = 0
    for draw in draws:
        low, high = interval(draw)
        inside += low <= wanted <= high
    return inside / len(draws)


@pytest.mark.slow
@pytest.mark.parametrize("n", [8, 16])
@pytest.mark.parametrize("kind", ["normal", "lognormal"])
def test_the_interval_of_a_mean_covers_the_mean(kind, n):
    rng = np.random.default_rng(n)
    if kind == "normal":
        draws, wanted = rng.normal(1.0, 0.3, (DRAWS, n)), 1.0
    else:
        draws, wanted = rng.lognormal(0.0, 0.5, (DRAWS, n)), math.exp(0.125)
    assert ALLOWED[0] <= coverage(mean_interval, draws, wanted) <= ALLOWED[1]


@pytest.mark.slow
@pytest.mark.parametrize("n", [8, 16])
@pytest.mark.parametrize(
    ("slow", "quick", "scale"),
    [(1.0, 0.01, 0.0), (1.0, 1.0, 0.0), (0.5, 1.0, 0.0), (0.0, 1.0, 0.2), (0.0, 1.0, 0.5)],
)
def test_the_interval_of_a_deviation_covers_it(slow, quick, scale, n):
    """Errors slow, quick or both; in the last two the runs differ in how noisy they are."""
    rng = np.random.default_rng(round(10 * slow + 100 * scale) + n)
    bias = slow * rng.standard_normal((DRAWS, n))
    within = quick**2 * rng.chisquare(10, (DRAWS, n)) / 10
    if scale:
        within = quick**2 * rng.lognormal(0.0, 2 * scale, (DRAWS, n))
    wanted = math.sqrt(slow**2 + quick**2 * (math.exp(2 * scale**2) if scale else 1.0))
    draws = np.stack([np.sqrt(within + bias**2), bias], axis=1)
    inside = coverage(lambda draw: spread_interval(*draw), draws, wanted)
    assert ALLOWED[0] <= inside <= ALLOWED[1]


def test_the_interval_of_a_median_covers_it_and_may_end_at_never():
    rng = np.random.default_rng(0)
    # Order statistics cannot be exact: 15 choose from P = .923, 16 from .979.
    assert 0.945 <= coverage(median_interval, rng.standard_normal((DRAWS, 16)), 0.0) <= 0.985
    assert median_interval([1.0, 2.0, 3.0, *[np.inf] * 5])[1] is None


@pytest.mark.parametrize("interval", [mean_interval, median_interval])
def test_of_fewer_than_five_nothing_is_said(interval):
    assert interval([1.0, 2.0, 3.0, 4.0]) is None
    assert spread_interval([1.0] * 4, [0.0, 1.0, 0.5, 0.2]) is None


def test_a_run_that_does_not_scatter_at_all_leaves_an_interval_one_can_read():
    """Frozen until an alarm, say: seven runs without variance within, and one with."""
    low, high = spread_interval([1.0] * 7 + [0.5], [0.1, -0.1, 0.2, 0.0, 0.0, 0.1, -0.1, 0.5])
    assert 0.0 <= low < 0.95 < high < 3.0
    low, high = spread_interval([0.0] * 7 + [1.0], [0.0] * 8)
    assert low == 0.0 and high < 3.0


def test_levels_of_points_are_no_draws():
    """Two points a factor of 100 apart, six seeds: by hand, what scatters within them counts."""
    own = np.array([-0.3, 0.1, 0.2, -0.1, 0.4, -0.3])  # sums to 0
    other = np.array([0.1, -0.2, 0.2, 0.0, 0.1, -0.2])
    logs, points = np.r_[own, np.log(100) + other], np.repeat([0, 1], 6)
    both = by_seed(logs, np.tile(np.arange(6), 2), points)
    np.testing.assert_allclose(both, (own + other) / 2 + np.log(10))  # seed by seed
    # Each point with seeds of its own: twelve draws about two means, ten degrees of freedom.
    apart = by_seed(logs, np.arange(12), points)
    assert apart.mean() == pytest.approx(np.log(10))
    assert apart.var(ddof=1) == pytest.approx(np.sum(np.r_[own, other] ** 2) / 10)
    assert intervals._freedom(np.r_[own, other], np.arange(12), points) == 10


def swept(n, points, alike, apart, rng):
    """Noise of n seeds at some points whose levels are `apart`, with a correlation of `alike`²."""
    shared = np.tile(rng.standard_normal(n), points)
    own = rng.standard_normal(n * points)
    level = np.repeat(apart * np.linspace(-1, 1, points), n)
    return level, alike * shared + math.sqrt(1 - alike**2) * own


SWEPT = {"lag": pooling.geometric, "bias": pooling.mean, "cross_talk": pooling.root_mean_square,
         "std": pooling.deviation("bias", "lost")}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("n", [8, 16])
@pytest.mark.parametrize(("alike", "apart"), [(1.0, 0.0), (1.0, 2.0), (0.9, 2.0), (0.6, 1.0)])
def test_intervals_over_a_swept_axis_cover_what_they_are_for(n, alike, apart):
    """Five points with the seeds in common: 92.5 … 97.5 % of the intervals, of every score."""
    rng, draws = np.random.default_rng(round(10 * (alike + apart)) + n), 1500
    drawn = {"seed": np.tile(np.arange(n), 5), "point": np.repeat(np.arange(5), n)}
    levels = apart * np.linspace(-1, 1, 5)
    wanted = {
        "lag": 1.0,
        "bias": 0.0,
        "cross_talk": math.sqrt(np.mean((levels + 4) ** 2) + 1),
        "std": math.sqrt(1 + np.mean(levels**2) + math.exp(0.3**2 / 2)),
    }
    inside = dict.fromkeys(SWEPT, 0)
    for _ in range(draws):
        level, noise = swept(n, 5, alike, apart, rng)
        within = np.exp(0.3 * swept(n, 5, alike, 0.0, rng)[1])
        bias = level + noise
        columns = drawn | {"bias": bias, "std": np.sqrt(within + bias**2), "lost": 0 * bias,
                           "lag": np.exp(0.3 * bias), "cross_talk": abs(bias + 4)}  # fmt: skip
        for name, pool in SWEPT.items():
            low, high = pool(columns, name)[f"{name}_interval"]
            inside[name] += low <= wanted[name] <= high
    shares = {name: count / draws for name, count in inside.items()}
    assert all(ALLOWED[0] <= share <= ALLOWED[1] for share in shares.values()), shares


@pytest.mark.parametrize("n", [8, 16])
@pytest.mark.parametrize(("alike", "apart"), [(1.0, 0.0), (0.9, 0.2), (0.6, 1.0)])
def test_the_interval_of_a_median_over_a_swept_axis_covers_it(n, alike, apart):
    """Order statistics cannot be exact: where points agree, 8 seeds have 93 %, the second of 8."""
    rng, draws, inside = np.random.default_rng(n), 1500, 0
    seeds, points = np.tile(np.arange(n), 5), np.repeat(np.arange(5), n)
    for _ in range(draws):
        low, high = median_interval(sum(swept(n, 5, alike, apart, rng)), seeds, points)
        inside += low <= 0.0 <= high
    assert 0.92 <= inside / draws <= 0.98
