"""
The paper, literally: a matrix exponential of the extended system in every sample.

Östring and Gunnarsson, *Recursive identification of physical parameters in a flexible robot arm*.
Slow and written for reading; the compiled filter is checked against it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import make_design
from flexaxis.estimators.recursion.noise import NoiseVariance
from flexaxis.estimators.recursion.trace import Trace, trace
from flexaxis.estimators.sampling.extended import discretize, extended_system
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]


def measurement_update(P: Array, psi: Array) -> Array:
    """Return P(t|t), eq. (7)."""
    return P - P @ np.outer(psi, psi) @ P / (1 + psi @ P @ psi)


def time_update(P: Array, forgetting: float, drift: Array) -> Array:
    """Return P̄(t+1|t): by forgetting, eq. (9), or by covariance modification, eq. (10)."""
    return P / forgetting + drift


def regularize(P: Array, regularization: float) -> Array:
    """Return P(t+1|t) = P̄ (I + μ P̄)⁻¹, eq. (12)."""
    return P @ np.linalg.inv(np.eye(len(P)) + regularization * P)


def symmetrize(P: Array) -> Array:
    """Drop the antisymmetric part of P: rounding leaves some, and (9) lets it grow as λ⁻ᵏ."""
    return (P + P.T) / 2


class LiteralRpem:
    """
    The recursive prediction-error method word for word; use `Rpem`, which is the same but fast.

    Parameters, attributes and errors are those of `flexaxis.estimators.Rpem`.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float = 0.005,
        forgetting: float | None = None,
        drift: ArrayLike | None = None,
        regularization: float = 0.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
    ) -> None:
        self._design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting,
            drift=drift,
            regularization=regularization,
            bounds=bounds,
            output=output,
        )
        self.names, self.output = self._design.model.names, output
        self.bounds = self._design.lower, self._design.upper
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        n, p = self._design.model.n, len(self.names)
        self.theta = self._design.theta0.copy()
        self.P = self._design.P0.copy()
        self.psi = np.zeros(p)
        self.epsilon = np.nan
        self._noise = NoiseVariance()
        self._X = np.zeros((p + 1, n))  # z_1 … z_p and x, a row each
        self._system = extended_system(self._design.model, self.theta)

    @property
    def covariance(self) -> Array:
        """Claimed covariance of θ̂, R̂ P/2, (p, p)."""
        return self._noise.value * self.P / 2

    def step(self, u: float, y: float | None) -> Array:
        """Take u[k], y[k] (None in a gap) and return θ[k] (p,)."""
        check_sample(u, y)
        predicted = self._predict()
        self.epsilon = np.nan if y is None else y - predicted  # (6)
        if y is not None:
            self._measure()
        d = self._design
        self.theta = np.clip(self.theta, d.lower, d.upper)
        self.P = symmetrize(time_update(self.P, d.forgetting, d.drift))
        self.P = symmetrize(regularize(self.P, d.regularization))
        self._propagate(u)
        return self.theta.copy()

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """Take N samples from the current state on and return θ (N, p)."""
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), len(self.names)))
        for k in range(len(u)):
            estimates[k] = self.step(u[k], y[k] if present[k] else None)
        return estimates

    def trace(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Trace:
        """Do as ``run`` and keep residual, gradient and P."""
        return trace(self, u, y, valid)

    def _predict(self) -> float:
        output = self._system[2] @ self._X.ravel()  # (23)
        self.psi = output[:-1]
        return output[-1]

    def _measure(self) -> None:
        self._noise.add(float(self.epsilon**2 / (1 + self.psi @ self.P @ self.psi)))
        self.P = symmetrize(measurement_update(self.P, self.psi))
        self.theta = self.theta + self.P @ self.psi * self.epsilon  # (5)

    def _propagate(self, u: float) -> None:
        self._system = extended_system(self._design.model, self.theta)
        transition, gain = discretize(*self._system[:2], self._design.period)
        self._X[:, list(self._design.model.reset)] = 0.0
        self._X = (transition @ self._X.ravel() + gain[:, 0] * u).reshape(self._X.shape)


literal_rpem = LiteralRpem
