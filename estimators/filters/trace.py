"""Follow a filter sample by sample and keep what figures and studies need."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """
    A filter over N samples.

    Attributes
    ----------
    theta : (N, p) array
        Estimates.
    epsilon : (N,) array
        Residual y − ŷ, eq. (6); NaN in a gap.
    psi : (N, p) array
        Gradient of ŷ at the estimate before the sample, eq. (16).
    P : (N, p, p) array
        P(t+1|t), for a noise variance of one.
    covariance : (N, p) array
        Diagonal of the claimed covariance of the estimates.
    """

    theta: Array
    epsilon: Array
    psi: Array
    P: Array
    covariance: Array


def trace(estimator: Any, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Trace:
    """
    Run an estimator from its current state by steps and keep its insides.

    Parameters
    ----------
    estimator : a filter with epsilon, psi, P and covariance after each step
        Left in the state after the last sample, as by ``run``.
    u, y : (N,) array_like
    valid : (N,) array_like of bool, optional

    Returns
    -------
    Trace
    """
    u, y, present = check_signals(u, y, valid)
    N, p = len(u), len(estimator.names)
    kept = Trace(*(np.empty((N, *shape)) for shape in ((p,), (), (p,), (p, p), (p,))))
    for k in range(N):
        kept.theta[k] = estimator.step(u[k], y[k] if present[k] else None)
        kept.epsilon[k] = estimator.epsilon
        kept.psi[k] = estimator.psi
        kept.P[k] = estimator.P
        kept.covariance[k] = np.diag(estimator.covariance)
    return kept
