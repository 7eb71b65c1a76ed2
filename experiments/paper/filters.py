"""One recursive estimator over many records: estimates and the diagonal of P."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators import Rpem
from flexaxis.experiments.paper.data import Data, signals
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

STRIDE = 20
"""Samples from one kept P to the next."""

COARSE = 200
"""The same where P does not matter: every look at it costs time."""


@dataclass(frozen=True)
class FilterRuns:
    """What an estimator did on S records of N samples.

    Attributes
    ----------
    P0 : ndarray (p,)
        Diagonal of P(0).
    theta : ndarray (S, N, p)
        Estimates over nominal.
    P : ndarray (S, N/stride, p)
        Diagonal of P(t+1|t), every so many samples.
    """

    P0: Array
    theta: Array
    P: Array


@dataclass(frozen=True)
class Adaptation:
    """What is chosen in the recursive method: λ or Δ, and μ."""

    forgetting: float | None = None
    drift: ArrayLike | None = None
    regularization: float = 0.0


def filtered(
    data: Data,
    records: Sequence[Record],
    adaptation: Adaptation,
    *,
    P0: ArrayLike,
    start: float = 1.0,
    reset: tuple[int, Array] | None = None,
    stride: int = STRIDE,
) -> FilterRuns:
    """Run the recursive prediction-error method on each record.

    Parameters
    ----------
    data : Data
        For the model and what is identified.
    records : sequence of Record
    adaptation : Adaptation
    P0 : array_like (p,) or (p, p)
    start : float
        θ(0) over nominal.
    reset : (int, ndarray), optional
        Sample, a multiple of the stride, before which P is set to a new value.
    stride : int
        Samples from one kept P to the next.
    """
    nominal = data.parametrization.theta
    estimator = Rpem(
        data.model,
        identify=data.names,
        theta0=start * nominal,
        P0=P0,
        period=data.scenario.period,
        forgetting=adaptation.forgetting,
        drift=adaptation.drift,
        regularization=adaptation.regularization,
        ceiling=np.inf,  # the paper has none
    )
    done = [_follow(estimator, record, reset, stride) for record in records]
    initial = np.asarray(P0, float)
    return FilterRuns(
        P0=initial if initial.ndim == 1 else np.diag(initial),
        theta=np.stack([theta for theta, _ in done]) / nominal,
        P=np.stack([P for _, P in done]),
    )


def _follow(
    estimator: Rpem, record: Record, reset: tuple[int, Array] | None, stride: int
) -> tuple[Array, Array]:
    estimator.reset()
    (u, y), theta, P = signals(record), [], []
    for k in range(0, len(u), stride):
        if reset and k == reset[0]:
            estimator.P = reset[1]
        theta.append(estimator.run(u[k : k + stride], y[k : k + stride]))
        P.append(np.diag(estimator.P))
    return np.concatenate(theta), np.array(P)
