"""Joint unscented Kalman filter for state and parameters, in square-root form."""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.ekf import initial_state, project, walking
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.recursion.level import STATE as LEVEL_STATE
from flexaxis.estimators.recursion.level import TUNING as LEVEL_TUNING
from flexaxis.estimators.recursion.level import judge, set_level
from flexaxis.estimators.recursion.square_root import (
    bound_root,
    triangular_root,
    triangularize,
)
from flexaxis.estimators.sampling.compiler import compile_loop, jit
from flexaxis.estimators.sampling.pattern import Pattern, split
from flexaxis.estimators.sampling.plan import plan

Array = NDArray[np.float64]


def joint_ukf(
    model: Model,
    *,
    identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
    theta0: ArrayLike | None = None,
    P0: ArrayLike,
    drift: ArrayLike,
    period: float,
    noise: float | None = None,
    spread: float = 1.0,
    x0: ArrayLike | None = None,
    x0_covariance: ArrayLike | None = None,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
    output: str = "speed",
) -> CompiledFilter:
    """
    Make a square-root unscented Kalman filter for ξ = [θ; x], with θ a random walk.

    The model is that of `flexaxis.estimators.methods.ekf.joint_ekf`. Instead of derivatives, 2m+1
    sigma points χ₀ = ξ̂, χ = ξ̂ ± α√m S_i (S_i columns of the square root of P, m the length of ξ) go
    through the exact sampled model:

        ξ̂⁻ = Σ w χ⁺,  ŷ = Σ w y⁺,  P⁻ = Σ v (χ⁺−ξ̂⁻)(χ⁺−ξ̂⁻)ᵀ + W,  s = Σ v (y⁺−ŷ)² + σ²,
        K = Σ v (χ⁺−ξ̂⁻)(y⁺−ŷ)/s,  ξ̂ = ξ̂⁻ + K (y−ŷ),  P = P⁻ − K s Kᵀ,

    w₀ = 1 − 1/α², v₀ = w₀ + 3 − α² (β = 2, κ = 0), w = v = 1/(2α²m) of the others. R. van der
    Merwe and E. A. Wan, *The square-root unscented Kalman filter for state and
    parameter-estimation*, ICASSP 2001. Here one triangularisation of the array of √v [y⁺−ŷ χ⁺−ξ̂⁻],
    √W and σ gives s, K and the square root of P at once, without their downdates (T. Kailath, A. H.
    Sayed and B. Hassibi, *Linear Estimation*, ch. 12), which needs v₀ ≥ 0. Sigma points outside the
    box go through the model at its border.

    Parameters
    ----------
    model, identify, theta0, P0, drift, period, noise, x0, x0_covariance, bounds, output
        As for `flexaxis.estimators.methods.ekf.joint_ekf`.
    spread : float
        α in [0.52, 1.93], how far out the sigma points lie.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    v0 = 4 - 1 / spread**2 - spread**2 if spread > 0 else -1.0
    if not v0 >= 0:
        raise EstimatorError(f"spread is {spread}; α must lie in [0.52, 1.93], for weights ≥ 0")
    design = walking(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        drift=drift,
        period=period,
        bounds=bounds,
        output=output,
    )
    pattern, _ = split(design.model)
    tuning = _tuning(design, pattern, spread, v0)
    start = _start(design, pattern, spread, initial_state(design, x0, x0_covariance))
    set_level(tuning, start, noise, period)
    return CompiledFilter(ukf_loop(pattern), tuning, start, design, partial(_read, pattern.p))


def _tuning(design: Design, pattern: Pattern, spread: float, v0: float) -> NDArray[np.void]:
    _, coefficients = split(design.model)
    order, substeps = plan(design.model, design.lower, design.upper, design.period)
    row, column, _ = np.array(pattern.entries).T
    scale = np.where(row < pattern.n, design.period / substeps, 1.0)
    entry, *exponents = np.array(pattern.terms).T
    m = pattern.p + pattern.n
    tuning = np.zeros(1, _tuning_type(pattern))
    tuning["row"], tuning["column"] = row, column
    tuning["entry"], tuning["exponent"] = entry, np.array(exponents).T
    tuning["coefficient"] = coefficients * scale[entry]
    tuning["keep"] = [state not in pattern.reset for state in range(pattern.n)]
    tuning["reach"] = spread * np.sqrt(m)
    weights = np.full(2 * m, 1 / (2 * spread**2 * m))
    tuning["mean"] = np.r_[1 - 1 / spread**2, weights]
    tuning["root"] = np.sqrt(np.r_[v0, weights])
    tuning["walk"][0, :, : pattern.p] = np.linalg.cholesky(design.drift).T
    tuning["ceiling"] = design.theta0**2
    tuning["order"], tuning["substeps"] = order, substeps
    tuning["m"], tuning["p"] = m, pattern.p
    tuning["lower"], tuning["upper"] = design.lower, design.upper
    return tuning


def _start(
    design: Design, pattern: Pattern, spread: float, initial: tuple[Array, Array]
) -> NDArray[np.void]:
    p, n, m = pattern.p, pattern.n, pattern.p + pattern.n
    row, column, _ = np.array(pattern.entries).T
    S = np.zeros((m, m))
    S[:p, :p] = np.linalg.cholesky(design.P0).T
    S[p:, p:] = triangular_root(initial[1])
    xi = np.concatenate([design.theta0, initial[0]])
    reach = spread * np.sqrt(m) * S
    points = (xi + np.vstack([np.zeros(m), reach, -reach])).T
    inside = np.clip(points[:p].T, design.lower, design.upper)
    _, substeps = plan(design.model, design.lower, design.upper, design.period)
    scale = np.where(row < n, design.period / substeps, 1.0)
    start = np.zeros(1, _state_type(pattern))
    start["xi"][0, :m], start["S"][0], start["points"][0, :m] = xi, S, points
    start["points"][0, m] = [
        design.model.blocks(theta)[0, n, :n] @ x
        for theta, x in zip(inside, points[p:].T, strict=True)
    ]
    start["M"] = (design.model.blocks(design.theta0)[0, row, column] * scale)[:, None]
    return start


def _read(p: int, state: NDArray[np.void]) -> tuple[Array, Array]:
    S = state["S"][0, :, :p]
    return state["xi"][0, :p], S.T @ S


def _tuning_type(pattern: Pattern) -> np.dtype:
    p, m = pattern.p, pattern.p + pattern.n
    entries, terms = len(pattern.entries), len(pattern.terms)
    return np.dtype(
        [
            ("row", int, (entries,)),
            ("column", int, (entries,)),
            ("entry", int, (terms,)),  # that a term c·Πθ^e is part of
            ("exponent", int, (terms, p)),
            ("coefficient", float, (terms,)),
            ("keep", float, (pattern.n,)),  # 0 for states that are zero when a sample begins
            ("reach", float),  # of the sigma points, in standard deviations
            ("mean", float, (2 * m + 1,)),  # weights w
            ("root", float, (2 * m + 1,)),  # √v
            ("walk", float, (p, p)),  # upper square root of W
            ("order", int),
            ("substeps", int),
            ("m", int),  # sizes known only when it runs: else the compiler unrolls every loop
            ("p", int),
            ("lower", float, (p,)),
            ("upper", float, (p,)),
            ("ceiling", float, (p,)),  # of the variance of θ
            *LEVEL_TUNING,
        ],
        align=True,
    )


def _state_type(pattern: Pattern) -> np.dtype:
    n, p = pattern.n, pattern.p
    m, points = n + p, 2 * (n + p) + 1
    return np.dtype(
        [
            ("xi", float, (m + 1,)),  # θ, x and, last, what y is expected to be
            ("S", float, (m, m)),  # P = SᵀS, upper triangular
            ("M", float, (len(pattern.entries), points)),  # [A B; C 0] at each sigma point
            ("points", float, (m + 1, points)),  # side by side: θ, x and y of each
            ("power", float, (n + 1, points)),
            ("next", float, (n + 1, points)),
            ("array", float, (points + p + 1, 1 + m)),
            *LEVEL_STATE,
        ],
        align=True,
    )


@lru_cache
def ukf_loop(pattern: Pattern) -> Callable:
    """Return the compiled loop, as `flexaxis.estimators.recursion.kernel.rpem_loop`."""

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            correct(tuning, state, y[k], valid[k])
            draw(tuning, state)
            evaluate(tuning, state)
            propagate(tuning, state, u[k])
            for i in range(estimates.shape[1]):
                estimates[k, i] = state["xi"][i]

    return compile_loop(run, pattern.flat(), _tuning_type(pattern), _state_type(pattern))


@jit
def correct(tuning, state, y, valid):
    """Take ξ̂ and S from the propagated points, and through the measurement."""
    xi, S, A = state["xi"], state["S"], state["array"]
    m, p = tuning["m"], tuning["p"]
    points = 2 * m + 1
    spread = gather(tuning, state)
    y = judge(tuning, state, y, valid, xi[m], spread)
    use = not np.isnan(y)
    A[points + p, 0] = np.sqrt(state["noise"])
    if not use:
        for j in range(points):
            A[j, 0] = 0.0
    triangularize(A, points + p + 1, 1 + m)
    for i in range(m):
        for j in range(i, m):
            S[i, j] = A[1 + i, 1 + j]
        if use:
            xi[i] += A[0, 1 + i] * ((y - xi[m]) / A[0, 0])
    bound_root(S, tuning["ceiling"])
    project(xi, tuning["lower"], tuning["upper"])


@jit
def gather(tuning, state):
    """Write ξ̂⁻, ŷ and the array of deviations and √W, y first; return the variance of ŷ."""
    xi, A, Z = state["xi"], state["array"], state["points"]
    m, p = tuning["m"], tuning["p"]
    points = 2 * m + 1
    spread = 0.0
    for i in range(m + 1):
        mean = 0.0
        for j in range(points):
            mean += tuning["mean"][j] * Z[i, j]
        for j in range(points):
            A[j, (i + 1) % (m + 1)] = tuning["root"][j] * (Z[i, j] - mean)
        for j in range(p + 1):
            A[points + j, i] = 0.0
        xi[i] = mean
    for j in range(points):
        spread += A[j, 0] ** 2
    for i in range(p):
        for j in range(p):
            A[points + i, 1 + j] = tuning["walk"][i, j]
    return spread


@jit
def draw(tuning, state):
    """Place the sigma points."""
    xi, S, Z = state["xi"], state["S"], state["points"]
    m = tuning["m"]
    for i in range(m):
        Z[i, 0] = xi[i]
        for j in range(m):
            step = tuning["reach"] * S[j, i] if j <= i else 0.0
            Z[i, 1 + j] = xi[i] + step
            Z[i, 1 + m + j] = xi[i] - step


@jit
def evaluate(tuning, state):
    """Write the entries of [A B; C 0] that depend on θ, at every point."""
    M, Z, entry = state["M"], state["points"], tuning["entry"]
    for j in range(2 * tuning["m"] + 1):
        for t in range(len(entry)):
            M[entry[t], j] = 0.0
        for t in range(len(entry)):
            value = tuning["coefficient"][t]
            for i in range(tuning["p"]):
                e = tuning["exponent"][t, i]
                bounded = min(max(Z[i, j], tuning["lower"][i]), tuning["upper"][i])
                for _ in range(abs(e)):
                    value = value * bounded if e > 0 else value / bounded
            M[entry[t], j] += value


@jit
def propagate(tuning, state, u):
    """Take every point over one sample, with u held, by the Taylor series of the exact step."""
    Z, V, W = state["points"], state["power"], state["next"]
    p, n, points = tuning["p"], tuning["m"] - tuning["p"], 2 * tuning["m"] + 1
    for i in range(n):
        for j in range(points):
            Z[p + i, j] *= tuning["keep"][i]
    for k in range(tuning["substeps"] * tuning["order"] + 1):
        done = k % tuning["order"]  # powers of A T/s; at last, the output is read
        if done == 0:
            for i in range(n + 1):
                for j in range(points):
                    V[i, j] = Z[p + i, j] if i < n else u
        multiply(tuning, state["M"], V, W, n, points)
        for j in range(points):
            Z[p + n, j] = W[n, j]
            V[n, j] = 0.0  # the held input does not change
        if k < tuning["substeps"] * tuning["order"]:
            for i in range(n):
                for j in range(points):
                    V[i, j] = W[i, j] / (done + 1)
                    Z[p + i, j] += V[i, j]


@jit
def multiply(tuning, M, V, W, n, points):  # noqa: PLR0917
    """W ← [A B; C 0] V, point by point."""
    for i in range(n + 1):
        for j in range(points):
            W[i, j] = 0.0
    for e in range(len(M)):
        i, c = tuning["row"][e], tuning["column"][e]
        for j in range(points):
            W[i, j] += M[e, j] * V[c, j]
