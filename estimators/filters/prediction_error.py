"""
One measurement of a prediction-error method, in compiled code: eq. (5)–(7), (9), (10), (12).

All in relative parameters η = θ/θ(0). Beside P, which sets the gain, goes the covariance Σ that the
estimate really has for a unit noise variance, Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ with K = P(t|t) ψ:
in slow, steady adaptation it is P/2; after a reset of P it is not.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.covariance import bound, project
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.filters.fault_monitor import (
    HEEDS_LOST,
    HEEDS_NOTHING,
    check_residual,
    is_stuck,
    monitor_records,
)
from flexaxis.estimators.filters.loop import Record, joined, record
from flexaxis.estimators.filters.noise import FINEST, KNOWN, MEMORY, clipped_variance
from flexaxis.estimators.models.compiler import inlined

Array = NDArray[np.float64]

ASLEEP = 1e-2  # Σψ²/R̂, ψ by relative parameters, below which a sample tells nothing: doubling a
# parameter would move y by less than a tenth of its noise
CEILING = 1.0  # (Δθ/θ(0))², of R̂ P_ii: no parameter is more uncertain than by its own size
GRANTED = 3.0  # times P(0): what P may be in any case, as where a parameter is hardly excited
LINEAR = (
    1e-3  # of y, which a model that is linear in a change of half of θ leaves unexplained: what
)
# is less is no outlier, and no noise to reckon with after a reset. With less one reset in three
# ended elsewhere (σ = 7e-5 of y, 20 runs), with this none
EARLY = 100.0  # times P(0), the ceiling while R̂ is not known
ROBUST = 30.0  # standard deviations from which on a residual can only be an outlier: a fault that
# the suite knows makes ten at most, and one outlier at this limit moves no parameter by 2 %
CALM = 1e-3  # (Δθ/θ(0))², ceiling of R̂ P_ii: a deviation of 3 %, from which an axis is followed
# after a standstill. From 10 % and more one restart in ten ends in a local minimum or at the box;
# of 320 from 3 % none did (two axes, five kinds of standstill, seeds 0 to 15)


def measurement_records(
    design: Design,
    *,
    clip: float = 0.0,
    correct: bool = False,
    ceiling: float = CEILING,
) -> tuple[Record, Record]:
    """
    Return tuning and state for `measure`, `correct_state`, `predict` and `bound_P`.

    Parameters
    ----------
    design : Design
    clip : float
        Standard deviations beyond which a residual counts as one of that size, and nothing is taken
        from a stuck sensor; 0 for never.
    correct : bool
        Whether the state moves with θ.
    ceiling : float
        Largest variance of an estimate relative to θ(0)²; infinite for none.
    """
    at_least_zero("robust", clip, "standard deviations, such as 3, or 0 for never")
    if not (isinstance(ceiling, int | float) and ceiling > 0):
        raise EstimatorError(f"ceiling is {ceiling!r}; give a variance above 0, relative to θ(0)²")
    p = len(design.theta0)
    tuning = record(
        forgetting=design.forgetting,
        inflation=1 / design.forgetting,  # of P
        drift=design.drift,
        regularization=design.regularization,
        lower=design.lower,
        upper=design.upper,
        memory=max(MEMORY / design.period, KNOWN),
        known=float(design.noise > 0),
        correct=float(correct),
        clip=float(clip),
        consistency=clipped_variance(clip) if clip else 1.0,
        ceiling=float(ceiling),
        floor=GRANTED * np.diag(design.P0),
        early=np.full(p, np.inf) if np.isinf(ceiling) else EARLY * np.diag(design.P0),
    )
    state = record(
        P=design.P0,
        claim=design.P0,  # Σ
        granted=GRANTED * np.diag(design.P0),  # what P may be besides, after a reset of it
        psi=np.zeros(p),
        gain=np.zeros(p),
        moved=np.zeros(p),
        spread=np.zeros(p),  # Σψ
        expected=0.0,  # ŷ of the last sample
        epsilon=np.nan,
        surprise=0.0,  # the residual, clipped
        scale=1.0,  # 1 + ψᵀPψ of the last measurement
        variance=np.nan,  # of the innovation
        noise=design.noise**2 if design.noise else 1.0,  # R̂
        quiet=1.0,  # R̂ before the last measurement
        samples=0.0,  # that R̂ is the mean of
        signal=0.0,  # mean square of ŷ
    )
    heeds = HEEDS_LOST if clip > 0 else HEEDS_NOTHING
    more, sensor = monitor_records(design.period, heeds)
    return joined(tuning, more), joined(state, sensor)


@inlined
def measure(tuning, state, y, valid):
    """Measurement update of η, P and Σ, eq. (5)–(7), and projection of η on the box."""
    theta, psi, gain, moved = state["theta"], state["psi"], state["gain"], state["moved"]
    p = len(theta)
    for i in range(p):
        psi[i] = state["X"][-1, 1 + i]
        moved[i] = theta[i]
    state["expected"] = state["X"][-1, 0]
    state["epsilon"] = state["variance"] = np.nan
    if valid:
        state["scale"] = 1.0 + _form(state["P"], psi, gain)
        valid = not (tuning["clip"] > 0.0 and _sticks(tuning, state, y))
    else:
        state["reading"] = np.nan
    if valid:
        state["epsilon"] = y - state["expected"]
        weight = 1.0 / state["scale"]
        spread = 1.0 + _form(state["claim"], psi, state["spread"])
        state["quiet"] = state["noise"]
        judged = state["samples"] >= KNOWN or tuning["known"] > 0.0
        if judged or state["samples"] > 0.0:
            state["variance"] = state["noise"] * spread
        surprise = _limited(tuning, state, judged)
        state["surprise"] = surprise
        for i in range(p):
            theta[i] += gain[i] * (surprise * weight)
        subtract(state["P"], gain, weight)
        _carry(state["claim"], gain, weight, state["spread"], spread)
        excited = _learn(tuning, state, surprise**2 / spread)
        if excited and tuning["heeds"] < HEEDS_NOTHING:
            check_residual(tuning, state, y, state["epsilon"])
    project(theta, tuning["lower"], tuning["upper"])
    for i in range(p):
        moved[i] = theta[i] - moved[i]


@inlined
def _limited(tuning, state, judged):
    """Return the residual, or as much of it as a single sample may have."""
    surprise = state["epsilon"]
    if tuning["clip"] > 0.0 and (judged or state["samples"] > 0.0):
        finest = max(state["noise"], LINEAR**2 * state["signal"])
        limit = tuning["clip"] * np.sqrt(finest * state["scale"])
        if not judged:  # R̂ is the mean of a few samples, and says little yet
            limit *= (KNOWN / state["samples"]) ** 2
        if surprise > limit:
            surprise = limit
        elif surprise < -limit:
            surprise = -limit
    return surprise


@inlined
def _sticks(tuning, state, y):
    """Return whether y is that of a sensor that is stuck; the first samples are believed."""
    known = state["samples"] >= KNOWN or tuning["known"] > 0.0
    noise = state["noise"] if known else state["earlier"]
    if is_stuck(state, y, state["expected"], noise * state["scale"]):
        return True
    if not np.isfinite(state["scale"]):  # ψ is none, or its square: as lost as where ŷ is none
        state["anew"] = 2.0
    return state["anew"] > max(tuning["heeds"], 1.0)  # ŷ or ψ is no number: θ stays what it was


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
def _learn(tuning, state, square):
    """
    Take a squared residual into R̂, exact over the first samples, then with a memory.

    All of it, and not the rough part only, as `filters.noise` takes: a predictor
    has no process noise, so that what its model leaves must be in R̂. Without it the claims on an
    axis with friction that the model lacks are five times worse in NEES, and resets come too often.

    Not while the axis is not excited; return whether it is.
    """
    excitation = 0.0
    for i in range(len(state["psi"])):
        excitation += state["psi"][i] ** 2
    excited = excitation > (ASLEEP * state["noise"] if state["samples"] > 0.0 else 0.0)
    if excited:
        state["samples"] = min(state["samples"] + 1.0, tuning["memory"])
        state["signal"] += (state["expected"] ** 2 - state["signal"]) / state["samples"]
        if tuning["known"] <= 0.0:
            square /= tuning["consistency"]
            state["noise"] += (square - state["noise"]) / state["samples"]
            state["noise"] = max(state["noise"], FINEST**2 * state["signal"])
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
    """Move state and output to where the new θ would have taken them, x ← x + z Δθ."""
    X, moved = state["X"], state["moved"]
    for i in range(len(X)):
        for j in range(len(moved)):
            X[i, 0] += X[i, 1 + j] * moved[j]


@inlined
def predict(tuning, state):
    """Time update of P, eq. (9) or (10), and regularisation, eq. (12)."""
    P, column = state["P"], state["gain"]  # the gain has done its work and lends its place
    p = len(P)
    for i in range(p):
        for j in range(p):
            P[i, j] = tuning["inflation"] * P[i, j] + tuning["drift"][i, j]
    for axis in range(p):  # (12) measures every parameter once, with weight μ
        mu = tuning["regularization"][axis]
        if mu > 0.0:
            for i in range(p):
                column[i] = P[i, axis]
            subtract(P, column, mu / (1.0 + mu * P[axis, axis]))


@inlined
def bound_P(tuning, state):
    """
    Keep R̂ P below the ceiling, and P below its early one until R̂ is known: scale it down.

    A reset grants more, until the data have brought P down again.
    """
    P, granted, most = state["P"], state["granted"], state["gain"]  # which lends its place
    early = state["samples"] < KNOWN and tuning["known"] <= 0.0
    for i in range(len(P)):
        ceiling = tuning["early"][i] if early else tuning["ceiling"] / state["noise"]
        most[i] = max(ceiling, granted[i])
        if P[i, i] < granted[i]:
            granted[i] = max(P[i, i], tuning["floor"][i])
    bound(P, most)


@inlined
def publish(state, k, estimates, trace):
    """Write what `filters.loop` wants of a sample."""
    for i in range(estimates.shape[1]):
        estimates[k, i] = state["theta"][i]
    trace[k, 0] = state["expected"]
    trace[k, 1] = state["epsilon"]
    trace[k, 2] = state["variance"]


@inlined
def subtract(P, v, w):
    """P ← P − w v vᵀ on one triangle, mirrored, so that P stays symmetric for ever."""
    for i in range(len(P)):
        for j in range(i + 1):
            P[i, j] -= w * v[i] * v[j]
            P[j, i] = P[i, j]


def read_claim(state: Record) -> tuple[Array, Array]:
    """Return η (p,) and its claimed covariance R̂ Σ (p, p)."""
    return state["theta"][0], state["noise"][0] * state["claim"][0]
