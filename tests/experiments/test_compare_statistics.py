"""The statistics of verdicts against textbook formulas, SciPy, counting and simulated nulls."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from flexaxis.experiments.comparison.statistics import (
    LogRatios,
    half_width,
    holm_levels,
    log_ratio,
    sign_p,
    summary,
    t_p,
    unseen_shift,
)


def paired(base, candidate):
    return LogRatios(*(each.item() for each in summary(log_ratio(base, candidate))))


def test_the_t_test_is_scipys():
    random = np.random.default_rng(0)
    base, candidate = np.exp(random.normal(0, 0.1, (2, 8)))
    found = paired(base, candidate)
    theirs = stats.ttest_rel(np.log(candidate), np.log(base))
    assert found.p == pytest.approx(theirs.pvalue, rel=1e-10)
    half = np.ptp(theirs.confidence_interval(0.99)) / 2
    assert half_width(found.sd, found.n, 0.01) == pytest.approx(half, rel=1e-10)


def test_scores_of_zero_compare():
    """An estimator that never moves has a std of zero."""
    zero, some = np.zeros(4), np.full(4, 0.1)
    assert paired(zero, zero) == LogRatios(4, 0.0, 0.0) and paired(zero, zero).p == 1
    assert paired(zero, some).mean > 5 and paired(zero, some).p == 0
    assert paired(some, zero).mean < -5


def test_one_pair_decides_nothing():
    found = paired(np.ones(1), np.full(1, 2.0))
    assert found.p == 1 and half_width(found.sd, found.n, 0.01) == np.inf


def textbook_holm(p, alpha):
    """Compare the ordered p with alpha/m, alpha/(m-1), … and stop at the first that is above."""
    rejected = set()
    for rank, i in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        if p[i] > alpha / (len(p) - rank):
            break
        rejected.add(i)
    return rejected


def test_holm_rejects_what_the_textbook_rejects():
    random = np.random.default_rng(1)
    for _ in range(200):
        p = random.random(random.integers(1, 9)) ** 4
        levels = holm_levels(p, 0.05)
        assert {i for i in range(len(p)) if p[i] <= levels[i]} == textbook_holm(p, 0.05)


def test_families_in_bulk_are_families_one_by_one_and_nan_is_no_member():
    random = np.random.default_rng(4)
    p = random.random((50, 7)) ** 3
    p[random.random(p.shape) < 0.3] = np.nan
    for row, levels in zip(p, holm_levels(p, 0.05), strict=True):
        there = np.isfinite(row)
        np.testing.assert_array_equal(levels[there], holm_levels(row[there], 0.05))
        assert (levels[~there] == 0.05).all()
    assert holm_levels([], 0.05).shape == (0,)


def test_the_family_keeps_its_level():
    """20 000 families of true nulls: .05 is wrongly rejected in 5 ± 0.15 % (one sd) of them."""
    random = np.random.default_rng(2)
    p = random.random((20_000, 6))
    wrong = (p <= holm_levels(p, 0.05)).any(axis=1).sum()
    assert wrong / len(p) == pytest.approx(0.05, abs=0.0065)  # 4 sd, and Holm's 1 − (1 − α/m)^m


@pytest.mark.parametrize("spread", [{"normal": 0.2}, {"lognormal": 0.5}])
@pytest.mark.parametrize("n", [8, 16])
def test_an_interval_of_95_percent_covers_the_mean_log_ratio(spread, n):
    """20 000 intervals of the scores' geometric mean ratio, which is one: 95 ± .15 % (one sd)."""
    random = np.random.default_rng(6)
    shape = (2, 20_000, n)
    if "normal" in spread:
        scores = np.abs(random.normal(1.0, spread["normal"], shape))
    else:
        scores = random.lognormal(0.0, spread["lognormal"], shape)
    count, mean, sd = summary(np.log(scores[1] / scores[0]))
    assert 0.925 <= np.mean(np.abs(mean) <= half_width(sd, count, 0.05)) <= 0.975


def test_a_summary_leaves_out_what_is_not_there():
    values = np.array([[1.0, np.nan, 3.0], [np.nan, 2.0, np.nan], [np.nan] * 3])
    n, mean, sd = summary(values)
    assert n.tolist() == [2, 1, 0] and mean.tolist() == [2.0, 2.0, 0.0]
    assert sd == pytest.approx([math.sqrt(2), 0.0, 0.0])
    assert t_p(n, mean, sd).tolist()[1:] == [1.0, 1.0]
    assert half_width(sd, n, 0.05).tolist()[1:] == [math.inf, math.inf]


def test_mcnemar_is_scipys_binomial_test():
    for more, less in itertools.product(range(12), repeat=2):
        if more + less:
            theirs = stats.binomtest(more, more + less, 0.5, alternative="greater").pvalue
            assert sign_p(more, less) == pytest.approx(theirs, rel=1e-12)
    assert sign_p(0, 0) == 1.0


def test_mcnemar_by_counting():
    """Of the 2⁵ ways to share out five lost runs, six give the candidate four or more."""
    ways = list(itertools.product((0, 1), repeat=5))
    assert sign_p(4, 1) == sum(sum(way) >= 4 for way in ways) / len(ways) == 6 / 32


@pytest.mark.parametrize("n", [4, 32, 128])
def test_what_was_not_seen_shifts_the_mean_to_zero_at_most(n):
    """The share that n runs miss with chance alpha, lying at `far`, balances the shift."""
    share = 1 - 0.01 ** (1 / n)
    assert (1 - share) ** n == pytest.approx(0.01)
    assert (1 - share) * unseen_shift(n, 0.01, 0.5) == pytest.approx(share * 0.5)
