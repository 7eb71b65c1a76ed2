"""Joint unscented Kalman filter for state and parameters, in square-root form."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.ekf import project, state_covariance
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design, make_design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.recursion.level import judge, level, show
from flexaxis.estimators.recursion.records import Record, joined, record
from flexaxis.estimators.recursion.square_root import (
    bound_root,
    triangular_root,
    triangularize,
)
from flexaxis.estimators.sampling.compiler import compiled, inlined
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
    design = make_design(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        drift=drift,
        period=period,
        noise=noise,
        x0=x0,
        bounds=bounds,
        output=output,
    )
    pattern, _ = split(design.model)
    known, level_start = level(design)
    tuning = joined(_tuning(design, pattern, spread, v0), known)
    start = _start(design, pattern, spread, state_covariance(design, x0_covariance))
    return CompiledFilter(
        ukf_loop, tuning, joined(start, level_start), design, partial(_read, pattern.p)
    )


def _tuning(design: Design, pattern: Pattern, spread: float, v0: float) -> Record:
    _, coefficients = split(design.model)
    order, substeps = plan(design.model, design.lower, design.upper, design.period)
    row, column, _ = np.array(pattern.entries).T
    entry, *exponents = np.array(pattern.terms).T
    m = pattern.p + pattern.n
    weights = np.full(2 * m, 1 / (2 * spread**2 * m))
    return record(
        row=row,
        column=column,
        entry=entry,  # that a term c·Πθ^e is part of
        exponent=np.array(exponents).T,
        coefficient=coefficients * _held(design, pattern, substeps)[entry],
        # 0 for states that are zero when a sample begins
        keep=np.array([float(state not in pattern.reset) for state in range(pattern.n)]),
        reach=spread * np.sqrt(m),  # of the sigma points, in standard deviations
        mean=np.r_[1 - 1 / spread**2, weights],  # weights w
        root=np.sqrt(np.r_[v0, weights]),  # √v
        walk=np.linalg.cholesky(design.drift).T,  # upper square root of W
        order=order,
        substeps=substeps,
        m=m,  # sizes known only when it runs: else the compiler unrolls every loop
        p=pattern.p,
        lower=design.lower,
        upper=design.upper,
        ceiling=design.theta0**2,  # of the variance of θ
    )


def _held(design: Design, pattern: Pattern, substeps: int) -> Array:
    """Return T/s for the entries of A and B, and 1 for those of C, (entries,)."""
    row = np.array(pattern.entries)[:, 0]
    return np.where(row < pattern.n, design.period / substeps, 1.0)


def _start(design: Design, pattern: Pattern, spread: float, covariance: Array) -> Record:
    p, n, m = pattern.p, pattern.n, pattern.p + pattern.n
    row, column, _ = np.array(pattern.entries).T
    S = np.zeros((m, m))
    S[:p, :p], S[p:, p:] = np.linalg.cholesky(design.P0).T, triangular_root(covariance)
    xi = np.concatenate([design.theta0, design.x0, [0.0]])
    reach = spread * np.sqrt(m) * S
    points = np.zeros((m + 1, 2 * m + 1))
    points[:m] = (xi[:m] + np.vstack([np.zeros(m), reach, -reach])).T
    inside = np.clip(points[:p].T, design.lower, design.upper)
    points[m] = [
        design.model.blocks(theta)[0, n, :n] @ x
        for theta, x in zip(inside, points[p:m].T, strict=True)
    ]
    _, substeps = plan(design.model, design.lower, design.upper, design.period)
    entries = design.model.blocks(design.theta0)[0, row, column]
    return record(
        xi=xi,  # θ, x and, last, what y is expected to be
        S=S,  # P = SᵀS, upper triangular
        # [A B; C 0] at each sigma point
        M=np.outer(entries * _held(design, pattern, substeps), np.ones(2 * m + 1)),
        points=points,  # side by side: θ, x and y of each
        power=np.zeros((n + 1, 2 * m + 1)),
        next=np.zeros((n + 1, 2 * m + 1)),
        array=np.zeros((2 * m + p + 2, 1 + m)),
    )


def _read(p: int, state: Record) -> tuple[Array, Array]:
    S = state["S"][0, :, :p]
    return state["xi"][0, :p], S.T @ S


@compiled
def ukf_loop(tunings, states, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples, as `flexaxis.estimators.recursion.loop.sample_loop`."""
    tuning, state = tunings[0], states[0]
    for k in range(len(u)):
        correct(tuning, state, y[k], valid[k])
        draw(tuning, state)
        evaluate(tuning, state)
        propagate(tuning, state, u[k])
        for i in range(estimates.shape[1]):
            estimates[k, i] = state["xi"][i]
        show(state, trace[k])


@inlined
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
    bound_root(S, tuning["ceiling"], 1.0)
    project(xi, tuning["lower"], tuning["upper"])


@inlined
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


@inlined
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


@inlined
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


@inlined
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


@inlined
def multiply(tuning, M, V, W, n, points):  # noqa: PLR0917
    """W ← [A B; C 0] V, point by point."""
    for i in range(n + 1):
        for j in range(points):
            W[i, j] = 0.0
    for e in range(len(M)):
        i, c = tuning["row"][e], tuning["column"][e]
        for j in range(points):
            W[i, j] += M[e, j] * V[c, j]
