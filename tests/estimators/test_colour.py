"""What a high-pass of residuals does to a log with something missing."""

import numpy as np
import pytest

from flexaxis.estimators.offline.colour import BRIDGED, colourless

PERIOD, N = 0.002, 10_000
GAP = slice(4000, 4200)


@pytest.fixture
def residual():
    rng = np.random.default_rng(7)
    return 0.01 * np.cumsum(rng.standard_normal(N)) + 0.1 * rng.standard_normal(N)


def test_what_stands_in_a_gap_is_not_heard_after_it(residual):
    colour, ok = colourless(1.0, PERIOD), np.ones(N, bool)
    ok[GAP] = False
    wrong = np.where(ok, residual, 50.0)
    good = colour.settled(ok)
    there = colour.high(residual)
    here = colour.high(colour.bridged(wrong, ok))
    assert np.std((here - there)[good]) < 0.1 * np.std(there[good])
    assert not good[: colour.skip].any() and not good[4000 : 4200 + colour.skip].any()
    assert good[4200 + colour.skip :].all()
    both = np.stack([wrong, 2 * wrong])
    np.testing.assert_array_equal(colour.bridged(both, ok)[1], 2 * colour.bridged(wrong, ok))


def test_a_sample_that_is_missing_costs_few_others(residual):
    colour, ok = colourless(1.0, PERIOD), np.ones(N, bool)
    ok[3000:N:100] = False
    good = colour.settled(ok)
    assert good[colour.skip :].mean() > 1 - (BRIDGED + 1.5) / 100
    error = colour.high(colour.bridged(np.where(ok, residual, 50.0), ok)) - colour.high(residual)
    assert np.std(error[good]) < 0.1 * np.std(residual)
