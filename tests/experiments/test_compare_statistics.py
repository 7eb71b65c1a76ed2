"""The statistics of the gate against textbook formulas, SciPy and simulated nulls."""

import itertools

import numpy as np
import pytest
from scipy import stats

from flexaxis.experiments.scoring.statistics import (
    Paired,
    half_width,
    holm_levels,
    lost_p,
    paired,
    rate_interval,
    seeds_for_lost,
    seeds_for_ratio,
)


def test_the_t_test_is_scipys():
    random = np.random.default_rng(0)
    base, candidate = np.exp(random.normal(0, 0.1, (2, 8)))
    found = paired(base, candidate)
    theirs = stats.ttest_rel(np.log(candidate), np.log(base))
    assert found.p == pytest.approx(theirs.pvalue, rel=1e-10)
    interval = theirs.confidence_interval(0.99)
    assert found.interval(0.01) == pytest.approx((interval.low, interval.high), rel=1e-10)


def test_scores_of_zero_compare():
    """An estimator that never moves has a std of zero."""
    zero, some = np.zeros(4), np.full(4, 0.1)
    assert paired(zero, zero) == Paired(4, 0.0, 0.0) and paired(zero, zero).p == 1
    assert paired(zero, some).mean > 5 and paired(zero, some).p == 0
    assert paired(some, zero).mean < -5


def test_one_pair_decides_nothing():
    found = paired(np.ones(1), np.full(1, 2.0))
    assert found.p == 1 and found.interval(0.01) == (-np.inf, np.inf)
    assert seeds_for_ratio(found, 0.01, 0.02) is None


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


def test_the_family_keeps_its_level():
    """20 000 families of true nulls: .05 is wrongly rejected in 5 ± 0.15 % (one sd) of them."""
    random = np.random.default_rng(2)
    p = random.random((20_000, 6))
    wrong = sum((row <= holm_levels(row, 0.05)).any() for row in p)
    assert wrong / len(p) == pytest.approx(0.05, abs=0.0065)  # 4 sd, and Holm's 1 − (1 − α/m)^m


def test_fisher_by_counting():
    """All 8 of 8 against 0: of the C(16, 8) ways to share out 8 losses two are as extreme."""
    assert lost_p(0, 8, 8) == pytest.approx(2 / 12870)
    ways = list(itertools.combinations(range(8), 3))
    extreme = sum(set(w) <= set(range(4)) or set(w) <= set(range(4, 8)) for w in ways)
    assert lost_p(0, 3, 4) == pytest.approx(extreme / len(ways))
    assert lost_p(2, 2, 8) == pytest.approx(1.0)


def test_fisher_is_conservative_for_pairs_that_fail_together():
    random = np.random.default_rng(3)
    hard = random.random((4000, 8)) < 0.3  # a hard record is lost by either side half the time
    lost = hard[..., None] & (random.random((4000, 8, 2)) < 0.5)
    wrong = np.mean([lost_p(*counts, 8) <= 0.05 for counts in lost.sum(axis=1)])
    assert wrong < 0.05


@pytest.mark.parametrize(("mean", "sd"), [(0.05, 0.06), (0.004, 0.03), (-0.05, 0.06)])
def test_the_number_of_seeds_is_the_first_that_decides(mean, sd):
    n = seeds_for_ratio(Paired(8, mean, sd), 0.001, 0.02)
    gap = abs(mean) if abs(mean) > 0.02 else 0.02 - abs(mean)
    assert half_width(sd, n, 0.001) < gap <= half_width(sd, n - 1, 0.001)


def test_seeds_that_no_one_has():
    assert seeds_for_ratio(Paired(8, 0.02, 0.5), 0.001, 0.02) is None
    n = seeds_for_lost(0, 2, 8, 0.0005)
    assert lost_p(0, round(n / 4), n) <= 0.0005 < lost_p(0, 2, 8)


def test_the_interval_of_a_rate():
    """The upper end for 0 of n is 1 − .025^(1/n)."""
    assert rate_interval(0, 1000) == pytest.approx((0, 1 - 0.025 ** (1 / 1000)))
