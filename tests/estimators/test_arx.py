"""High-order ARX models, against a known difference equation."""

import numpy as np
import pytest
from scipy.signal import lfilter

from flexaxis.estimators import EstimatorError
from flexaxis.estimators.offline.frequency import fit_arx

A, B = np.array([1.0, -1.5, 0.7]), np.array([0.0, 1.0, 0.5])


def test_finds_the_coefficients_of_a_noiseless_record():
    u = np.random.default_rng(0).standard_normal(500)
    found = fit_arx(u, lfilter(B, A, u), order=2, period=0.005)
    np.testing.assert_allclose(found.a, A, atol=1e-10)
    np.testing.assert_allclose(found.b, B, atol=1e-10)


def test_is_consistent_for_equation_noise():
    rng = np.random.default_rng(1)
    u, e = rng.standard_normal((2, 20000))
    found = fit_arx(u, lfilter(B, A, u) + lfilter([1], A, 0.1 * e), order=2, period=0.005)
    # least squares: standard deviations of 0.1/√20000 and less
    np.testing.assert_allclose(found.a, A, atol=4e-3)
    np.testing.assert_allclose(found.b, B, atol=4e-3)


def test_response_is_that_of_the_difference_equation():
    u = np.random.default_rng(0).standard_normal(500)
    found = fit_arx(u, lfilter(B, A, u), order=2, period=0.01)
    z = np.exp(1j * 30.0 * 0.01)
    expected = (1 / z + 0.5 / z**2) / (1 - 1.5 / z + 0.7 / z**2)
    np.testing.assert_allclose(found.response([30.0]), [expected], rtol=1e-9)


@pytest.mark.parametrize("order", [0, 200])
def test_refuses_an_order_that_the_record_cannot_bear(order):
    with pytest.raises(EstimatorError, match="must lie between 1 and 166"):
        fit_arx(np.ones(500), np.ones(500), order=order, period=0.005)
