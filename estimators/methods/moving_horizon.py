"""Moving horizon: nonlinear least squares over a window that moves along, with an arrival cost."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.covariance import padded
from flexaxis.estimators.filters.design import Design, above_zero, make_design
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.horizon import Series, Setting, Window
from flexaxis.estimators.filters.joint import state_covariance
from flexaxis.estimators.filters.loop import Record, on_lanes
from flexaxis.estimators.filters.square_root import triangular_root
from flexaxis.estimators.filters.window import horizon_loop
from flexaxis.estimators.models.discretisation import plan, split
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.problem import Problem

Array = NDArray[np.float64]


def moving_horizon(
    model: Model,
    *,
    identify: Sequence[str] | None = None,
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
        bounds=bounds,
        output=output,
        noise=noise,
        x0=x0,
    )
    _check_window(window, every, iterations)
    pattern, _ = split(design.model)
    box = design.lower, design.upper
    lanes, room = on_lanes(design, pattern, series=(1, *plan(design.model, *box, period)))
    setting = Setting(
        design.forgetting,
        int(every),
        int(iterations),
        design.noise > 0,
        design.lower,
        design.upper,
        design.theta0**2,
    )
    series = Series(
        lanes["coefficients"][0],
        lanes["weights"][0],
        int(lanes["order"][0]),
        int(lanes["substeps"][0]),
    )
    start = _start(design, room, int(window), state_covariance(design, x0_covariance))
    return CompiledFilter(horizon_loop(pattern), (series, setting), start, design, _read)


def _check_window(window: float, every: float, iterations: float) -> None:
    whole = all(np.isfinite(n) and n == int(n) for n in (window, every, iterations))
    if not (whole and every >= 1 and iterations >= 1 and window > every and window % every == 0):
        raise EstimatorError(
            f"window is {window}, every {every}, iterations {iterations}; the window is a multiple "
            "of every in whole samples, such as 200 and 10, and there is one iteration at least"
        )


def _start(design: Design, room: Record, window: int, covariance: Array) -> Window:
    p, n, x = len(design.theta0), design.model.n, design.x0
    m = p + n
    root = np.zeros((p + n, p + n))
    root[:p, :p] = np.linalg.cholesky(design.P0).T
    root[p:, p:] = triangular_root(covariance)
    xi = np.concatenate([design.theta0, x])
    blocks = design.model.blocks(design.theta0)
    X = np.eye(n + 1, padded(1 + m), 1 + p)
    X[:n, 0], X[n] = x, 0.0
    X[n, : 1 + p], X[n, 1 + p : 1 + m] = blocks[:, n, :n] @ x, blocks[0, n, :n]
    return Window(
        u=np.zeros(window),
        y=np.zeros(window),
        present=np.zeros(window, bool),
        mean=xi,
        root=root,
        xi=xi.copy(),
        claimed=design.P0.copy(),
        half=root.copy(),
        D=np.zeros((n + 1, n + 1, padded(1 + p))),
        X=X,
        theta=design.theta0.copy(),
        M=room["M"][0].copy(),
        unit=np.zeros(room["X"][0].shape),
        H=np.zeros((m, padded(m))),
        g=np.zeros(padded(m)),
        taken=np.zeros(2, np.int64),
        held=np.zeros(1),
        level=np.array([design.noise**2, 0.0]),
        shown=np.full(3, np.nan),
    )


def _read(state: Window) -> tuple[Array, Array]:
    return state.xi[: len(state.claimed)], state.claimed


def _horizon(
    problem: Problem,
    *,
    forgetting: float | None = None,
    window: float = 1.0,
    every: float = 0.05,
) -> CompiledFilter:
    """
    Make the least-squares fit over a moving window.

    Parameters
    ----------
    forgetting : float
        λ, of what lies before the window.
    window, every : float
        Length of a window, and from one to the next, of which it is a multiple [s].
    """
    forgetting = problem.factor("moving-horizon", forgetting)
    samples = round(
        above_zero("every", every, "the time between windows, in seconds") / problem.period
    )
    if samples < 1:
        raise EstimatorError(
            f"every is {every}, less than a sample of {problem.period} s; give more"
        )
    return moving_horizon(
        problem.model,
        **problem.asked,
        P0=problem.forgetting_P(forgetting),
        forgetting=forgetting,
        window=samples * _multiple(window, every),
        every=samples,
    )


def _multiple(window: float, every: float) -> int:
    """Return how often ``every`` goes into ``window``, twice at least."""
    ratio = above_zero("window", window, "the length of a window, in seconds") / every
    if ratio < 1.5 or abs(ratio - round(ratio)) > 1e-6:
        raise EstimatorError(
            f"window is {window} and every {every}; the window is a multiple of every, both in "
            "seconds, such as 1.0 and 0.05"
        )
    return round(ratio)


ENTRIES = (
    Entry(
        "moving-horizon",
        "nonlinear least squares over a moving window, with an arrival cost",
        _horizon,
        knob="1-forgetting",
        default=0.995,
        rank=10,
    ),
)
