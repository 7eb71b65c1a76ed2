"""Estimates given what was told, against conditioning by hand."""

import numpy as np

from flexaxis.estimators.filters.constrained import Told, draw_estimates, told_arrays

RNG = np.random.default_rng(4)
CHI2 = 5.991464547107979  # of two degrees of freedom, 95 %


def test_what_was_told_is_conditioning_by_hand():
    q, p, told = 2, 5, np.array([0.3, -0.2])
    root = RNG.normal(size=(p, p))
    P, theta = root @ root.T, RNG.normal(size=p)
    arrays = told_arrays(q, [([2, 4], told)])
    bank, given = Told(*map(np.copy, arrays.values())), np.empty(q)
    draw_estimates(bank, P, theta, given)
    apart = told - theta[[2, 4]]
    inverse = np.linalg.inv(P[np.ix_([2, 4], [2, 4])])
    share = 1 / (1 + np.exp((apart @ inverse @ apart - CHI2) / 2))
    expected = theta[:q] + share * P[:q][:, [2, 4]] @ inverse @ apart
    assert 0.05 < share < 0.99
    np.testing.assert_allclose(given, expected, rtol=1e-9)
    union = bank.union
    full, d = P[np.ix_(union, union)], P[np.ix_(union, [2, 4])] @ inverse @ apart
    part = P[np.ix_(union, [2, 4])] @ inverse @ P[np.ix_([2, 4], union)]
    claimed = bank.drawn_P + bank.drawn_between
    mixture = share * (full - part) + (1 - share) * full + share * (1 - share) * np.outer(d, d)
    np.testing.assert_allclose(claimed, mixture, rtol=1e-9, atol=1e-12)
