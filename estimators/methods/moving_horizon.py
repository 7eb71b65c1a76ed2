"""Moving horizon: nonlinear least squares over a window that moves along, with an arrival cost."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.ekf import initial_state
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design, make_design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.recursion.level import FINEST, KNOWN, MOVING, ODD, noise_variance
from flexaxis.estimators.recursion.square_root import (
    bound_root,
    cholesky,
    forward,
    triangular_root,
    triangularize,
)
from flexaxis.estimators.sampling.plan import plan
from flexaxis.estimators.sampling.sampled import sample, terms

Array = NDArray[np.float64]

_inlined = njit(inline="always", error_model="numpy")  # compiled once, with what calls it


class Setting(NamedTuple):
    """What stays as it is: the options of `moving_horizon`, and what θ̂ and its P may be."""

    forgetting: float
    every: int
    iterations: int
    known: bool
    lower: Array
    upper: Array
    ceiling: Array


class Window(NamedTuple):
    """
    What is known, and changes.

    Attributes
    ----------
    u, y, present : (N,) arrays
        Torque held before, output, and whether that was measured, at samples s+1, s+2, …
    mean, root : (m,) and (m, m) arrays
        ξ̄, and S, upper triangular, with P̄ = SᵀS.
    xi : (m,) array
        ξ̂ at sample s.
    claimed : (p, p) array
        Covariance of θ̂.
    half : (m, m) array
        P^½, with the covariance PᵀP of ξ̂ for a noise variance of one, after the data.
    D : (1+p, n+1, n+1) array
        The model sampled at θ̂, as from `flexaxis.estimators.sampling.sampled.sample`.
    x, Z : (n+1,) and (n+1, m) arrays
        State and output at the last sample as predicted from ξ̂, and their sensitivities by ξ.
    taken : (2,) int array
        Samples so far, and those of them in the window.
    held : (1,) array
        Torque since the last sample.
    level : (2,) array
        R̂, 0 while it is not known, and 1 if the last sample was beyond `ODD`.
    shown : (3,) array
        ŷ, innovation and its variance at the last sample.
    """

    u: Array
    y: Array
    present: NDArray[np.bool_]
    mean: Array
    root: Array
    xi: Array
    claimed: Array
    half: Array
    D: Array
    x: Array
    Z: Array
    taken: NDArray[np.int64]
    held: Array
    level: Array
    shown: Array


def moving_horizon(
    model: Model,
    *,
    identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
    theta0: ArrayLike | None = None,
    P0: ArrayLike,
    period: float,
    forgetting: float | None = None,
    window: int = 200,
    every: int = 10,
    iterations: int = 2,
    noise: float | None = None,
    x0: ArrayLike | None = None,
    x0_covariance: ArrayLike | None = None,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
    output: str = "speed",
) -> CompiledFilter:
    """
    Make a least-squares fit to the last samples that is done again and again.

    θ and the state x(s) at the start of a window of N samples minimise

        (ξ − ξ̄)ᵀ P̄⁻¹ (ξ − ξ̄) + Σ_{k=s+1}^{s+N} (y[k] − ŷ[k](ξ))²,  ξ = [θ; x(s)],

    θ constant in the window, by Gauss and Newton from the minimum before. The first term, the
    arrival cost, stands for all that lies before the window: when that moves on, ξ̄ and P̄ go
    through the samples that leave it, linearised at the minimum, and P̄ ← P̄/λ for each of them. C.
    V. Rao, J. B. Rawlings and D. Q. Mayne, *Constrained state estimation for nonlinear
    discrete-time systems: stability and moving horizon approximations*, IEEE Trans. AC 48 (2003)
    246–258. The estimate stays as it is between two windows.

    Its claim is R̂ P (N+M/2)/(N+M), M = 1/(1−λ): the variance of a mean with the weight 1 in the
    window and λ^k before it. R̂ is the mean square of the residual at those samples of the window in
    which the axis moves. R̂P̄ of θ_i stays below θ_i(0)², to which row and column are scaled down. A
    sample that lies alone beyond 100 standard deviations of its prediction is not used, and each
    after it counts as one of that size.

    Parameters
    ----------
    model, identify, theta0, P0, period, bounds, output
        As for `flexaxis.estimators.Rpem`.
    forgetting : float
        λ, by which data count less for every sample that they lie before the window.
    window, every : int
        Samples in a window, N, and from one to the next, of which N is a multiple.
    iterations : int
        Steps of Gauss and Newton in each.
    noise : float, optional
        σ of y, in its unit; R̂ = σ² then.
    x0, x0_covariance : (n,), and (n,) or (n, n) array_like, optional
        State at the first sample and its covariance, for a noise variance of one as P0; zero, and
        certain, by default.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    design = make_design(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        period=period,
        forgetting=forgetting,
        drift=None,
        regularization=0.0,
        bounds=bounds,
        output=output,
    )
    _check_window(window, every, iterations)
    level = noise_variance(noise)
    order, substeps = plan(design.model, design.lower, design.upper, period)
    setting = Setting(
        design.forgetting,
        int(every),
        int(iterations),
        noise is not None,
        design.lower,
        design.upper,
        design.theta0**2,
    )
    tuning = terms(design.model, order, substeps, period), setting
    start = _start(design, int(window), level, initial_state(design, x0, x0_covariance))
    return CompiledFilter(horizon_loop, tuning, start, design, _read)


def _check_window(window: float, every: float, iterations: float) -> None:
    whole = all(np.isfinite(n) and n == int(n) for n in (window, every, iterations))
    if not (whole and every >= 1 and iterations >= 1 and window > every and window % every == 0):
        raise EstimatorError(
            f"window is {window}, every {every}, iterations {iterations}; the window is a multiple "
            "of every in whole samples, such as 200 and 10, and there is one iteration at least"
        )


def _start(design: Design, window: int, level: float, initial: tuple[Array, Array]) -> Window:
    p, n = len(design.theta0), design.model.n
    x, covariance = initial
    root = np.zeros((p + n, p + n))
    root[:p, :p] = np.linalg.cholesky(design.P0).T
    root[p:, p:] = triangular_root(covariance)
    xi = np.concatenate([design.theta0, x])
    blocks = design.model.blocks(design.theta0)
    Z = np.eye(n + 1, p + n, p)
    Z[n, :p], Z[n, p:] = blocks[1:, n, :n] @ x, blocks[0, n, :n]
    return Window(
        u=np.zeros(window),
        y=np.zeros(window),
        present=np.zeros(window, bool),
        mean=xi,
        root=root,
        xi=xi.copy(),
        claimed=design.P0.copy(),
        half=root.copy(),
        D=np.zeros((1 + p, n + 1, n + 1)),
        x=np.append(x, blocks[0, n, :n] @ x),
        Z=Z,
        taken=np.zeros(2, np.int64),
        held=np.zeros(1),
        level=np.array([level, 0.0]),
        shown=np.full(3, np.nan),
    )


def _read(state: Window) -> tuple[Array, Array]:
    return state.xi[: len(state.claimed)], state.claimed


@njit(cache=True, nogil=True, error_model="numpy")
def horizon_loop(tuning, state, u, y, valid, estimates):  # noqa: PLR0917
    """Take N samples, as `flexaxis.estimators.recursion.kernel.rpem_loop`."""
    terms, setting = tuning
    p = len(setting.lower)
    for k in range(len(u)):
        if state.taken[0] == 0:
            state.D[:] = sample(terms, state.xi[:p].copy(), np.arange(p))
            _judge(state, y[k], valid[k])
        else:
            _predict(state)
            j = state.taken[1]
            state.u[j], state.y[j] = state.held[0], _judge(state, y[k], valid[k])
            state.present[j] = not np.isnan(state.y[j])
            state.taken[1] += 1
            if state.taken[0] % setting.every == 0:
                _solve(terms, setting, state)
        state.held[0] = u[k]
        state.taken[0] += 1
        for i in range(p):
            estimates[k, i] = state.xi[i]


@_inlined
def _predict(state):
    """Take the prediction one sample on, under the torque that was held."""
    x, Z = np.zeros(len(state.x)), np.zeros(state.Z.shape)
    _forward(state.D, state.x, state.Z, x, Z, state.held[0])
    state.x[:], state.Z[:] = x, Z


@_inlined
def _judge(state, y, valid):
    """Keep the innovation and its variance; return y as it is to be used, or NaN if it is not."""
    m, last = len(state.xi), len(state.x) - 1
    spread = 0.0
    for i in range(m):
        total = 0.0
        for j in range(m):
            total += state.half[i, j] * state.Z[last, j]
        spread += total**2
    known = state.level[0] > 0.0
    variance = state.level[0] * (1.0 + spread)
    state.shown[0], state.shown[1] = state.x[last], np.nan
    state.shown[2] = variance if known else np.nan
    if not valid:
        return np.nan
    e = state.shown[1] = y - state.x[last]
    limit, alone = ODD * np.sqrt(variance), state.level[1] == 0.0
    state.level[1] = 1.0 if known and abs(e) > limit else 0.0
    if state.level[1] == 0.0:
        return y
    if alone:
        return np.nan
    return state.x[last] + (limit if e > 0.0 else -limit)


@_inlined
def _solve(terms, setting, state):
    """Minimise over the window from where ξ is, and move it on if it is full."""
    p, length = len(setting.lower), state.taken[1]
    before = state.xi.copy()
    for _ in range(setting.iterations):
        before[:] = state.xi
        H, g = _run(setting, state, length)
        _publish(setting, state, _minimum(state, H, g))
        state.D[:] = sample(terms, state.xi[:p].copy(), np.arange(p))
    end, slopes = state.x.copy(), state.Z.copy()
    for i in range(len(end)):  # from where it was linearised to ξ̂
        for j in range(len(before)):
            end[i] += slopes[i, j] * (state.xi[j] - before[j])
    if length == len(state.u):
        H, g = _run(setting, state, setting.every)
        _move(setting, state, _minimum(state, H, g))
    state.x[:], state.Z[:] = end, slopes


@_inlined
def _publish(setting, state, half):
    """Take ξ̂, with θ̂ in the box, and its covariance."""
    p, m = len(setting.lower), len(state.xi)
    state.half[:] = half[:, :m]
    for i in range(m):
        state.xi[i] = half[i, m]
        if i < p:
            if state.xi[i] < setting.lower[i]:  # not min and max, which would hide a NaN
                state.xi[i] = setting.lower[i]
            elif state.xi[i] > setting.upper[i]:
                state.xi[i] = setting.upper[i]
    reach = state.taken[1] * (1.0 - setting.forgetting)
    share = state.level[0] * (reach + 0.5) / (reach + 1.0)
    for i in range(p):
        for j in range(p):
            state.claimed[i, j] = 0.0
            for k in range(m):
                state.claimed[i, j] += share * half[k, i] * half[k, j]


@_inlined
def _run(setting, state, stop):
    """
    Predict the first samples of the window from ξ̂ into x and Z, and learn R̂ from a whole one.

    Returns
    -------
    H : (m, m) array
        Σ φφᵀ, φ = ∂ŷ/∂ξ.
    g : (m,) array
        Σ φ (y − ŷ).
    """
    p, m = len(setting.lower), len(state.xi)
    n, D, H, g = m - p, state.D, np.zeros((m, m)), np.zeros(m)
    x, Z = np.zeros(n + 1), np.zeros((n + 1, m))
    x_next, Z_next = np.zeros(n + 1), np.zeros((n + 1, m))
    square, count = 0.0, 0
    for i in range(n):
        x[i] = state.xi[p + i]
        Z[i, p + i] = 1.0
    for k in range(stop):
        _forward(D, x, Z, x_next, Z_next, state.u[k])
        x, x_next = x_next, x
        Z, Z_next = Z_next, Z
        if state.present[k]:
            residual = state.y[k] - x[n]
            if x[n] ** 2 > MOVING**2 * state.level[0]:
                square += residual**2 + (FINEST * x[n]) ** 2
                count += 1
            for i in range(m):
                g[i] += Z[n, i] * residual
                for j in range(m):
                    H[i, j] += Z[n, i] * Z[n, j]
    enough = count >= KNOWN or (count > 0 and state.taken[0] < len(state.u))
    if enough and stop == state.taken[1] and not setting.known:
        state.level[0] = square / count
    state.x[:], state.Z[:] = x, Z
    return H, g


@_inlined
def _forward(D, x, Z, x_next, Z_next, u):  # noqa: PLR0917
    """Take state, output (n+1,) and their sensitivities by ξ (n+1, m) over one sample."""
    p, n, m = len(D) - 1, len(x) - 1, Z.shape[1]
    x[n] = u
    for i in range(n + 1):
        x_next[i] = 0.0
        for a in range(m):
            Z_next[i, a] = 0.0
        for j in range(n + 1):
            x_next[i] += D[0, i, j] * x[j]
            for a in range(p):
                Z_next[i, a] += D[1 + a, i, j] * x[j]
            if j < n:
                for a in range(m):
                    Z_next[i, a] += D[0, i, j] * Z[j, a]


@_inlined
def _minimum(state, H, g):
    """
    Return half = [C⁻¹S ξ] (m, m+1): a root of the covariance after the data, and the minimum.

    The sum of squares is taken as linear in ξ. With ξ = ξ̄ + Sᵀz the arrival cost is |z|², so that
    P̄ needs no inverse: A z = S (g + H (ξ̂ − ξ̄)), A = I + S H Sᵀ = C Cᵀ.
    """
    S, m = state.root, len(g)
    A, half, HS = np.zeros((m, m)), np.zeros((m, m + 1)), np.zeros((m, m))
    for i in range(m):
        total = g[i]
        for j in range(m):
            total += H[i, j] * (state.xi[j] - state.mean[j])
            for k in range(m):
                HS[i, j] += H[i, k] * S[j, k]
        for j in range(m):
            half[j, m] += S[j, i] * total
    for i in range(m):
        A[i, i] = 1.0
        for j in range(m):
            half[i, j] = S[i, j]
            for k in range(m):
                A[i, j] += S[i, k] * HS[k, j]
    cholesky(A)
    forward(A, half)
    xi = state.mean.copy()
    for i in range(m):  # Sᵀz = (C⁻¹S)ᵀ C⁻¹(…)
        for k in range(m):
            xi[i] += half[k, i] * half[k, m]
    half[:, m] = xi
    return half


@_inlined
def _move(setting, state, half):
    """Drop the oldest samples from the window, and take ξ̄ and S through them, to x and Z."""
    p, m, every, x, Z = len(setting.lower), len(state.xi), setting.every, state.x, state.Z
    growth = 1.0  # nothing is forgotten before anything is seen
    if state.level[0] > 0.0:
        growth = setting.forgetting ** (-0.5 * every)
    array = np.zeros((m, m))
    for i in range(m):  # F = [I 0; Z] takes a deviation through the samples
        state.mean[i] = half[i, m] if i < p else x[i - p]
        for j in range(m):
            if i < p:
                array[j, i] = growth * half[j, i]
            else:
                state.mean[i] += Z[i - p, j] * (half[j, m] - state.xi[j])
                for k in range(m):
                    array[j, i] += growth * half[j, k] * Z[i - p, k]
    triangularize(array, m, m)
    for i in range(m):
        if i >= p:
            state.xi[i] = x[i - p]
        for j in range(m):
            state.root[i, j] = array[i, j] if j >= i else 0.0
    if state.level[0] > 0.0:
        bound_root(state.root, setting.ceiling / state.level[0])
    state.taken[1] -= every
    for k in range(state.taken[1]):
        state.u[k], state.y[k] = state.u[k + every], state.y[k + every]
        state.present[k] = state.present[k + every]
