"""Triangular factors against NumPy's."""

import numpy as np
import pytest

from flexaxis.estimators.recursion.records import record
from flexaxis.estimators.recursion.square_root import cholesky, forward, triangularize
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.symmetric import triangularize_columns

RNG = np.random.default_rng(0)


def test_triangularize_is_the_transposed_cholesky_factor():
    A = RNG.standard_normal((7, 4))
    expected = np.linalg.cholesky(A.T @ A).T
    triangularize(A, 7, 4)
    np.testing.assert_allclose(np.triu(A[:4]), expected, rtol=1e-12)


def test_triangularize_takes_what_is_singular():
    A = np.zeros((5, 3))
    A[:, 0] = A[:, 2] = RNG.standard_normal(5)
    before = A.T @ A
    triangularize(A, 5, 3)
    R = np.triu(A[:3])
    np.testing.assert_allclose(R.T @ R, before, atol=1e-14)


def test_cholesky_and_substitution():
    A, B = RNG.standard_normal((5, 5)), RNG.standard_normal((5, 2))
    A = A @ A.T + np.eye(5)
    L, X = A.copy(), B.copy()
    cholesky(L)
    np.testing.assert_allclose(np.tril(L), np.linalg.cholesky(A), rtol=1e-12)
    forward(L, X)
    np.testing.assert_allclose(np.linalg.cholesky(A) @ X, B, rtol=1e-12)


@compiled
def triangularized(states):
    triangularize_columns(states[0]["A"], states[0]["R"])


def test_columns_side_by_side_are_triangularized_as_numpy_does():
    A = np.zeros((5, 12))
    A[:, :11] = RNG.standard_normal((5, 11))
    state, plain = record(A=A, R=np.zeros((5, 5))), np.zeros((5, 5))
    triangularized(state)
    triangularize_columns(A, plain)
    np.testing.assert_allclose(state["R"][0], np.linalg.cholesky(A @ A.T).T, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(plain, state["R"][0], rtol=1e-12, atol=1e-14)


def test_columns_side_by_side_may_be_singular():
    A = np.zeros((5, 12))
    A[0] = A[3] = RNG.standard_normal(12)
    state = record(A=A, R=np.zeros((5, 5)))
    triangularized(state)
    np.testing.assert_allclose(state["R"][0].T @ state["R"][0], A @ A.T, atol=1e-14)


@pytest.mark.parametrize("size", [1e-156, 1e-160, 1e-300])
def test_columns_next_to_nought_are_no_less_a_number(size):
    """As those of a state that has died away while the drive is off."""
    A = np.zeros((5, 12))
    A[:, :11] = RNG.standard_normal((5, 11))
    A[2, 2:] *= size  # what is left of it beside the columns before
    A[2, :2] = 0.0
    state, one = record(A=A, R=np.zeros((5, 5))), A.T.copy()
    triangularized(state)
    triangularize(one, 12, 5)
    for R in (state["R"][0], np.triu(one[:5])):
        np.testing.assert_allclose(R.T @ R, A @ A.T, atol=1e-13)
