"""Triangular factors against NumPy's."""

import numpy as np
import pytest

from flexaxis.estimators.filters.covariance import triangularize

RNG = np.random.default_rng(0)


def triangularized(A):
    R = np.zeros((len(A), len(A)))
    triangularize(A.copy(), R)
    return R


def test_the_factor_is_the_transposed_one_of_cholesky():
    A = RNG.standard_normal((5, 11))
    expected = np.linalg.cholesky(A @ A.T).T
    np.testing.assert_allclose(triangularized(A), expected, rtol=1e-12, atol=1e-14)


def test_what_is_singular_has_a_factor():
    A = np.zeros((5, 12))
    A[0] = A[3] = RNG.standard_normal(12)
    R = triangularized(A)
    np.testing.assert_allclose(R.T @ R, A @ A.T, atol=1e-14)


@pytest.mark.parametrize("size", [1e-156, 1e-160, 1e-300])
def test_columns_next_to_nought_are_no_less_a_number(size):
    """As those of a state that has died away while the drive is off."""
    A = RNG.standard_normal((5, 11))
    A[2, 2:] *= size  # what is left of it beside the columns before
    A[2, :2] = 0.0
    R = triangularized(A)
    np.testing.assert_allclose(R.T @ R, A @ A.T, atol=1e-13)
