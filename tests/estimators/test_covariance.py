"""Covariances against NumPy and samples."""

import numpy as np
import pytest

from flexaxis.estimators.filters.covariance import carry, look, merge, padded
from flexaxis.estimators.filters.loop import record
from flexaxis.estimators.models.compiler import compiled

SIZES = [(3, 2), (9, 5)]  # m and n: a row of one register, and of three that are not full


@compiled
def through(states, root, share):
    """Do all three, one after the other."""
    for k in range(len(states)):
        state = states[k]
        state["spread"] = look(state["X"], state["P"], state["Ph"])
        carry(state["X"], state["Ph"], root, state["W"], state["P"], state["gain"])
        merge(share, state["P"], state["other"], state["apart"])


def covariance(rng, m):
    root = rng.standard_normal((m, m))
    return np.pad(root @ root.T, ((0, 0), (0, padded(m) - m)))


def state_of(m, n):
    rng = np.random.default_rng(m)
    X, p = np.zeros((n + 2, padded(1 + m))), m - n
    X[:, : 1 + m] = rng.standard_normal((n + 2, 1 + m))  # one row is of no account
    P, other = covariance(rng, m), covariance(rng, m)
    return record(
        X=X, W=covariance(rng, p)[:, :p], P=P, other=other, apart=rng.standard_normal(m),
        Ph=np.zeros(m), gain=np.zeros(m), spread=0.0,
    )  # fmt: skip


def in_numpy(state, root, share):
    m, p = len(state["gain"]), len(state["W"])
    F, h, P = np.eye(m), state["X"][-1, 1 : 1 + m], state["P"][:, :m]
    F[p:], Ph = state["X"][: m - p, 1 : 1 + m], P @ h
    gain, W = F @ Ph * root, np.pad(state["W"], (0, m - p))
    P = F @ P @ F.T + W - np.outer(gain, gain)
    apart = share * (1 - share) * np.outer(state["apart"], state["apart"])
    P = (1 - share) * P + share * state["other"][:, :m] + apart
    P = np.pad(P, ((0, 0), (0, padded(m) - m)))
    return {"spread": h @ Ph, "Ph": Ph, "gain": gain, "P": P}


@pytest.mark.parametrize(("m", "n"), SIZES)
def test_compiled_code_does_what_numpy_does(m, n):
    state, plain = state_of(m, n), state_of(m, n)[0]
    through(state, 0.3, 0.2)
    for name, value in in_numpy(plain, 0.3, 0.2).items():
        np.testing.assert_allclose(state[name][0], value, rtol=1e-12, atol=1e-13, err_msg=name)
    P = state["P"][0]
    np.testing.assert_array_equal(P[:, :m], P[:, :m].T)
    np.testing.assert_array_equal(P[:, m:], 0.0)


def test_a_mixture_has_the_covariance_of_its_samples():
    """Two clouds of points, exactly: weights in whole points."""
    rng = np.random.default_rng(0)
    m, ours, theirs = 3, rng.standard_normal((30, 3)), rng.standard_normal((10, 3)) + 1.0
    parts = [np.cov(cloud.T, bias=True) for cloud in (ours, theirs)]
    P, other = (np.pad(part, ((0, 0), (0, padded(m) - m))) for part in parts)
    merge(0.25, P, other, ours.mean(0) - theirs.mean(0))
    np.testing.assert_allclose(P[:, :m], np.cov(np.vstack([ours, theirs]).T, bias=True))
