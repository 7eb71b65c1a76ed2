"""
The prediction-error method with other rules of forgetting, as one would write it from the papers.

Nothing of the package is used: A and B by hand, matrix exponentials, θ relative to θ(0).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from acceptance.axes import NAMES, held, system

N_X, N_P = 5, len(NAMES)
MEMORY = 400  # samples of the running noise variance
ASLEEP = 1e-2  # |ψ|² over the noise variance, below which a sample tells nothing

Array = np.ndarray


@dataclass(frozen=True)
class Seen:
    """
    What a rule is told of a sample.

    Attributes
    ----------
    psi : (p,) array
        Gradient by η = θ/θ(0).
    epsilon : float
        Residual.
    spread : float
        ψᵀPψ before the measurement.
    before, after : float
        Running noise variance without and with this sample; ``before`` is NaN where there is none.
    """

    psi: Array
    epsilon: float
    spread: float
    before: float
    after: float


Rule = Callable[[Array, Seen | None], Array]
"""Takes P after the measurement and what was seen, None in a gap; returns P after the sample."""


def extended(q: Mapping[str, float], scale: Array) -> tuple[Array, Array]:
    """F (20, 20) and G (20,) of x and its sensitivities by η, eq. (16)–(22), at the axis q."""
    A, B = (part[:N_X] for part in system(q))
    dA, dB = np.zeros((N_P, N_X, N_X)), np.zeros((N_P, N_X))
    dB[0, 2] = 1 / q["J_m"]  # by k_T
    dA[1, 4] = A[4, :N_X] * q["J_a"]  # by 1/J_a
    dA[2, 2, 2] = -1 / q["J_m"]  # by f_m
    F = np.kron(np.eye(1 + N_P), A[:, :N_X])
    for i in range(N_P):
        F[(1 + i) * N_X : (2 + i) * N_X, :N_X] = scale[i] * dA[i]
    return F, np.concatenate([B, *(scale[:, None] * dB)])


def advance(X: Array, u: float, q: Mapping[str, float], scale: Array, period: float) -> Array:
    """X (1+p, 5) one sample later, with u held."""
    return (held(*extended(q, scale), period) @ np.append(X, u)).reshape(X.shape)


def sampled(
    q: Mapping[str, float], xi: Array, u: float, *, period: float = 0.005, increments: bool = False
) -> Array:
    """ξ = [θ, x] one sample later; with increments the angle counts from the start of it."""
    A, B = system(dict(q) | physical(xi))
    x = xi[N_P:].copy()
    if increments:
        x[5] = 0.0
    n = len(x)
    return np.r_[xi[:N_P], held(A[:n, :n], B[:n], period) @ np.r_[x, u]]


def measured(xi: Array, P: Array, h: Array, y: float, sigma: float) -> tuple[Array, Array, float]:
    """ξ and P of a joint Kalman filter after y = hᵀξ + e, and the log likelihood of y."""
    S, e = h @ P @ h + sigma**2, y - h @ xi
    K = P @ h / S
    return xi + K * e, P - S * np.outer(K, K), -0.5 * (np.log(2 * np.pi * S) + e**2 / S)


def predicted(step: Callable[[Array], Array], xi: Array, P: Array, W: Array) -> tuple[Array, Array]:
    """ξ and P one sample later, by central differences of the step; θ gains the variances W."""
    sizes = np.r_[abs(xi[:N_P]), np.ones(len(xi) - N_P)] * 1e-5
    F = [(step(xi + d) - step(xi - d)) / (2 * d.max()) for d in np.diag(sizes)]
    P = np.transpose(F) @ P @ F
    P[:N_P, :N_P] += np.diag(W)
    return step(xi), P


def textbook(
    axis: Mapping[str, float],
    u: Array,
    y: Array,
    valid: Array,
    *,
    rule: Rule,
    theta0: Array,
    P0: Array,
    period: float = 0.005,
    corrected: bool = False,
) -> Array:
    """
    θ (N, p) of the method with a rule of forgetting.

    Parameters
    ----------
    axis : mapping
        The physical parameters that are not identified.
    P0 : (p,) array
        Diagonal of P(0), in the units of θ.
    corrected : bool
        Whether x follows every change of θ by its sensitivities.
    """
    eta, P, X = np.ones(N_P), np.diag(P0 / theta0**2), np.zeros((1 + N_P, N_X))
    claim, noise, found = P, RunningNoise(), []
    for k in range(len(u)):
        seen = None
        if valid[k]:
            psi, epsilon = X[1:, 2].copy(), y[k] - X[0, 2]
            spread, known = psi @ P @ psi, noise.value
            gain = P @ psi / (1 + spread)
            before, eta = eta, np.clip(eta + gain * epsilon, 0.1, 10.0)
            noise.add(epsilon**2 / (1 + psi @ claim @ psi), psi)
            seen = Seen(psi, epsilon, spread, known, noise.value)
            P = P - np.outer(gain, psi @ P)
            keep = np.eye(N_P) - np.outer(gain, psi)
            claim = keep @ claim @ keep.T + np.outer(gain, gain)
            if corrected:
                X[0] += (eta - before) @ X[1:]
        P = rule(P, seen)
        if isinstance(rule, Cusum) and rule.alarms[-1:] == [k]:
            claim = P
        found.append(eta * theta0)
        X = advance(X, u[k], axis | physical(found[-1]), theta0, period)
    return np.array(found)


class RunningMean:
    """Exponential, and exact until there are as many samples as its memory."""

    def __init__(self, memory: int) -> None:
        self.memory, self.count, self.value = memory, 0, 0.0

    def add(self, sample: float) -> float:
        self.count = min(self.count + 1, self.memory)
        self.value += (sample - self.value) / self.count
        return self.value


class RunningNoise:
    """R̂: the mean of ε²/(1+ψᵀΣψ), of samples in which something moves."""

    def __init__(self) -> None:
        self.mean, self.value = RunningMean(MEMORY), np.nan

    def add(self, square: float, psi: Array) -> None:
        if psi @ psi > (ASLEEP * self.value if self.mean.count else 0.0):
            self.value = self.mean.add(square)


def physical(theta: Array) -> dict[str, float]:
    """The parameters of which θ consists."""
    return {"k_T": theta[0], "J_a": 1 / theta[1], "f_m": theta[2]}


class Variable:
    """λ = σ_q σ_v/|σ_e − σ_v| while the residual is large (Paleologu et al. 2008)."""

    def __init__(self, highest: float, *, level: float, lowest: float = 0.9) -> None:
        self.limits, self.level, self.factors = (lowest, highest), level, []
        self.e, self.q, self.v = RunningMean(60), RunningMean(60), RunningMean(400)

    def __call__(self, P: Array, seen: Seen | None) -> Array:
        if seen is None:
            return P
        e, v = (np.sqrt(mean.add(seen.epsilon**2)) for mean in (self.e, self.v))
        q = np.sqrt(self.q.add(seen.spread**2))
        factor = q * v / abs(e - v) if e > self.level * v else self.limits[1]
        self.factors.append(np.clip(factor, *self.limits))
        return P / self.factors[-1]


class Cusum:
    """Forgetting, and P reset where a CUSUM says that the variance of the residual has grown."""

    def __init__(self, factor: float, *, level: float, reset: float) -> None:
        self.factor, self.level, self.reset = factor, level, reset
        self.evidence, self.wait, self.alarms = 0.0, 200, []  # a second before the first
        self.history = []

    def __call__(self, P: Array, seen: Seen | None) -> Array:
        P = P / self.factor
        if seen is not None and np.isfinite(seen.before):
            self.add(seen)
            if self.evidence > self.level and self.wait < 0:
                self.evidence, self.wait = 0.0, 100  # half a second
                self.alarms.append(len(self.history))
                P = np.eye(N_P) * self.reset**2 / seen.after
        self.history.append(self.evidence)
        return P

    def add(self, seen: Seen) -> None:
        """Log of the ratio of likelihoods of four times the variance and of what it was."""
        square = min(seen.epsilon**2 / (seen.before * (1 + seen.spread)), 16.0)
        self.evidence += (square * (1 - 1 / 4) - np.log(4)) / 2
        self.evidence = max(self.evidence, 0.0)
        self.wait -= 1
