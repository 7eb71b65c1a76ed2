"""
The paper, literally: a matrix exponential of the extended system in every sample.

Östring and Gunnarsson, *Recursive identification of physical parameters in a flexible robot arm*.
Slow and written for reading; the compiled filter is checked against it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.filters.filter import RecursiveEstimator, Trace, trace
from flexaxis.estimators.filters.noise import MEMORY
from flexaxis.estimators.models.discretisation import discretize, extended_system
from flexaxis.estimators.models.model import Model

Array = NDArray[np.float64]


def measurement_update(P: Array, psi: Array) -> Array:
    """Return P(t|t), eq. (7)."""
    return P - P @ np.outer(psi, psi) @ P / (1 + psi @ P @ psi)


def time_update(P: Array, forgetting: float, drift: Array) -> Array:
    """Return P̄(t+1|t): by forgetting, eq. (9), or by covariance modification, eq. (10)."""
    return P / forgetting + drift


def regularize(P: Array, regularization: ArrayLike) -> Array:
    """Return P(t+1|t) = P̄ (I + μ P̄)⁻¹, eq. (12); μ may be one for each parameter."""
    weights = np.broadcast_to(np.asarray(regularization, float), len(P))
    return P @ np.linalg.inv(np.eye(len(P)) + weights[:, None] * P)


def _symmetrize(P: Array) -> Array:
    """Drop the antisymmetric part of P: rounding leaves some, and (9) lets it grow as λ⁻ᵏ."""
    return (P + P.T) / 2


class LiteralRpem(RecursiveEstimator):
    """
    The recursive prediction-error method word for word; use `Rpem`, which is the same but fast.

    In θ and not in θ/θ(0), and without anything that is not in the paper: no ceiling on P, no
    clipping of residuals, so that it does not outlive a long standstill or an outlier.

    Parameters, attributes and errors are those of `flexaxis.estimators.Rpem`, of which it lacks
    ``state_correction``, ``robust`` and ``ceiling``. Its claimed covariance is R̂ P/2, that of slow
    and steady adaptation.
    """

    _shared = (*RecursiveEstimator._shared, "_design")

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float,
        noise: float | None = None,
        forgetting: float | None = None,
        drift: ArrayLike | None = None,
        regularization: ArrayLike = 0.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
        x0: ArrayLike | None = None,
    ) -> None:
        self._design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            noise=noise,
            forgetting=forgetting,
            drift=drift,
            regularization=regularization,
            bounds=bounds,
            output=output,
            x0=x0,
            scale=np.ones(len(P0)),
        )
        super().__init__(self._design.model.names, output, self._design.bounds)
        self.reset()

    def _start(self) -> None:
        n, p = self._design.model.n, len(self.names)
        self._theta = self._design.theta0.copy()
        self.P = self._design.P0.copy()
        self.psi = np.zeros(p)
        self.epsilon = np.nan
        self._noise, self._count = self._design.noise**2 or 1.0, 0.0  # the paper's unit at first
        self._X = np.zeros((p + 1, n))  # z_1 … z_p and x, a row each
        self._X[-1] = self._design.x0
        self._system = extended_system(self._design.model, self._theta)

    @property
    def theta(self) -> Array:
        return self._theta.copy()

    @property
    def covariance(self) -> Array:
        return self._noise * self.P / 2

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        for k in range(len(u)):
            trace[k] = self._sample(u[k], y[k] if valid[k] else None)
            estimates[k] = self._theta

    def _sample(self, u: float, y: float | None) -> tuple[float, float, float]:
        """Take u[k], y[k]; return ŷ, the innovation, and its claimed variance."""
        predicted = self._predict()
        self.epsilon = np.nan if y is None else float(y - predicted)  # (6)
        claimed = float(self._noise * (1 + self.psi @ self.P @ self.psi / 2))
        if y is not None:
            self._measure()
        d = self._design
        self._theta = np.clip(self._theta, d.lower, d.upper)
        self.P = _symmetrize(time_update(self.P, d.forgetting, d.drift))
        self.P = _symmetrize(regularize(self.P, d.regularization))
        self._propagate(u)
        return predicted, self.epsilon, np.nan if y is None else claimed

    def trace(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Trace:
        """Do as ``run`` and keep residual, gradient and P."""
        return trace(self, u, y, valid)

    def _predict(self) -> float:
        output = self._system[2] @ self._X.ravel()  # (23)
        self.psi = output[:-1]
        return output[-1]

    def _measure(self) -> None:
        if not self._design.noise:  # R̂, a mean with a memory
            self._count = min(self._count + 1, MEMORY / self._design.period)
            square = float(self.epsilon**2 / (1 + self.psi @ self.P @ self.psi))
            self._noise += (square - self._noise) / self._count
        self.P = _symmetrize(measurement_update(self.P, self.psi))
        self._theta = self._theta + self.P @ self.psi * self.epsilon  # (5)

    def _propagate(self, u: float) -> None:
        self._system = extended_system(self._design.model, self._theta)
        transition, gain = discretize(*self._system[:2], self._design.period)
        self._X[:, list(self._design.model.reset)] = 0.0
        self._X = (transition @ self._X.ravel() + gain[:, 0] * u).reshape(self._X.shape)
