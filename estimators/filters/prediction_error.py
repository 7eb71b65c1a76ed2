"""
One update of the recursive prediction-error method, equations (5)–(7), (9), (10) and (12).

All quantities refer to the relative parameters η = θ/θ(0). The matrix P determines the gain K =
P(t|t) ψ. A second matrix Σ is the actual covariance of the estimate for a noise variance of one.
The measurement update of Σ is Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ. During slow, steady adaptation,
the actual covariance Σ equals P/2. After a reset of P, Σ differs from P/2.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design, above_zero, at_least_zero
from flexaxis.estimators.filters.fault_monitor import (
    HEEDS_LOST,
    HEEDS_NOTHING,
    check_residual,
    is_stuck,
)
from flexaxis.estimators.filters.noise import FINEST, clipped_variance
from flexaxis.estimators.filters.state import (
    KNOWN,
    NUMBERS,
    bound,
    first_arrays,
    is_known,
    project,
    subtract,
)
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Matrix, Memory, Vector
from flexaxis.estimators.models.series import Axis

Array = NDArray[np.float64]

ASLEEP = 1e-2  # a sample is not informative if the sum of ψ²/R̂ is below this value, with ψ for
# relative parameters: doubling a parameter would change y by less than a tenth of the noise
CEILING = 1.0  # largest R̂ P_ii relative to θ(0)²: a standard deviation of 100 %
GRANTED = 3.0  # multiple of P(0) that P may always reach, even if a parameter is hardly excited
LINEAR = 1e-3  # error, relative to y, that linearisation causes if θ changes by one half. Smaller
# residuals do not count as outliers, and a reset assumes at least this noise. With a lower value,
# one reset in three led to a wrong estimate (σ = 7e-5 of y, 20 runs); with this value, none did
EARLY = 100.0  # largest multiple of P(0) while R̂ is unknown
ROBUST = 30.0  # standard deviations beyond which a residual can only be an outlier: the faults in
# the suite cause at most ten, and an outlier at this limit changes every parameter by less than 2 %
CALM = 1e-3  # largest R̂ P_ii relative to θ(0)²: a standard deviation of 3 %, used for tracking
# after a standstill. With 10 % or more, one restart in ten ends in a local minimum or at the
# bounds; with 3 %, none of 320 restarts did (two axes, five kinds of standstill, seeds 0 to 15)


class Recursion(NamedTuple):
    """
    The state of a prediction-error method between two samples.

    Attributes
    ----------
    now, axis : record array, Axis
        Scalar variables of the filter, and arrays of the axis model.
    theta : (p,) array
        Estimate of the relative parameters η.
    X : (n+1, lanes) array
        States and output, and the derivatives of both with respect to the relative parameters η.
    drift : (p, p) array
        Drift covariance Δ that every time update adds to P.
    lower, upper : (p,) arrays
        Bounds of the estimate.
    P, claim : (p, p) arrays
        Matrices P and Σ.
    psi, gain, before, reach : (p,) arrays
        The gradient ψ of ŷ, the product Pψ, the estimate before the update, and the product Σψ.
    prior, granted : (p,) arrays
        Diagonal of P(0), and values up to which the diagonal of P can grow regardless of the
        variance limit. A reset of P increases ``granted``.
    regularization : (p,) array
        Regularisation weights μ of equation (12).
    """

    now: Annotated[NDArray[np.void], NUMBERS, 1]
    axis: Axis
    theta: Vector
    X: Matrix
    drift: Matrix
    lower: Vector
    upper: Vector
    P: Matrix
    claim: Matrix
    psi: Vector
    gain: Vector
    before: Vector
    reach: Vector
    prior: Vector
    granted: Vector
    regularization: Vector


def recursion(
    design: Design,
    *,
    robust: float = 0.0,
    correct: bool = False,
    ceiling: float = CEILING,
    **more: float,
) -> Memory:
    """
    Return the initial memory of a prediction-error method.

    Parameters
    ----------
    design : Design
    robust : float
        Number of standard deviations to which residuals are clipped, or 0 to disable clipping. If
        clipping is enabled, the filter also ignores the readings of a stuck sensor.
    correct : bool
        Whether the filter corrects its state when the parameter estimate changes.
    ceiling : float
        Upper limit on the variance of an estimate, relative to θ(0)²; infinity disables the limit.
    **more : float
        Initial values of further scalar variables, such as the options of a forgetting rule.
    """
    at_least_zero("robust", robust, "the clipping limit in standard deviations")
    if ceiling != np.inf:
        above_zero("ceiling", ceiling, "the variance limit")
    p, P0, prior = len(design.theta0), design.P0, np.diag(design.P0)
    arrays = first_arrays(
        design,
        1 + p,
        heeds=HEEDS_LOST if robust > 0 else HEEDS_NOTHING,
        forgetting=design.forgetting,
        correct=correct,
        clip=robust,
        consistency=clipped_variance(robust) if robust else 1.0,
        largest=ceiling,
        scale=1.0,
        noise=design.noise**2 or 1.0,
        quiet=1.0,
        **more,
    )
    return Memory(
        arrays
        | {"P": P0, "claim": P0}
        | dict.fromkeys(("psi", "gain", "before", "reach"), np.zeros(p))
        | {"prior": prior, "granted": GRANTED * prior, "regularization": design.regularization}
    )


@inlined
def measure(state, y, valid):
    """
    Use equations (5)–(7) to update η, P and Σ with a measurement, and clip η to its bounds.

    A filter that corrects its state also adds the effect z Δθ of the parameter change to its state
    and output.
    """
    now, theta, psi = state.now[0], state.theta, state.psi
    gain, reach, before = state.gain, state.reach, state.before
    for i in range(len(theta)):
        psi[i], before[i] = state.X[-1, 1 + i], theta[i]
    now["prediction"] = state.X[-1, 0]
    now["innovation"] = now["innovation_variance"] = np.nan
    if valid:
        now["scale"] = 1.0 + form(state.P, psi, gain)
        valid = not (now["clip"] > 0.0 and _sticks(now, y))
    else:
        now["reading"] = np.nan
    if valid:
        now["innovation"] = y - now["prediction"]
        weight = 1.0 / now["scale"]
        spread = 1.0 + form(state.claim, psi, reach)
        now["quiet"] = now["noise"]
        if is_known(now) or now["samples"] > 0.0:
            now["innovation_variance"] = now["noise"] * spread
        now["surprise"] = surprise = _limited(now)
        for i in range(len(theta)):
            theta[i] += gain[i] * (surprise * weight)
        subtract(state.P, gain, weight)
        # with r = Σψ and s = 1 + ψᵀr, the new Σ is Σ − r rᵀ/s + s (K − r/s) (K − r/s)ᵀ
        subtract(state.claim, reach, 1.0 / spread)
        for i in range(len(theta)):
            reach[i] = gain[i] * weight - reach[i] / spread
        subtract(state.claim, reach, -spread)
        excited = _learn(now, psi, surprise**2 / spread)
        if excited and now["heeds"] < HEEDS_NOTHING:
            check_residual(now, y, now["innovation"])
    project(theta, state.lower, state.upper)
    for j in range(len(theta) if now["correct"] > 0.0 else 0):
        for i in range(len(state.X)):
            state.X[i, 0] += state.X[i, 1 + j] * (theta[j] - before[j])


@inlined
def _limited(now):
    """Return the residual after clipping to the largest magnitude allowed for one sample."""
    surprise = now["innovation"]
    if now["clip"] > 0.0 and not np.isnan(now["innovation_variance"]):
        finest = max(now["noise"], LINEAR**2 * now["signal"])
        limit = now["clip"] * np.sqrt(finest * now["scale"])
        if not is_known(now):  # R̂ is the mean of only a few samples and still inaccurate
            limit *= (KNOWN / now["samples"]) ** 2
        surprise = min(max(surprise, -limit), limit)
    return surprise


@inlined
def _sticks(now, y):
    """Return whether the filter must ignore y because the sensor is stuck or a reset is pending."""
    noise = now["noise"] if is_known(now) else now["earlier"]
    if is_stuck(now, y, now["prediction"], noise * now["scale"]):
        return True
    if not np.isfinite(now["scale"]):  # ψ or ψᵀPψ is not finite: the filter is lost
        now["anew"] = 2.0
    return now["anew"] > max(now["heeds"], 1.0)  # if ŷ or ψ is not finite, θ does not change


@inlined
def form(P, psi, gain):
    """Write the product P ψ to ``gain``, and return the quadratic form ψᵀ P ψ."""
    total = 0.0
    for i in range(len(psi)):
        gain[i] = 0.0
        for j in range(len(psi)):
            gain[i] += P[i, j] * psi[j]
        total += psi[i] * gain[i]
    return total


@inlined
def _learn(now, psi, square):
    """
    Update the noise variance R̂ with a squared residual, and return whether the axis is excited.

    The noise variance R̂ is a mean of ε²/(1+ψᵀΣψ): the arithmetic mean over the first samples, and
    later an exponentially weighted mean. The estimate R̂ is updated only while the axis is excited.

    The noise variance R̂ is computed from the residual itself, whereas `filters.noise` also uses
    the third difference of the innovation. The predictor has no process noise, so R̂ must include
    the model errors. If R̂ excluded model errors, the normalised estimation error squared (NEES)
    for an axis with unmodelled friction would be five times larger, and resets would be too
    frequent.
    """
    excitation = 0.0
    for i in range(len(psi)):
        excitation += psi[i] ** 2
    excited = excitation > (ASLEEP * now["noise"] if now["samples"] > 0.0 else 0.0)
    if excited:
        now["samples"] = min(now["samples"] + 1.0, now["memory"])
        now["signal"] += (now["prediction"] ** 2 - now["signal"]) / now["samples"]
        if now["known"] <= 0.0:
            square /= now["consistency"]
            now["noise"] += (square - now["noise"]) / now["samples"]
            now["noise"] = max(now["noise"], FINEST**2 * now["signal"])
    return excited


@inlined
def grow(P, column, forgetting, drift, regularization):
    """Update P (p, p) by equation (9) or (10), and then by (12); ``column`` (p,) is overwritten."""
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
    Limit the diagonal of R̂ P, or the diagonal of P itself while R̂ is still unknown.

    After a reset of P, the diagonal of P can exceed its limit until the data have reduced P again.
    """
    now, P, prior = state.now[0], state.P, state.prior
    granted, most = state.granted, state.gain  # reuse the memory of the gain
    ceiling = now["largest"] / now["noise"]
    early = ceiling < np.inf and not is_known(now)
    for i in range(len(P)):
        most[i] = max(EARLY * prior[i] if early else ceiling, granted[i])
        if P[i, i] < granted[i]:
            granted[i] = max(P[i, i], GRANTED * prior[i])
    bound(P, most)


def read_claim(state: Memory) -> tuple[Array, Array]:
    """Return the parameter estimate η (p,) and its claimed covariance R̂ Σ (p, p)."""
    return state["theta"], state["noise"] * state["claim"]
