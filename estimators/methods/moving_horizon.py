"""Moving horizon: nonlinear least squares over a window that moves along, with an arrival cost."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.covariance import triangular_root
from flexaxis.estimators.filters.design import Design, above_zero
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.filters.noise import FINEST, KNOWN, MOVING, ODD
from flexaxis.estimators.models.sampled import along, move, prepare
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

Array = NDArray[np.float64]


class MovingHorizon(RecursiveEstimator):
    """
    A least-squares fit to the last samples that is done again and again.

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
    design : Design
        With λ, by which data count less for every sample that they lie before the window. P(0) and
        the covariance of x(0) are for a noise variance of one.
    window, every : int
        Samples in a window, N, and from one to the next, of which N is a multiple.
    iterations : int
        Steps of Gauss and Newton in each.

    Attributes
    ----------
    noise_variance : float
        R̂, 0 while it is not known.
    root : (m, m) array
        S, upper triangular, with P̄ = SᵀS, relative to θ(0).

    Raises
    ------
    EstimatorError
        If window, every or iterations cannot be used.
    """

    _shared = (*RecursiveEstimator._shared, "_design", "_length", "_every", "_iterations")

    def __init__(
        self, design: Design, *, window: int = 200, every: int = 10, iterations: int = 2
    ) -> None:
        whole = all(np.isfinite(n) and n == int(n) for n in (window, every, iterations))
        fits = whole and every >= 1 and iterations >= 1 and window > every and window % every == 0
        if not fits:
            raise EstimatorError(
                f"window is {window}, every {every}, iterations {iterations}; the window is a "
                "multiple of every in whole samples, such as 200 and 10, and there is one "
                "iteration at least"
            )
        self._length, self._every, self._iterations = int(window), int(every), int(iterations)
        super().__init__(design.names, design.output, design.bounds)
        self._design, self._ceiling = design, design.theta0**2
        self.reset()
        along(self._model, self._X.copy(), np.zeros(0))  # what has to be compiled is compiled now
        move(self._model.D, self._X.copy(), self._X.copy(), 0.0)

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._xi[: len(self.names)] * self._design.scale

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._claim * np.outer(self._design.scale, self._design.scale)

    def _start(self) -> None:
        design, p = self._design, len(self.names)
        self._xi = np.concatenate([design.theta0, design.x0])  # ξ̂ at the start of the window
        self._mean, m = self._xi, len(self._xi)
        self.root = np.zeros((m, m))
        self.root[:p, :p] = np.linalg.cholesky(design.P0).T
        self.root[p:, p:] = triangular_root(design.x0_covariance)
        self._half = self.root  # P^½, with the covariance PᵀP of ξ̂ after the data
        self._claim, self.noise_variance, self._odd = design.P0, design.noise**2, False
        self._window: list[tuple[float, float]] = []  # torque held before, and y or NaN
        self._held, self._taken = 0.0, 0
        self._X, blocks = self._begin(), design.model.blocks(design.theta0)
        self._X[:, -1] = self._X @ blocks[0, -1]  # the output, and its sensitivities
        self._X[1 : 1 + p, -1] = blocks[1:, -1] @ self._X[0]
        self._model = prepare(design.model, design.theta0, design.period, further=design.model.n)

    def _begin(self) -> Array:
        """Return the state where the window begins, and its sensitivities by ξ, a row each."""
        p, n = len(self.names), self._design.model.n
        X = np.zeros((1 + p + n, n + 1))
        X[0, :n], X[1 + p :, :n] = self._xi[p:], np.eye(n)
        return X

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        for k in range(len(u)):
            if self._taken:
                moved = np.empty_like(self._X)
                move(self._model.D, self._X, moved, self._held)
                self._X = moved
            used = self._judge(y[k], valid[k], trace[k])
            if self._taken:
                self._window.append((self._held, used))
                if self._taken % self._every == 0:
                    self._solve()
            self._held = u[k]
            self._taken += 1
            estimates[k] = self.theta

    def _judge(self, y: float, valid: bool, row: Array) -> float:
        """Write ŷ, innovation and its variance; return y as it is to be used, or NaN."""
        predicted, gradient = self._X[0, -1], self._X[1:, -1]
        known = self.noise_variance > 0
        variance = self.noise_variance * (1 + np.sum((self._half @ gradient) ** 2))
        row[:] = predicted, np.nan, variance if known and valid else np.nan
        if not valid:
            return np.nan
        e = row[1] = y - predicted
        limit, alone = ODD * np.sqrt(variance), not self._odd
        self._odd = bool(known and abs(e) > limit)
        if not self._odd:
            return y
        return np.nan if alone else predicted + np.copysign(limit, e)

    def _solve(self) -> None:
        """Minimise over the window from where ξ̂ is, and move it on if it is full."""
        p, design = len(self.names), self._design
        for _ in range(self._iterations):
            before = self._xi
            X, outputs, e, J = self._follow(len(self._window))
            self._learn(outputs, e)
            self._half, xi = self._minimum(e, J)
            self._xi = np.concatenate([np.clip(xi[:p], design.lower, design.upper), xi[p:]])
            self._model = prepare(design.model, self._xi[:p], design.period, further=design.model.n)
        reach = len(self._window) * (1 - design.forgetting)
        share = self.noise_variance * (reach + 0.5) / (reach + 1)
        self._claim = share * self._half[:, :p].T @ self._half[:, :p]
        X[0] += (self._xi - before) @ X[1:]  # from where it was linearised to ξ̂
        if len(self._window) == self._length:
            self._move_on()
        self._X = X

    def _follow(self, stop: int) -> tuple[Array, Array, Array, Array]:
        """
        Predict the first samples of the window from ξ̂.

        Returns state and sensitivities after them, and ŷ, residual and gradient of those used.
        """
        u, y = np.array(self._window[:stop]).T
        X = self._begin()
        rows = along(self._model, X, np.ascontiguousarray(u))
        used = ~np.isnan(y)
        rows = rows[used]
        return X, rows[:, 0], y[used] - rows[:, 0], rows[:, 1:]

    def _learn(self, outputs: Array, e: Array) -> None:
        """Learn R̂ from the window, at samples in which the axis moves."""
        moves = outputs**2 > MOVING**2 * self.noise_variance
        enough = moves.sum() >= KNOWN or (moves.any() and self._taken < self._length)
        if enough and self._design.noise == 0:
            self.noise_variance = float(np.mean((e**2 + (FINEST * outputs) ** 2)[moves]))

    def _minimum(self, e: Array, J: Array) -> tuple[Array, Array]:
        """
        Return a root of the covariance after the data, and the minimum ξ, as linearised at ξ̂.

        With ξ = ξ̄ + Sᵀz the arrival cost is |z|², so that P̄ needs no inverse.
        """
        R = np.linalg.qr(np.vstack([np.eye(len(self.root)), J @ self.root.T]))[1]
        half = np.linalg.solve(R.T, self.root)
        pull = J.T @ (e + J @ (self._xi - self._mean))
        return half, self._mean + half.T @ (half @ pull)

    def _move_on(self) -> None:
        """Drop the oldest samples from the window, and take ξ̄ and S through them."""
        p, every = len(self.names), self._every
        X, _, e, J = self._follow(every)
        half, xi = self._minimum(e, J)
        known = self.noise_variance > 0  # nothing is forgotten before anything is seen
        growth = self._design.forgetting ** (-0.5 * every) if known else 1.0
        F = np.vstack([np.eye(len(xi))[:p], X[1:, :-1].T])  # takes a deviation through the samples
        self._mean = np.concatenate([xi[:p], X[0, :-1] + (xi - self._xi) @ X[1:, :-1]])
        self._xi = np.concatenate([self._xi[:p], X[0, :-1]])
        self.root = np.linalg.qr(growth * half @ F.T)[1]
        variance = self.noise_variance * np.sum(self.root[:, :p] ** 2, axis=0)
        self.root[:, :p] /= np.sqrt(np.maximum(variance / self._ceiling, 1.0))
        del self._window[:every]


def _horizon(
    problem: Problem,
    *,
    forgetting: float | None = None,
    window: float = 1.0,
    every: float = 0.05,
) -> MovingHorizon:
    """
    Make the least-squares fit over a moving window.

    Parameters
    ----------
    forgetting : float
        λ, of what lies before the window.
    window, every : float
        Length of a window, and from one to the next, of which it is a multiple [s].
    """
    design = problem.forgetting_design("moving-horizon", forgetting)
    samples = round(
        above_zero("every", every, "the time between windows, in seconds") / problem.period
    )
    if samples < 1:
        raise EstimatorError(
            f"every is {every}, less than a sample of {problem.period} s; give more"
        )
    return MovingHorizon(design, window=samples * _multiple(window, every), every=samples)


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
