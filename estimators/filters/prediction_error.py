"""
One measurement of a prediction-error method, in compiled code: eq. (5)–(7), (9), (10), (12).

All quantities are expressed in relative parameters η = θ/θ(0). The matrix P determines the gain. A
second matrix Σ is the actual covariance of the estimate for a noise variance of one,
Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ with K = P(t|t) ψ. In slow, steady adaptation Σ equals P/2; after
a reset of P the two differ.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.filters.fault_monitor import (
    HEEDS_LOST,
    HEEDS_NOTHING,
    check_residual,
    is_stuck,
    monitor_numbers,
)
from flexaxis.estimators.filters.noise import FINEST, KNOWN, MEMORY, clipped_variance
from flexaxis.estimators.filters.state import NUMBERS, bound, on_lanes, project
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Matrix, Memory, Vector, numbers
from flexaxis.estimators.models.series import Axis

Array = NDArray[np.float64]

ASLEEP = 1e-2  # Σψ²/R̂, with ψ for relative parameters, below which a sample is not informative:
# doubling a parameter would change y by less than a tenth of the noise
CEILING = 1.0  # largest R̂ P_ii relative to θ(0)²: a standard deviation of 100 %
GRANTED = 3.0  # multiple of P(0) that P may always reach, even if a parameter is hardly excited
LINEAR = 1e-3  # error relative to y of a model that is linear in a change of θ by one half. Smaller
# residuals are not outliers, and smaller noise is not assumed after a reset. With a lower value one
# reset in three led to a wrong estimate (σ = 7e-5 of y, 20 runs), with this value none
EARLY = 100.0  # largest multiple of P(0) while R̂ is unknown
ROBUST = 30.0  # standard deviations beyond which a residual can only be an outlier: the faults in
# the suite cause at most ten, and an outlier at this limit changes no parameter by 2 %
CALM = 1e-3  # largest R̂ P_ii relative to θ(0)²: a standard deviation of 3 %, with which an axis is
# tracked after a standstill. With 10 % or more one restart in ten ends in a local minimum or at the
# bounds; with 3 % none of 320 did (two axes, five kinds of standstill, seeds 0 to 15)


class Recursion(NamedTuple):
    """
    The state of a prediction-error method.

    Attributes
    ----------
    now, axis
        Scalar variables and arrays of the model.
    theta : (p,) array
        Estimate of the relative parameters η.
    X : (n+1, lanes) array
        States and output, with derivatives.
    P, claim : (p, p) arrays
        Matrices P and Σ.
    psi, gain, moved, reach : (p,) arrays
        Gradient ψ, the product Pψ, the previous estimate and then its change, and the product Σψ.
    granted : (p,) array
        Values up to which the diagonal of P may exceed the ceiling after a reset of P.
    drift : (p, p) array
        Covariance Δ that P gains in every sample.
    regularization : (p,) array
        Weights μ.
    lower, upper : (p,) arrays
        Bounds of the estimate.
    floor, early : (p,) arrays
        Values that the diagonal of P may always reach, and its upper limits while R̂ is unknown.
    """

    now: Annotated[NDArray[np.void], NUMBERS, 1]
    axis: Axis
    theta: Vector
    X: Matrix
    P: Matrix
    claim: Matrix
    psi: Vector
    gain: Vector
    moved: Vector
    reach: Vector
    granted: Vector
    drift: Matrix
    regularization: Vector
    lower: Vector
    upper: Vector
    floor: Vector
    early: Vector


def recursion(
    design: Design,
    *,
    robust: float = 0.0,
    correct: bool = False,
    ceiling: float = CEILING,
    **more: float,
) -> Memory:
    """
    Return the initial state of a prediction-error method.

    Parameters
    ----------
    design : Design
    robust : float
        Number of standard deviations to which residuals are clipped; 0 for no limit. With a limit,
        the readings of a stuck sensor are ignored as well.
    correct : bool
        Whether the state is corrected when θ changes.
    ceiling : float
        Largest variance of an estimate relative to θ(0)²; infinite for no limit.
    **more
        Values of further scalar variables, such as the options of a rule of forgetting.
    """
    at_least_zero("robust", robust, "standard deviations, such as 3, or 0 for never")
    if not (isinstance(ceiling, int | float) and ceiling > 0):
        raise EstimatorError(f"ceiling is {ceiling!r}; give a variance above 0, relative to θ(0)²")
    p, P0 = len(design.theta0), design.P0
    variances, nothing = np.diag(P0), np.zeros(p)
    heeds = HEEDS_LOST if robust > 0 else HEEDS_NOTHING
    now = monitor_numbers(design.period, heeds) | {
        "forgetting": design.forgetting,
        "memory": max(MEMORY / design.period, KNOWN),
        "known": float(design.noise > 0),
        "correct": float(correct),
        "clip": float(robust),
        "consistency": clipped_variance(robust) if robust else 1.0,
        "largest": float(ceiling),
        "epsilon": np.nan,
        "scale": 1.0,
        "variance": np.nan,
        "noise": design.noise**2 if design.noise else 1.0,
        "quiet": 1.0,
    }
    axis, X = on_lanes(design, 1 + p)
    return Memory(
        {"now": numbers(NUMBERS, now | more)}
        | axis
        | {
            "theta": design.theta0,
            "X": X,
            "P": P0,
            "claim": P0,
            "psi": nothing,
            "gain": nothing,
            "moved": nothing,
            "reach": nothing,
            "granted": GRANTED * variances,
            "drift": design.drift,
            "regularization": design.regularization,
            "lower": design.lower,
            "upper": design.upper,
            "floor": GRANTED * variances,
            "early": np.full(p, np.inf) if np.isinf(ceiling) else EARLY * variances,
        }
    )


@inlined
def measure(state, y, valid):
    """Perform the measurement update of η, P and Σ, eq. (5)–(7), and project η on the box."""
    now = state.now[0]
    theta, psi, gain, moved = state.theta, state.psi, state.gain, state.moved
    p = len(theta)
    for i in range(p):
        psi[i] = state.X[-1, 1 + i]
        moved[i] = theta[i]
    now["expected"] = state.X[-1, 0]
    now["epsilon"] = now["variance"] = np.nan
    if valid:
        now["scale"] = 1.0 + form(state.P, psi, gain)
        valid = not (now["clip"] > 0.0 and _sticks(now, y))
    else:
        now["reading"] = np.nan
    if valid:
        now["epsilon"] = y - now["expected"]
        weight = 1.0 / now["scale"]
        spread = 1.0 + form(state.claim, psi, state.reach)
        now["quiet"] = now["noise"]
        judged = now["samples"] >= KNOWN or now["known"] > 0.0
        if judged or now["samples"] > 0.0:
            now["variance"] = now["noise"] * spread
        surprise = _limited(now, judged)
        now["surprise"] = surprise
        for i in range(p):
            theta[i] += gain[i] * (surprise * weight)
        subtract(state.P, gain, weight)
        _carry(state.claim, gain, weight, state.reach, spread)
        excited = _learn(now, psi, surprise**2 / spread)
        if excited and now["heeds"] < HEEDS_NOTHING:
            check_residual(now, y, now["epsilon"])
    project(theta, state.lower, state.upper)
    for i in range(p):
        moved[i] = theta[i] - moved[i]


@inlined
def _limited(now, judged):
    """Return the residual, clipped to the largest size allowed for a single sample."""
    surprise = now["epsilon"]
    if now["clip"] > 0.0 and (judged or now["samples"] > 0.0):
        finest = max(now["noise"], LINEAR**2 * now["signal"])
        limit = now["clip"] * np.sqrt(finest * now["scale"])
        if not judged:  # R̂ is the mean of only a few samples and still inaccurate
            limit *= (KNOWN / now["samples"]) ** 2
        if surprise > limit:
            surprise = limit
        elif surprise < -limit:
            surprise = -limit
    return surprise


@inlined
def _sticks(now, y):
    """Return whether to ignore y because the sensor is stuck or the filter has to be reset."""
    known = now["samples"] >= KNOWN or now["known"] > 0.0
    noise = now["noise"] if known else now["earlier"]
    if is_stuck(now, y, now["expected"], noise * now["scale"]):
        return True
    if not np.isfinite(now["scale"]):  # ψ or ψᵀPψ is not finite: the filter is lost
        now["anew"] = 2.0
    return now["anew"] > max(now["heeds"], 1.0)  # if ŷ or ψ is not finite, θ does not change


@inlined
def form(P, psi, gain):
    """Write P ψ into ``gain``, and return ψᵀ P ψ."""
    total = 0.0
    for i in range(len(psi)):
        gain[i] = 0.0
        if P[i, i] == 0.0:  # the whole row is zero: this parameter is currently not estimated
            continue
        for j in range(len(psi)):
            gain[i] += P[i, j] * psi[j]
        total += psi[i] * gain[i]
    return total


@inlined
def _learn(now, psi, square):
    """
    Update R̂ with a squared residual, and return whether the axis is excited.

    R̂ is the exact mean over the first samples and then an exponential mean. R̂ is not updated while
    the axis is not excited.

    The whole residual is used, and not only its rough part as in `filters.noise`: a predictor has
    no process noise, so R̂ must include the errors of the model. Otherwise the NEES on an axis with
    unmodelled friction is five times worse, and resets are too frequent.
    """
    excitation = 0.0
    for i in range(len(psi)):
        excitation += psi[i] ** 2
    excited = excitation > (ASLEEP * now["noise"] if now["samples"] > 0.0 else 0.0)
    if excited:
        now["samples"] = min(now["samples"] + 1.0, now["memory"])
        now["signal"] += (now["expected"] ** 2 - now["signal"]) / now["samples"]
        if now["known"] <= 0.0:
            square /= now["consistency"]
            now["noise"] += (square - now["noise"]) / now["samples"]
            now["noise"] = max(now["noise"], FINEST**2 * now["signal"])
    return excited


@inlined
def _carry(claim, gain, weight, spread, scale):
    """Update Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ from ``gain`` = Pψ, Σψ and ``scale`` = 1 + ψᵀΣψ."""
    for i in range(len(gain)):
        a = gain[i] * weight
        if a == 0.0 and spread[i] == 0.0:
            continue
        for j in range(i + 1):
            b = gain[j] * weight
            claim[i, j] += scale * a * b - a * spread[j] - spread[i] * b
            claim[j, i] = claim[i, j]


@inlined
def correct_state(state):
    """Correct state and output for the change of θ, x ← x + z Δθ, if the filter does so."""
    X, moved = state.X, state.moved
    for i in range(len(X) if state.now[0]["correct"] > 0.0 else 0):
        for j in range(len(moved)):
            X[i, 0] += X[i, 1 + j] * moved[j]


@inlined
def time_update(state):
    """Perform the time update of P, eq. (9) or (10), and regularise P, eq. (12)."""
    # the gain is no longer needed: reuse its memory
    grow(state.P, state.gain, state.now[0]["forgetting"], state.drift, state.regularization)


@inlined
def grow(P, column, forgetting, drift, regularization):
    """Do the same for a matrix P (p, p), with memory (p,) for a column."""
    p = len(P)
    for i in range(p):
        for j in range(p):
            P[i, j] = P[i, j] / forgetting + drift[i, j]
    for axis in range(p):  # (12) is equivalent to measuring every parameter once, with weight μ
        mu = regularization[axis]
        if mu > 0.0:
            for i in range(p):
                column[i] = P[i, axis]
            subtract(P, column, mu / (1.0 + mu * P[axis, axis]))


@inlined
def bound_P(state):
    """
    Scale P so that R̂ P stays below the ceiling, or P below the early ceiling while R̂ is unknown.

    After a reset P may be larger, until the data have reduced P again.
    """
    now = state.now[0]
    P, granted, most = state.P, state.granted, state.gain  # reuse the memory of the gain
    early = now["samples"] < KNOWN and now["known"] <= 0.0
    for i in range(len(P)):
        ceiling = state.early[i] if early else now["largest"] / now["noise"]
        most[i] = max(ceiling, granted[i])
        if P[i, i] < granted[i]:
            granted[i] = max(P[i, i], state.floor[i])
    bound(P, most)


@inlined
def publish(state, k, estimates, trace):
    """Write θ[k], and ŷ[k], the innovation and its variance."""
    now = state.now[0]
    for i in range(estimates.shape[1]):
        estimates[k, i] = state.theta[i]
    trace[k, 0] = now["expected"]
    trace[k, 1] = now["epsilon"]
    trace[k, 2] = now["variance"]


@inlined
def subtract(P, v, w):
    """Compute P ← P − w v vᵀ for one triangle and mirror the result, so that P stays symmetric."""
    for i in range(len(P)):
        for j in range(i + 1):
            P[i, j] -= w * v[i] * v[j]
            P[j, i] = P[i, j]


def read_claim(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) and the claimed covariance R̂ Σ (p, p) of η."""
    return state["theta"], state["noise"] * state["claim"]
