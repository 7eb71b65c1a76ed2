"""What the fit to a moving window keeps: what stays as it is, and what changes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Setting(NamedTuple):
    """What stays as it is: the options of `methods.moving_horizon`, and what θ̂ and its P may be."""

    forgetting: float
    every: int
    iterations: int
    known: bool
    lower: Array
    upper: Array
    ceiling: Array


class Series(NamedTuple):
    """
    How the model is sampled, as in `flexaxis.estimators.filters.loop.on_lanes`.

    Attributes
    ----------
    coefficients : (terms,) array
    weights : (order,) array
    order, substeps : int
    """

    coefficients: Array
    weights: Array
    order: int
    substeps: int


class Window(NamedTuple):
    """
    What is known, and changes.

    Attributes
    ----------
    u, y, present : (N,) arrays
        Torque held before, output, and whether that was measured, at samples s+1, s+2, …
    mean, root : (m,) and (m, m) arrays
        ξ̄, and S, upper triangular, with P̄ = SᵀS.
    xi : (m,) array
        ξ̂ at sample s.
    claimed : (p, p) array
        Covariance of θ̂.
    half : (m, m) array
        P^½, with the covariance PᵀP of ξ̂ for a noise variance of one, after the data.
    D : (n+1, n+1, ≥ 1+p) array
        The model sampled at θ̂, as in `flexaxis.estimators.filters.covariance.ahead`.
    X : (n+1, ≥ 1+m) array
        State and output at the last sample as predicted from ξ̂, and their sensitivities by ξ.
    theta, M, unit, H, g : arrays
        Room: θ̂, its entries of [A B; C 0], a state of one; Σ φφᵀ and Σ φ (y − ŷ), φ = ∂ŷ/∂ξ.
    taken : (2,) int array
        Samples so far, and those of them in the window.
    held : (1,) array
        Torque since the last sample.
    level : (2,) array
        R̂, 0 while it is not known, and 1 if the last sample was beyond `ODD` deviations.
    shown : (3,) array
        ŷ, innovation and its variance at the last sample.
    """

    u: Array
    y: Array
    present: NDArray[np.bool_]
    mean: Array
    root: Array
    xi: Array
    claimed: Array
    half: Array
    D: Array
    X: Array
    theta: Array
    M: Array
    unit: Array
    H: Array
    g: Array
    taken: NDArray[np.int64]
    held: Array
    level: Array
    shown: Array
