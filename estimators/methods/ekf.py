"""Joint extended Kalman filter for state and parameters, on the lanes of the compiled kernel."""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design, make_design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.sampling.compiler import compile_loop, jit
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import Pattern, split
from flexaxis.estimators.sampling.plan import MAX_ORDER, plan

Array = NDArray[np.float64]


def joint_ekf(
    model: Model,
    *,
    identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
    theta0: ArrayLike | None = None,
    P0: ArrayLike,
    drift: ArrayLike,
    noise: float = 0.1,
    period: float = 0.005,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
    output: str = "speed",
) -> CompiledFilter:
    """
    Make an extended Kalman filter for ξ = [θ; x], with θ a random walk and no noise on x.

    θ[k+1] = θ[k] + w, cov w = W; x[k+1] = f(x[k], θ[k], u[k]), exact for a held u; y = h(x) + e,
    var e = σ². The textbook filter of L. Ljung, *Asymptotic behavior of the extended Kalman filter
    as a parameter estimator for linear systems*, IEEE Trans. AC 24 (1979). Unlike the
    prediction-error method it corrects the state as well, and knows σ.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    identify : sequence of str
        Parameters to estimate, or their inverses.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        Covariance of θ(0); x(0) = 0 is certain.
    drift : (p,) or (p, p) array_like
        W, what the covariance of θ gains in every sample.
    noise : float
        σ, standard deviation of the measured output [rad/s].
    period : float
        Sampling period T [s].
    bounds : (lower, upper), optional
        Box on which θ is projected after every update; 0.1 to 10 times θ(0) by default.
    output : {"speed", "increment"}
        What y is.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    design = walking(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        drift=drift,
        noise=noise,
        period=period,
        bounds=bounds,
        output=output,
    )
    pattern = with_state(split(design.model)[0])
    tuning, start = ekf_records(design, pattern, noise)
    return CompiledFilter(
        ekf_loop(pattern), tuning, start, design, partial(_read, len(design.theta0))
    )


def _read(p: int, state: NDArray[np.void]) -> tuple[Array, Array]:
    return state["theta"][0, :p], state["P"][0, :p, :p]


def walking(
    model: Model,
    *,
    identify: Sequence[str],
    theta0: ArrayLike | None,
    P0: ArrayLike,
    drift: ArrayLike,
    noise: float,
    period: float,
    bounds: tuple[ArrayLike, ArrayLike] | None,
    output: str,
) -> Design:
    """Check the options of `joint_ekf`, which explains them, and fill in defaults."""
    if not (np.isfinite(noise) and noise > 0):
        raise EstimatorError(f"noise is {noise}; give the standard deviation of y, above 0")
    return make_design(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        period=period,
        forgetting=None,
        drift=drift,
        regularization=0.0,
        bounds=bounds,
        output=output,
    )


def ekf_records(
    design: Design, pattern: Pattern, noise: float
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return tuning and start of the filter, as records for the compiled loop."""
    _, coefficients = split(design.model)
    order, substeps = plan(design.model, design.lower, design.upper, design.period)
    row, column, _ = np.array(pattern.entries).T
    scale = np.where(row < pattern.n, design.period / substeps, 1.0)

    tuning = np.zeros(1, ekf_tuning_type(pattern))
    tuning["coefficients"] = coefficients * scale[[entry for entry, *_ in pattern.terms]]
    tuning["weights"] = 1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1))
    tuning["order"], tuning["substeps"] = order, substeps
    tuning["drift"], tuning["variance"] = design.drift, noise**2
    tuning["lower"], tuning["upper"] = design.lower, design.upper

    p = len(design.theta0)
    start = np.zeros(1, ekf_state_type(pattern))
    start["theta"] = 1.0  # what pads θ must have an inverse
    start["theta"][0, :p] = design.theta0
    start["P"][0, :p, :p] = design.P0
    start["M"][0, :, : 1 + p] = (design.model.blocks(design.theta0)[:, row, column] * scale).T
    start["X"][0, : pattern.n, 1 + p : 1 + pattern.p] = np.eye(pattern.n)
    return tuning, start


def with_state(pattern: Pattern) -> Pattern:
    """
    Return the pattern with n more parameters on which no entry depends.

    Their lanes, set to one at x(0), become the derivatives by the state at the start of the
    sample: the transition matrix comes out of the same rows as ∂x/∂θ.
    """
    n = pattern.n
    return pattern._replace(
        p=pattern.p + n, terms=tuple((*term, *[0] * n) for term in pattern.terms)
    )


def ekf_tuning_type(pattern: Pattern) -> np.dtype:
    """Return the record type of what stays as it is while a filter runs."""
    p = pattern.p - pattern.n
    return np.dtype(
        [
            ("coefficients", float, (len(pattern.terms),)),
            ("weights", float, (MAX_ORDER,)),  # 1/1!, 1/2!, …
            ("order", int),
            ("substeps", int),
            ("drift", float, (p, p)),
            ("variance", float),
            ("lower", float, (p,)),
            ("upper", float, (p,)),
        ],
        align=True,
    )


def ekf_state_type(pattern: Pattern) -> np.dtype:
    """Return the record type of the state of a filter."""
    m, n, lanes = pattern.p, pattern.n, pattern.lanes
    return np.dtype(
        [
            ("theta", float, (m,)),
            ("P", float, (m, m)),  # of ξ = [θ; x]
            ("M", float, (len(pattern.entries), lanes)),
            ("X", float, (n + 1, lanes)),  # x and y, and derivatives by ξ of the sample before
            ("GP", float, (n, m)),
            ("Ph", float, (m,)),
            ("gain", float, (m,)),
        ],
        align=True,
    )


@lru_cache
def ekf_loop(pattern: Pattern) -> Callable:
    """
    Return the compiled loop for models of this pattern.

    Returns
    -------
    callable
        ``run(tuning, state, u, y, valid, estimates)``, as that of
        `flexaxis.estimators.recursion.kernel.rpem_loop`.
    """
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        n, p = len(state["GP"]), estimates.shape[1]
        for k in range(len(u)):
            correct(tuning, state, y[k], valid[k])
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            start_sample(state["X"], n, p)
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(p):
                estimates[k, i] = state["theta"][i]

    return compile_loop(run, flat, ekf_tuning_type(pattern), ekf_state_type(pattern))


@jit
def start_sample(X, n, p):
    """Set the derivatives by ξ at the start of a sample: ∂x/∂θ = 0, ∂x/∂x = I."""
    for i in range(n):
        for j in range(1, 1 + p + n):
            X[i, j] = 1.0 if j == 1 + p + i else 0.0


@jit
def correct(tuning, state, y, valid):
    """
    Take P over the last sample, and ξ and P through the measurement, in one step.

    With F = [I 0; G], G = ∂x⁺/∂ξ, and h = ∂y⁺/∂ξ, both by ξ of the sample before:
    S = hᵀPh + σ², K = F P h/S, ξ ← ξ⁺ + K (y − y⁺), P ← F P Fᵀ + W − K S Kᵀ.
    """
    P, X, GP, Ph, gain = state["P"], state["X"], state["GP"], state["Ph"], state["gain"]
    theta, n, p = state["theta"], len(GP), len(tuning["lower"])
    m = p + n
    S = tuning["variance"]
    for i in range(m):
        Ph[i] = 0.0
        for j in range(m):
            Ph[i] += P[i, j] * X[n, 1 + j]
        S += Ph[i] * X[n, 1 + i]
    for i in range(n):
        total = 0.0
        for j in range(m):
            total += X[i, 1 + j] * Ph[j]
            GP[i, j] = 0.0
            for q in range(m):
                GP[i, j] += X[i, 1 + q] * P[q, j]
        gain[p + i] = total / S
    for i in range(p):
        gain[i] = Ph[i] / S
    transport(P, GP, X, tuning["drift"], n, p)
    if valid:
        innovation = y - X[n, 0]
        for i in range(m):
            for j in range(i + 1):
                P[i, j] -= S * gain[i] * gain[j]
                P[j, i] = P[i, j]
        for i in range(n):
            X[i, 0] += gain[p + i] * innovation
        for i in range(p):
            theta[i] += gain[i] * innovation
    project(theta, tuning["lower"], tuning["upper"])


@jit
def project(theta, lower, upper):
    """Put the first of θ back into the box."""
    for i in range(len(lower)):
        if theta[i] < lower[i]:  # not min and max, which would hide a NaN
            theta[i] = lower[i]
        elif theta[i] > upper[i]:
            theta[i] = upper[i]


@jit
def transport(P, GP, X, W, n, p):  # noqa: PLR0917
    """P ← F P Fᵀ + W with F = [I 0; G], given G P; one triangle, mirrored."""
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for q in range(p + n):
                total += GP[i, q] * X[j, 1 + q]
            P[p + i, p + j] = P[p + j, p + i] = total
        for j in range(p):
            P[p + i, j] = P[j, p + i] = GP[i, j]
    for i in range(p):
        for j in range(p):
            P[i, j] += W[i, j]
