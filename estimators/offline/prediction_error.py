"""
The prediction-error method, which fits all unknowns to a record with coloured noise.

The disturbances of a real axis are not white noise. The disturbances are strongest at the
resonances of the axis, so a plain output-error fit favours the resonance frequencies at the expense
of all other frequencies. The prediction-error method therefore models the residual as an
autoregressive process. The inverse of the noise model filters the residual and the gradient, and
the fit is repeated until convergence. The iterative method comes from *Generalized least squares
estimation of the parameters of a dynamic model* (Clarke, 1967). The method filters the residual
instead of the signals, and therefore also applies to nonlinear models.
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

HIGHEST_ORDER = 60  # highest order of the noise model
FASTEST = 4 * np.pi  # radians per sample: a log cannot represent an axis with such a fast pole
ROUNDS, EVALUATIONS = (
    40,
    25,
)  # limits per fit and round; a round may reduce an error by only 1/3
CONVERGED = 0.05  # distance to the minimum at which a fit ends, in standard deviations
TURNS = 1.0  # the same distance for the last round, because noise models may alternate
ROUGH = 5.0  # the same distance if a kink of friction prevents any reduction of the misfit
SAME = 1e-5  # largest relative parameter change in a round that counts as no change
CAREFUL, BOLD, STIFFEST = 1e-3, 1e-8, 1e3  # damping of the first step, and its limits
FORGOTTEN = 1e-2  # fraction of the effect of an initial state below which it counts as forgotten
EXACT = 1e-10  # relative step size below which rounding prevents further progress
ROUNDING = 1e-12  # regularisation of a curvature, relative to its diagonal
PIECES = 10  # number of pieces of a record in the jackknife


@dataclass(frozen=True)
class Fitted:
    """
    The state of a fit to a record, during or after the iterations.

    Attributes
    ----------
    problem : Problem
        The fitting problem, with trajectory, record and bounds.
    z : (q,) array
        Current values of the unknowns.
    residual, slopes : (N,), (q, N) arrays
        Residual y − ŷ of the simulation, and the derivatives of ŷ with respect to z.
    inverse : (n+1,) array
        Coefficients 1, a₁, …, a_n of the autoregressive noise model. The coefficients form a filter
        that whitens the residual.
    converged : bool
        Whether the fit has converged.
    """

    problem: "Problem"
    z: Array
    residual: Array
    slopes: Array
    inverse: Array
    converged: bool = False

    @cached_property
    def good(self) -> Flags:
        """Mask that is True for the samples that the fit uses, as an array (N,)."""
        return settled(self.problem.ok, len(self.inverse))

    @cached_property
    def white(self) -> Array:
        """Residual after the whitening filter (N,)."""
        return lfilter(self.inverse, 1.0, self.residual)

    @cached_property
    def gradient(self) -> Array:
        """Whitened derivatives of ŷ (q, N); zero for initial states without a lasting effect."""
        J = lfilter(self.inverse, 1.0, self.slopes, axis=1) * self.good
        size, seen = (np.linalg.norm(rows, axis=1) for rows in (self.slopes, J))
        states = slice(self.problem.trajectory.first, -2)
        J[states][seen[states] < FORGOTTEN * np.maximum(size[states], 1.0)] = 0.0
        return J

    @cached_property
    def square(self) -> float:
        """Mean square of the whitened residual, which is the prediction error variance σ²."""
        finite = np.isfinite(self.residual).all() and np.isfinite(self.slopes).all()
        return float(np.mean(self.white[self.good] ** 2)) if finite else np.inf

    @cached_property
    def curvature(self) -> tuple[Array, Array]:
        """Half the Hessian (q, q) and half the negative gradient (q,) of the cost function."""
        J, N = self.gradient, self.good.sum()
        return J @ J.T / N, J @ self.white / N

    @cached_property
    def covariance(self) -> Array:
        """Covariance σ² (J Jᵀ)⁻¹ of the unknowns, with zeros for unknowns that are held fixed."""
        return inverse_of(self.curvature[0]) * self.square / self.good.sum()

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns (q,)."""
        return np.sqrt(np.diag(self.covariance))

    def step(self, damping: float = 0.0) -> Array:
        """Return the damped Levenberg–Marquardt step (q,), which does not violate the bounds."""
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
        Distance to the minimum in standard deviations of the unknowns, (N gᵀH⁻¹g/σ²)^½.

        The distance is the length of a Gauss–Newton step of all unknowns, and does not depend on
        units.
        """
        step, p = self.step(), self.problem.trajectory.p
        if step[:p].any() and (abs(step[:p]) <= EXACT * abs(self.z[:p])).all():
            return 0.0
        gain = float(self.curvature[1] @ step)
        return float(np.sqrt(max(gain, 0.0) * self.good.sum() / self.square))

    def gained(self, before: "Fitted") -> float:
        """Return the square root of the decrease in −2 log-likelihood since an earlier fit."""
        return float(np.sqrt(max(before.square / self.square - 1, 0.0) * self.good.sum()))


@dataclass(frozen=True)
class Problem:
    """
    A simulated trajectory, and the record to which the trajectory is fitted.

    Attributes
    ----------
    trajectory : Trajectory
        Simulated output as a function of the unknowns z.
    y : (N,) array
        Measured output of the record.
    ok : (N,) array of bool
        For each sample, whether the fit should use the sample.
    lower, upper : (q,) arrays
        Lower and upper bounds of z.
    held : (q,) array of bool
        Mask that is True for the unknowns in z that the fit holds constant, such as a known delay.
    """

    trajectory: Trajectory
    y: Array
    ok: Flags
    lower: Array
    upper: Array
    held: Flags

    def noise(self, residual: Array) -> Array:
        """Return the coefficients (n+1,) of a filter that whitens the given residual."""
        highest = HIGHEST_ORDER
        # the memory of the filter must not contain a gap for at least half of the samples
        while highest and np.mean(settled(self.ok, highest + 1)[self.ok]) < 0.5:
            highest //= 2
        return noise_model(residual, highest, self.ok)

    def at(self, z: Array, inverse: Array) -> Fitted:
        """Return the fit at the unknowns z; a failed simulation yields an infinite mean square."""
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
        Minimise the mean squared residual by the Levenberg–Marquardt method, and return the fit.

        The method also returns a flag, which is True if the search has converged. The search has
        converged if the distance to the minimum is at most ``near`` standard deviations. The search
        has also converged if a step decreases −2 log-likelihood by an amount whose square root is
        at most ``near``.
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
        Fit the unknowns as for white noise, then alternately fit the noise model and the unknowns.

        Parameters
        ----------
        z : (q,) array
            Initial values of the unknowns.
        rounds : int
            Largest number of noise model fits, or 0 for a plain output-error fit.
        most : int
            Largest number of model evaluations for each noise model.
        near : float
            Distance to the minimum at which the fit ends, in standard deviations of the unknowns.
        """
        at, ended = self.descend(self.at(z, np.ones(1)), most, near)
        for left in reversed(range(rounds if np.isfinite(at.square) else 0)):
            before = replace(at, inverse=self.noise(at.residual))
            at, ended = self.descend(before, most, near / 2, BOLD)
            # in the last round a larger change is accepted, because noise models may alternate
            p = self.trajectory.p
            same = np.allclose(at.z[:p], before.z[:p], rtol=SAME, atol=0)
            ended = ended and (same or at.gained(before) <= (near if left else TURNS))
            if ended:
                break
        return replace(at, converged=ended)


def settled(ok: Flags, length: int) -> Flags:
    """Return a mask (N,) of the samples at which all of the last ``length`` samples are usable."""
    return np.convolve(~ok, np.ones(length))[: len(ok)] < 0.5


def noise_model(residual: Array, highest: int, ok: Flags) -> Array:
    """
    Return the coefficients 1, a₁, …, a_n (n+1,) of an autoregressive model of the best order.

    The best order minimises the Bayesian information criterion N log σ² + n log N. Samples where
    ``ok`` is False are replaced by zero and contribute nothing to the correlations. The samples
    before and after a gap are therefore not treated as neighbours.
    """
    N = int(ok.sum())
    e = np.where(ok, residual - residual[ok].mean(), 0.0)
    highest = min(highest, N // 20)
    r = np.array([e[: len(e) - k] @ e[k:] for k in range(highest + 1)]) / N
    models = [np.ones(1)]
    models += [np.r_[1.0, solve_toeplitz(r[:n], -r[1 : n + 1])] for n in range(1, highest + 1)]
    criterion = [N * np.log(a @ r[: len(a)]) + len(a) * np.log(N) for a in models]
    return models[int(np.argmin(criterion))]


def inverse_of(H: Array, damping: float = 0.0) -> Array:
    """Return (H + damping·diag H)⁻¹, with zeros in rows and columns where diag H is zero."""
    size = np.sqrt(np.diag(H))
    units = np.outer(*2 * [np.where(size > 0, size, 1.0)])
    scaled = H / units + (damping + ROUNDING) * np.diag(size > 0)
    return np.linalg.pinv(scaled, 0.1 * ROUNDING, hermitian=True) / units


def pieces(ok: Flags, key: Array | None = None) -> NDArray[np.int64]:
    """
    Return each sample's segment number (N,); all segments contain equally many usable samples.

    The segments are intervals of time, or ranges of a signal ``key`` (N,), such as the speed.
    """
    order = np.arange(len(ok)) if key is None else np.argsort(key, kind="stable")
    count = np.empty(len(ok), int)
    count[order] = np.cumsum(ok[order])
    return np.minimum(count * PIECES // max(int(ok.sum()), 1), PIECES - 1)


def jackknife(J: Array, e: Array, good: Flags, key: Array | None = None) -> Array:
    """
    Return jackknife standard deviations of regression coefficients, as an array (q,).

    The regression represents the residuals e (N,) as a linear combination of the rows of J (q, N).
    The function `pieces` divides the record into segments, and the jackknife omits each segment
    once. One Gauss–Newton step from the estimate for the full record yields the estimate without
    one segment. For white noise, the jackknife standard deviations agree with those from the
    covariance matrix. Model errors increase the jackknife standard deviations. The method is
    described in *The jackknife estimate of variance* (Efron and Stein, 1981).
    """
    number = np.where(good, pieces(good, key), PIECES)
    parts = [J[:, number == i] for i in range(PIECES)]
    H = np.array([rows @ rows.T for rows in parts])
    g = np.array([rows @ e[number == i] for i, rows in enumerate(parts)])
    left = [inverse_of(H.sum(axis=0) - H[i]) @ (g.sum(axis=0) - g[i]) for i in range(PIECES)]
    return np.sqrt(PIECES - 1) * np.std(left, axis=0)
