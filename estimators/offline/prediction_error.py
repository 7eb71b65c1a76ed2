"""
Fit all that a record leaves open, in noise of any colour: the prediction-error method.

Disturbances of a real axis are not white: they are strongest where it resonates, and plain output
error then fits those frequencies at the cost of all others. So the residual is modelled as an
autoregression, residual and gradient are filtered by its inverse, and the fit is repeated until it
stays: D. W. Clarke, *Generalized least squares estimation of the parameters of a dynamic model*
(IFAC 1967). As the residual is filtered and not the signals, the axis may have nonlinear laws.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from flexaxis.estimators.offline.trajectory import Trajectory

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HIGHEST_ORDER = 60  # of the model of the noise
FASTEST = 4 * np.pi  # radians a sample: a log cannot show an axis with such a pole
ROUNDS, EVALUATIONS = 40, 25  # where noise and parameters explain the same, a round leaves 2/3
CONVERGED = 0.05  # standard deviations to the minimum, where a fit ends
TURNS = 1.0  # likewise, of a last round: noise models may alternate
ROUGH = 5.0  # likewise, where friction is at a kink and no step gains
CAREFUL, BOLD, STIFFEST = 1e-3, 1e-8, 1e3  # damping: of the first step, least, and greatest
FORGOTTEN = 1e-2  # share of its effect below which a state counts as forgotten
EXACT = 1e-10  # relative step below which arithmetic comes no nearer
ROUNDING = 1e-12  # relative to the diagonal of a curvature
PIECES = 10  # of a record, over which estimates spread


@dataclass(frozen=True)
class Fitted:
    """
    A place on the way of a fit, or its end.

    Attributes
    ----------
    problem : Problem
    z : (q,) array
    residual, slopes : (N,), (q, N) arrays
        y − ŷ and the derivatives of ŷ, as simulated.
    inverse : (n+1,) array
        1, a₁, …, a_n of the autoregression of the noise: the filter that makes residuals white.
    converged : bool
    """

    problem: "Problem"
    z: Array
    residual: Array
    slopes: Array
    inverse: Array
    converged: bool = False

    @cached_property
    def good(self) -> Flags:
        """Samples (N,) that count."""
        return settled(self.problem.ok, len(self.inverse))

    @cached_property
    def white(self) -> Array:
        """The white residual (N,)."""
        return lfilter(self.inverse, 1.0, self.residual)

    @cached_property
    def gradient(self) -> Array:
        """Derivatives (q, N) filtered likewise; 0 by a state that is forgotten or sticks."""
        J = lfilter(self.inverse, 1.0, self.slopes, axis=1) * self.good
        size, seen = (np.linalg.norm(rows, axis=1) for rows in (self.slopes, J))
        states = slice(self.problem.trajectory.first, -2)
        J[states][seen[states] < FORGOTTEN * np.maximum(size[states], 1.0)] = 0.0
        return J

    @cached_property
    def square(self) -> float:
        """Mean square of the white residual: σ² of a prediction over one sample."""
        finite = np.isfinite(self.residual).all() and np.isfinite(self.slopes).all()
        return float(np.mean(self.white[self.good] ** 2)) if finite else np.inf

    @cached_property
    def curvature(self) -> tuple[Array, Array]:
        """Half the curvature (q, q) of the mean square, and its descent (q,)."""
        J, N = self.gradient, self.good.sum()
        return J @ J.T / N, J @ self.white / N

    @cached_property
    def covariance(self) -> Array:
        """σ² (J Jᵀ)⁻¹, zero for what is held; huge for what the record does not determine."""
        return inverse_of(self.curvature[0]) * self.square / self.good.sum()

    @property
    def deviations(self) -> Array:
        """Standard deviations (q,) of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    def step(self, damping: float = 0.0) -> Array:
        """Return the damped step (q,); what would leave the box stays at its side."""
        (H, g), lower, upper = self.curvature, self.problem.lower, self.problem.upper
        free, step = ~self.problem.held, np.zeros(len(self.z))
        for _ in range(len(self.z)):
            step = np.zeros(len(self.z))
            step[free] = inverse_of(H[np.ix_(free, free)], damping) @ g[free]
            out = free & (((self.z <= lower) & (step < 0)) | ((self.z >= upper) & (step > 0)))
            if not out.any():
                break
            free &= ~out
        return step

    @property
    def left(self) -> float:
        """
        Distance to the minimum in standard deviations, (N gᵀH⁻¹g/σ²)^½.

        It is how far a step of Gauss and Newton moves all unknowns together, whatever their units.
        """
        step, p = self.step(), self.problem.trajectory.p
        if step[:p].any() and (abs(step[:p]) <= EXACT * abs(self.z[:p])).all():
            return 0.0
        gain = float(self.curvature[1] @ step)
        return float(np.sqrt(max(gain, 0.0) * self.good.sum() / self.square))

    def gained(self, before: "Fitted") -> float:
        """Return the fall of −2 log L since a place, as the standard deviations it is worth."""
        return float(np.sqrt(max(before.square / self.square - 1, 0.0) * self.good.sum()))


@dataclass(frozen=True)
class Problem:
    """
    A trajectory to be fitted to a record.

    Attributes
    ----------
    trajectory : Trajectory
    y : (N,) array
        Measured output.
    ok : (N,) array of bool
        Samples to be fitted.
    lower, upper : (q,) arrays
        The box.
    held : (q,) array of bool
        Unknowns that are known after all, such as a delay.
    """

    trajectory: Trajectory
    y: Array
    ok: Flags
    lower: Array
    upper: Array
    held: Flags

    def noise(self, residual: Array) -> Array:
        """Return the filter that makes a residual white."""
        highest = HIGHEST_ORDER
        # half of the samples must see no gap
        while highest and np.mean(settled(self.ok, highest + 1)[self.ok]) < 0.5:
            highest //= 2
        return noise_model(residual, highest, self.ok)

    def at(self, z: Array, inverse: Array) -> Fitted:
        """Return a place; its square is infinite where the axis cannot be simulated."""
        z = np.clip(z, self.lower, self.upper)
        if self.trajectory.fastest(z[: self.trajectory.p]) > FASTEST:
            N = len(self.y)
            return Fitted(self, z, np.full(N, np.inf), np.zeros((len(z), N)), inverse)
        with np.errstate(all="ignore"):
            y, slopes = self.trajectory.along(z, self.held)
        return Fitted(self, z, self.y - y, slopes, inverse)

    def descend(
        self, at: Fitted, most: int = EVALUATIONS, near: float = CONVERGED, damping: float = CAREFUL
    ) -> tuple[Fitted, bool]:
        """
        Return where Levenberg and Marquardt's method comes to from a place, and if it converged.

        It has where the minimum is as near as that, in standard deviations, or a step gains no
        more than such a step would.
        """
        for _ in range(most):
            if not np.isfinite(at.square):
                break
            if at.left <= near:
                return at, True
            trial = self.at(at.z + at.step(damping), at.inverse)
            if trial.square < at.square:
                done, at, damping = trial.gained(at) <= near, trial, max(0.1 * damping, BOLD)
                if done:
                    return at, True
            elif damping > STIFFEST:
                return at, at.left <= ROUGH
            else:
                damping = max(10 * damping, 1e-4)
        return at, False

    def fit(
        self, z: Array, *, rounds: int = 0, most: int = EVALUATIONS, near: float = CONVERGED
    ) -> Fitted:
        """
        Fit parameters in white noise, then noise and parameters in turn, until both stay.

        Parameters
        ----------
        z : (q,) array
            Where to start.
        rounds : int
            Of the noise, at most; 0 is plain output error.
        most : int
            Evaluations in each round, at most.
        near : float
            Standard deviations to the minimum, where it ends.
        """
        at, ended = self.descend(self.at(z, np.ones(1)), most, near)
        for left in reversed(range(rounds if np.isfinite(at.square) else 0)):
            before = replace(at, inverse=self.noise(at.residual))
            at, ended = self.descend(before, most, near / 2, BOLD)
            # a last round may end where noise models alternate
            ended = ended and at.gained(before) <= (near if left else TURNS)
            if ended:
                break
        return replace(at, converged=ended)


def settled(ok: Flags, length: int) -> Flags:
    """Return where a filter of some length has seen usable samples only."""
    return np.convolve(~ok, np.ones(length))[: len(ok)] < 0.5


def noise_model(residual: Array, highest: int, ok: Flags | None = None) -> Array:
    """
    Return the coefficients (n+1,) of an autoregression, 1, a₁, …, a_n, of the best order.

    The order is the one of the least Bayesian information criterion, N log σ² + n log N. Samples
    on either side of a gap are no neighbours: what is not ``ok`` adds nothing to the correlations,
    which stay those of a sequence.
    """
    used = np.ones(len(residual), bool) if ok is None else ok
    N = int(used.sum())
    e = np.where(used, residual - residual[used].mean(), 0.0)
    highest = min(highest, N // 20)
    r = np.array([e[: len(e) - k] @ e[k:] for k in range(highest + 1)]) / N
    models = [np.ones(1)]
    models += [np.r_[1.0, solve_toeplitz(r[:n], -r[1 : n + 1])] for n in range(1, highest + 1)]
    criterion = [N * np.log(a @ r[: len(a)]) + len(a) * np.log(N) for a in models]
    return models[int(np.argmin(criterion))]


def inverse_of(H: Array, damping: float = 0.0) -> Array:
    """Return (H + damping·diag H)⁻¹, free of units: 0 where H is, huge for what is not seen."""
    seen, inverse = np.diag(H) > 0, np.zeros_like(H)
    size = np.sqrt(np.outer(np.diag(H)[seen], np.diag(H)[seen]))
    scaled = H[np.ix_(seen, seen)] / size + (damping + ROUNDING) * np.eye(len(size))
    inverse[np.ix_(seen, seen)] = np.linalg.inv(scaled) / size
    return inverse


def pieces(ok: Flags) -> NDArray[np.int64]:
    """Return the number of the piece (N,) that each sample is in; all have as many usable ones."""
    count = np.cumsum(ok)
    return np.minimum(count * PIECES // max(int(count[-1]), 1), PIECES - 1)


def jackknife(J: Array, e: Array, good: Flags) -> Array:
    """
    Return the deviation (q,), from pieces, of the regression of e (N,) on rows of J (q, N).

    B. Efron and C. Stein, *The jackknife estimate of variance*, Ann. Statist. 9, 1981: each of the
    estimates without a piece of the record is one step of Gauss and Newton from that with all.
    For white noise it is what a covariance says; what the model leaves out comes on top.
    """
    number = np.where(good, pieces(good), PIECES)
    parts = [J[:, number == i] for i in range(PIECES)]
    H = np.array([rows @ rows.T for rows in parts])
    g = np.array([rows @ e[number == i] for i, rows in enumerate(parts)])
    left = [inverse_of(H.sum(axis=0) - H[i]) @ (g.sum(axis=0) - g[i]) for i in range(PIECES)]
    return np.sqrt(PIECES - 1) * np.std(left, axis=0)
