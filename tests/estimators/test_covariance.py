"""Covariances against NumPy and samples."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.estimators.filters.joint import look, update
from flexaxis.estimators.filters.state import NUMBERS
from flexaxis.estimators.models.rows import padded

SIZES = [(3, 2), (9, 5)]  # m and n: a row of one register, and of three that are not full
NOISE, INNOVATION = 0.3, 0.7


def covariance(rng, m):
    root = rng.standard_normal((m, m))
    return np.pad(root @ root.T, ((0, 0), (0, padded(m) - m)))


def state_of(m, n):
    rng, p = np.random.default_rng(m), m - n
    X = np.zeros((n + 2, padded(1 + m)))
    X[:, : 1 + m] = rng.standard_normal((n + 2, 1 + m))  # one row is of no account
    return SimpleNamespace(
        X=X, theta=np.ones(p), P=covariance(rng, m), drift=covariance(rng, p)[:, :p],
        G=np.zeros((n + 1, m)), GP=np.zeros((n + 1, padded(m))), gain=np.zeros(m),
        ceiling=np.full(p, np.inf), lower=np.full(p, -np.inf), upper=np.full(p, np.inf),
        now=np.zeros(1, NUMBERS),
    )  # fmt: skip


@pytest.mark.parametrize(("m", "n"), SIZES)
def test_an_update_is_that_of_the_textbook(m, n):
    """F P Fᵀ + W − K S Kᵀ, with F and h written out as matrices."""
    state, p = state_of(m, n), m - n
    F, h, P = np.eye(m), state.X[-1, 1 : 1 + m].copy(), state.P[:, :m].copy()
    F[p:] = state.X[:n, 1 : 1 + m]
    xi, y = np.r_[state.theta, state.X[:n, 0]], state.X[-1, 0] + INNOVATION
    look(state)
    update(state, y, NOISE)
    S = h @ P @ h + NOISE
    K, W = F @ P @ h / S, np.pad(state.drift, (0, n))
    np.testing.assert_allclose(state.now["spread"][0], h @ P @ h, rtol=1e-12)
    np.testing.assert_allclose(state.gain, K * np.sqrt(S), rtol=1e-12)
    moved = np.r_[state.theta, state.X[:n, 0]]
    np.testing.assert_allclose(moved, xi + K * INNOVATION, rtol=1e-12)
    expected = F @ P @ F.T + W - np.outer(K, K) * S
    np.testing.assert_allclose(state.P[:, :m], expected, rtol=1e-11, atol=1e-12)
    np.testing.assert_array_equal(state.P[:, :m], state.P[:, :m].T)
    np.testing.assert_array_equal(state.P[:, m:], 0.0)
