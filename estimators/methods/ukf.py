"""Joint unscented Kalman filter for state and parameters, in square-root form."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.covariance import (
    bound_root,
    padded,
    project,
    triangular_root,
    triangularize,
)
from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.loop import Record, joined, on_lanes, record
from flexaxis.estimators.filters.noise import judge, level, show
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern, split
from flexaxis.estimators.models.kernel import convey, place
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

Array = NDArray[np.float64]

WALK = 0.002  # 1/√s, of θ/θ(0), where no tuning is known


def joint_ukf(design: Design, *, spread: float = 1.0) -> CompiledFilter:
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
    design : Design
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
    if design.model.laws is not None:
        raise EstimatorError(
            "the model has nonlinear laws, which the unscented filter here cannot take "
            "over a sample; take ekf, imm or Rpem"
        )
    pattern, _ = split(design.model)
    known, level_start = level(design)
    tuning = joined(_tuning(design, pattern, spread, v0), known)
    start = _start(design, pattern, tuning)
    return CompiledFilter(
        _loop(pattern), tuning, joined(start, level_start), design, partial(_read, pattern.p)
    )


def _tuning(design: Design, pattern: Pattern, spread: float, v0: float) -> Record:
    m = pattern.p + pattern.n
    weight = 1 / (2 * spread**2 * m)  # of each point but the first
    own = record(
        reach=spread * np.sqrt(m),  # of the sigma points, in standard deviations
        weight=weight,
        root=np.sqrt(np.r_[v0, np.full(2 * m, weight)]),  # √v
        lower=design.lower,
        upper=design.upper,
        ceiling=design.theta0**2,  # of the variance of θ
    )
    return joined(on_lanes(design, pattern)[0], own)


def _start(design: Design, pattern: Pattern, tuning: Record) -> Record:
    p, n, m = pattern.p, pattern.n, pattern.p + pattern.n
    S, width = np.zeros((m, m)), padded(1 + 2 * m)
    S[:p, :p] = np.linalg.cholesky(design.P0).T
    S[p:, p:] = triangular_root(design.x0_covariance)
    xi = np.concatenate([design.theta0, design.x0])
    steps = np.zeros((width, m))
    steps[1 : 1 + 2 * m] = tuning["reach"][0] * np.vstack([S, -S])
    theta = np.clip(design.theta0 + steps[:, :p], design.lower, design.upper)
    x = design.x0 + steps[:, p:]
    y = [design.model.blocks(a)[0, n, :n] @ b for a, b in zip(theta, x, strict=True)]
    array = np.zeros((1 + m, padded(2 + 2 * m + p)))
    array[1 : 1 + p, : 1 + 2 * m] = (steps[: 1 + 2 * m, :p] * tuning["root"][0][:, None]).T
    array[1 : 1 + p, 2 + 2 * m : 2 + 2 * m + p] = np.linalg.cholesky(design.drift)
    M = on_lanes(design, pattern)[1]["M"][0, :, :1]
    return record(
        xi=np.append(xi, 0.0),  # θ, x and, last, what y is expected to be
        S=S,  # P = SᵀS, upper triangular
        theta=theta.T,  # of the points, side by side
        M=np.tile(M, width),  # [A B; C 0] at each
        X=np.vstack([x.T, y]),  # x and y of each
        inputs=np.zeros(width),
        array=array,  # columns side by side: y, θ and x
        upper=np.zeros((1 + m, 1 + m)),
    )


def _read(p: int, state: Record) -> tuple[Array, Array]:
    S = state["S"][0, :, :p]
    return state["xi"][0, :p], S.T @ S


def _unscented(
    problem: Problem,
    *,
    walk: float | None = None,
    spread: float = 0.2,
) -> CompiledFilter:
    """
    Make the joint unscented Kalman filter.

    Parameters
    ----------
    walk, spread
        As for `flexaxis.estimators.methods.ekf._extended`.
    """
    return joint_ukf(problem.walk_design("ukf", WALK, walk=walk, spread=spread))


ENTRIES = (
    Entry(
        "ukf",
        "joint unscented Kalman filter for state and parameters, in square-root form",
        _unscented,
        knob="walk",
        default=WALK,
        rank=8,
    ),
)


@remembered
def _loop(pattern: Pattern) -> Compiled:
    """Return the compiled loop for models of this pattern."""
    entries, series = place(pattern), convey(pattern)

    def run(tunings, states, u, y, valid, estimates, trace):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            _correct(tuning, state, y[k], valid[k])
            _draw(tuning, state, u[k])
            entries(tuning["coefficients"], state["theta"], state["M"])
            series(
                state["M"],
                state["X"],
                state["inputs"],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(estimates.shape[1]):
                estimates[k, i] = state["xi"][i]
            show(state, trace[k])

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter (an unscented Kalman filter) for {size}")


@inlined
def _correct(tuning, state, y, valid):
    """Take ξ̂ and S from the points as they have moved, and through the measurement."""
    xi, S, A, R = state["xi"], state["S"], state["array"], state["upper"]
    m = len(S)
    spread = _gather(tuning, state)
    y = judge(tuning, state, y, valid, xi[m], spread)
    use = not np.isnan(y)
    if not use:
        for j in range(1 + 2 * m):
            A[0, j] = 0.0
    A[0, 1 + 2 * m] = np.sqrt(state["noise"])
    triangularize(A.copy(), R)  # √W stays in it
    for i in range(m):
        for j in range(i, m):
            S[i, j] = R[1 + i, 1 + j]
        if use:
            xi[i] += R[0, 1 + i] * ((y - xi[m]) / R[0, 0])
    bound_root(S, tuning["ceiling"], 1.0)
    project(xi, tuning["lower"], tuning["upper"])


@inlined
def _gather(tuning, state):
    """
    Write ξ̂⁻, ŷ and the array of deviations, y first; return the variance of ŷ.

    What of the array are deviations of θ was written with the points, and √W before the first.
    """
    xi, A, X, root = state["xi"], state["array"], state["X"], tuning["root"]
    n, p = len(X) - 1, len(tuning["lower"])
    spread = 0.0
    for i in range(n + 1):
        apart, row = 0.0, 0 if i == n else 1 + p + i
        for j in range(1, len(root)):
            apart += X[i, j] - X[i, 0]
        xi[p + i] = X[i, 0] + tuning["weight"] * apart
        for j in range(len(root)):
            A[row, j] = root[j] * (X[i, j] - xi[p + i])
    for j in range(len(root)):
        spread += A[0, j] ** 2
    return spread


@inlined
def _draw(tuning, state, u):
    """Place the points, with the torque of each; θ of those outside the box is at its border."""
    xi, S, p = state["xi"], state["S"], len(tuning["lower"])
    m = len(S)
    for j in range(1 + 2 * m):
        state["inputs"][j] = u
        for i in range(m):
            step = 0.0
            if j > 0:
                step = tuning["reach"] * S[(j - 1) % m, i]
            if j > m:
                step = -step
            if i < p:
                inside = min(max(xi[i] + step, tuning["lower"][i]), tuning["upper"][i])
                state["theta"][i, j] = inside
                state["array"][1 + i, j] = tuning["root"][j] * step
            else:
                state["X"][i - p, j] = xi[i] + step
