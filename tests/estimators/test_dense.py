"""A sampled model at one θ over a sample: the code that is written against NumPy."""

import numpy as np
import pytest

from flexaxis.estimators.filters.covariance import ahead, gather, padded
from flexaxis.estimators.models.compiler import compiled, remembered


@remembered
def both(n, p):
    """Both, one after the other."""
    over, add = ahead(n, p), gather(n, p)

    @compiled
    def run(D, X, u, residual, H, g):  # noqa: PLR0917
        over(D, X, u)
        add(X, residual, H, g)

    return run


def in_numpy(D, X, u, residual, H, g):  # noqa: PLR0917
    n, m = len(X) - 1, len(H)
    p, state = m - n, X[:n].copy()
    X[:] = np.einsum("ij,ja->ia", D[:, :n, 0], state)
    X[:, 1 : 1 + p] += np.einsum("ija,j->ia", D[:, :n, 1 : 1 + p], state[:, 0])
    X[:, : 1 + p] += u * D[:, n, : 1 + p]
    phi = X[-1, 1 : 1 + m]
    H[:, :m] += np.outer(phi, phi)
    g[:m] += phi * residual


def room(n, p):
    rng, m = np.random.default_rng(n), n + p
    D, X = np.zeros((n + 1, n + 1, padded(1 + p))), np.zeros((n + 1, padded(1 + m)))
    D[..., : 1 + p] = rng.standard_normal((n + 1, n + 1, 1 + p))
    X[:, : 1 + m] = rng.standard_normal((n + 1, 1 + m))
    H, g = np.zeros((m, padded(m))), np.zeros(padded(m))
    return D, X, 0.7, 0.3, H, g


@pytest.mark.parametrize(("n", "p"), [(2, 1), (5, 4)])  # rows of one register, and of several
def test_what_is_written_does_what_numpy_does(n, p):
    ours, plain = room(n, p), room(n, p)
    for _ in range(2):
        both(n, p)(*ours)
        in_numpy(*plain)
    for a, b in zip(ours, plain, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13)


def test_sensitivities_are_those_of_differences():
    """y of a sample at θ = D₀ + D₁ dθ, from x + dx: the exact change is bilinear."""
    n, p = 2, 1
    D, X, u, _, H, g = room(n, p)
    X[:, 1:] = 0.0
    X[:n, 1 + p : 1 + p + n] = np.eye(n)
    x = X[:n, 0].copy()
    both(n, p)(D, X, u, 0.0, H, g)

    def moved(dtheta, dx):
        return (D[..., 0] + dtheta * D[..., 1]) @ np.r_[x + dx, u]

    step, zero = 1e-6, np.zeros(n)
    slopes = [(moved(step, zero) - moved(-step, zero)) / (2 * step)]
    slopes += [(moved(0, step * e) - moved(0, -step * e)) / (2 * step) for e in np.eye(n)]
    np.testing.assert_allclose(X[:, 0], moved(0, zero))
    np.testing.assert_allclose(X[:, 1:4].T, slopes, rtol=1e-8, atol=1e-9)
