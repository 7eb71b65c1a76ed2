"""
A sampled model and its sensitivities, state by state: dense, on rows of lanes.

For samples at one θ, in which only the torque differs. `ahead` and `gather` say what is done; their
twins, in `flexaxis.estimators.sampling.dense_code`, are straight-line code for their sizes.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Sizes = tuple[int, int]


def ahead(sizes: Sizes, D: Array, X: Array, u: float) -> None:
    """
    Take state and output over one sample, with their sensitivities by ξ = [θ; x].

    Parameters
    ----------
    sizes : (n, p)
        States and parameters.
    D : (n+1, n+1, ≥ 1+p) array
        What a sample makes of each state and of the torque (columns) in states and output, each
        with its derivatives by θ behind it.
    X : (n+1, ≥ 1+p+n) array
        x and y, and behind each its derivatives by ξ.
    u : float
        Torque.
    """
    n, p = sizes
    state = X[:n].copy()
    X[:] = np.einsum("ij,ja->ia", D[:, :n, 0], state)
    X[:, 1 : 1 + p] += np.einsum("ija,j->ia", D[:, :n, 1 : 1 + p], state[:, 0])
    X[:, : 1 + p] += u * D[:, n, : 1 + p]


def gather(sizes: Sizes, X: Array, residual: float, H: Array, g: Array) -> None:
    """
    H ← H + φφᵀ, g ← g + φ·residual, φ = ∂y/∂ξ in the last row of X.

    Parameters
    ----------
    sizes, X
        As for `ahead`.
    residual : float
    H : (m, w) array
        As of `flexaxis.estimators.sampling.symmetric`.
    g : (w,) array
    """
    phi = np.zeros(len(g))
    phi[: sum(sizes)] = X[-1, 1 : 1 + sum(sizes)]
    H += np.outer(phi[: len(H)], phi)
    g += phi * residual
