"""
One measurement of a prediction-error method, in compiled code: eq. (5)–(7), (9), (10), (12).

All in relative parameters η = θ/θ(0). Beside P, which sets the gain, goes the covariance Σ that the
estimate really has for a unit noise variance, Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ with K = P(t|t) ψ:
in slow, steady adaptation it is P/2; after a reset of P it is not.
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

ASLEEP = 1e-2  # Σψ²/R̂, ψ by relative parameters, below which a sample tells nothing: doubling a
# parameter would move y by less than a tenth of its noise
CEILING = 1.0  # (Δθ/θ(0))², of R̂ P_ii: no parameter is more uncertain than by its own size
GRANTED = 3.0  # times P(0): what P may be in any case, as where a parameter is hardly excited
LINEAR = 1e-3  # of y, what a model that is linear in a change of half of θ leaves unexplained: what
# is less is no outlier, and no noise to reckon with after a reset. With less one reset in three
# ended elsewhere (σ = 7e-5 of y, 20 runs), with this none
EARLY = 100.0  # times P(0), the ceiling while R̂ is not known
ROBUST = 30.0  # standard deviations from which on a residual can only be an outlier: a fault that
# the suite knows makes ten at most, and one outlier at this limit moves no parameter by 2 %
CALM = 1e-3  # (Δθ/θ(0))², ceiling of R̂ P_ii: a deviation of 3 %, from which an axis is followed
# after a standstill. From 10 % and more one restart in ten ends in a local minimum or at the box;
# of 320 from 3 % none did (two axes, five kinds of standstill, seeds 0 to 15)


class Recursion(NamedTuple):
    """
    The state of a prediction-error method.

    Attributes
    ----------
    now, axis
        Numbers and model.
    theta : (p,) array
    X : (n+1, lanes) array
        States and output, with derivatives.
    P, claim : (p, p) arrays
        P and Σ.
    psi, gain, moved, reach : (p,) arrays
        ψ, Pψ, the θ before, and Σψ.
    granted : (p,) array
        What P may be besides, after a reset of it.
    drift : (p, p) array
        Δ.
    regularization, lower, upper, floor, early : (p,) arrays
        μ, the box, what P may be in any case, and its ceiling while R̂ is not known.
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
    Return a prediction-error method before the first sample.

    Parameters
    ----------
    design : Design
    robust : float
        Standard deviations beyond which a residual counts as one of that size, and nothing is taken
        from a stuck sensor; 0 for never.
    correct : bool
        Whether the state moves with θ.
    ceiling : float
        Largest variance of an estimate relative to θ(0)²; infinite for none.
    **more
        Numbers of a rule.
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
    """Measurement update of η, P and Σ, eq. (5)–(7), and projection of η on the box."""
    now = state.now[0]
    theta, psi, gain, moved = state.theta, state.psi, state.gain, state.moved
    p = len(theta)
    for i in range(p):
        psi[i] = state.X[-1, 1 + i]
        moved[i] = theta[i]
    now["expected"] = state.X[-1, 0]
    now["epsilon"] = now["variance"] = np.nan
    if valid:
        now["scale"] = 1.0 + _form(state.P, psi, gain)
        valid = not (now["clip"] > 0.0 and _sticks(now, y))
    else:
        now["reading"] = np.nan
    if valid:
        now["epsilon"] = y - now["expected"]
        weight = 1.0 / now["scale"]
        spread = 1.0 + _form(state.claim, psi, state.reach)
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
    """Return the residual, or as much of it as a single sample may have."""
    surprise = now["epsilon"]
    if now["clip"] > 0.0 and (judged or now["samples"] > 0.0):
        finest = max(now["noise"], LINEAR**2 * now["signal"])
        limit = now["clip"] * np.sqrt(finest * now["scale"])
        if not judged:  # R̂ is the mean of a few samples, and says little yet
            limit *= (KNOWN / now["samples"]) ** 2
        if surprise > limit:
            surprise = limit
        elif surprise < -limit:
            surprise = -limit
    return surprise


@inlined
def _sticks(now, y):
    """Return whether y is that of a sensor that is stuck; the first samples are believed."""
    known = now["samples"] >= KNOWN or now["known"] > 0.0
    noise = now["noise"] if known else now["earlier"]
    if is_stuck(now, y, now["expected"], noise * now["scale"]):
        return True
    if not np.isfinite(now["scale"]):  # ψ is none, or its square: as lost as where ŷ is none
        now["anew"] = 2.0
    return now["anew"] > max(now["heeds"], 1.0)  # ŷ or ψ is no number: θ stays what it was


@inlined
def _form(P, psi, gain):
    """Write P ψ, and return ψᵀ P ψ."""
    total = 0.0
    for i in range(len(psi)):
        gain[i] = 0.0
        if P[i, i] == 0.0:  # then so is the row: a parameter that is not estimated now
            continue
        for j in range(len(psi)):
            gain[i] += P[i, j] * psi[j]
        total += psi[i] * gain[i]
    return total


@inlined
def _learn(now, psi, square):
    """
    Take a squared residual into R̂, exact over the first samples, then with a memory.

    All of it, and not the rough part only, as `filters.noise` takes: a predictor
    has no process noise, so that what its model leaves must be in R̂. Without it the claims on an
    axis with friction that the model lacks are five times worse in NEES, and resets come too often.

    Not while the axis is not excited; return whether it is.
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
    """Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ, with K = Pψ/(1+ψᵀPψ), Σψ and 1 + ψᵀΣψ given."""
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
    """Move state and output to where the new θ would have taken them, x ← x + z Δθ, if asked."""
    X, moved = state.X, state.moved
    for i in range(len(X) if state.now[0]["correct"] > 0.0 else 0):
        for j in range(len(moved)):
            X[i, 0] += X[i, 1 + j] * moved[j]


@inlined
def time_update(state):
    """Take P over the time update, eq. (9) or (10), and regularise it, eq. (12)."""
    P, column = state.P, state.gain  # the gain has done its work and lends its place
    p = len(P)
    for i in range(p):
        for j in range(p):
            P[i, j] = P[i, j] / state.now[0]["forgetting"] + state.drift[i, j]
    for axis in range(p):  # (12) measures every parameter once, with weight μ
        mu = state.regularization[axis]
        if mu > 0.0:
            for i in range(p):
                column[i] = P[i, axis]
            subtract(P, column, mu / (1.0 + mu * P[axis, axis]))


@inlined
def bound_P(state):
    """
    Keep R̂ P below the ceiling, and P below its early one until R̂ is known: scale it down.

    A reset grants more, until the data have brought P down again.
    """
    now = state.now[0]
    P, granted, most = state.P, state.granted, state.gain  # which lends its place
    early = now["samples"] < KNOWN and now["known"] <= 0.0
    for i in range(len(P)):
        ceiling = state.early[i] if early else now["largest"] / now["noise"]
        most[i] = max(ceiling, granted[i])
        if P[i, i] < granted[i]:
            granted[i] = max(P[i, i], state.floor[i])
    bound(P, most)


@inlined
def publish(state, k, estimates, trace):
    """Write θ[k], and ŷ, innovation and its variance."""
    now = state.now[0]
    for i in range(estimates.shape[1]):
        estimates[k, i] = state.theta[i]
    trace[k, 0] = now["expected"]
    trace[k, 1] = now["epsilon"]
    trace[k, 2] = now["variance"]


@inlined
def subtract(P, v, w):
    """P ← P − w v vᵀ on one triangle, mirrored, so that P stays symmetric for ever."""
    for i in range(len(P)):
        for j in range(i + 1):
            P[i, j] -= w * v[i] * v[j]
            P[j, i] = P[i, j]


def read_claim(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) and its claimed covariance R̂ Σ (p, p)."""
    return state["theta"], state["noise"] * state["claim"]
