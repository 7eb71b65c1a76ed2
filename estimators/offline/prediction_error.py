"""
Fit all that a record leaves open to it, in noise of any colour: the prediction-error method.

Disturbances of a real axis are not white: they are strongest where it resonates, and plain output
error then fits those frequencies at the cost of all others. So the residual is modelled as an
autoregression, residual and gradient are filtered by its inverse, and the fit is repeated until it
stays, in the way of D. W. Clarke, *Generalized least squares estimation of the parameters of a
dynamic model* (IFAC 1967). As the residual is filtered and not the signals, the axis may have
nonlinear laws.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.linalg.lapack import dpocon

from flexaxis.estimators.offline.colour import HIGHEST_ORDER, Colour, colourless, noise_model
from flexaxis.estimators.offline.trajectory import Trajectory

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FASTEST = 4 * np.pi  # radians a sample: a log cannot show an axis with such a pole
ROUNDS = 40  # where noise and parameters explain the same, each leaves two thirds of the way
EVALUATIONS, SEARCHING = 25, 12  # in a round of a fit, and of a search
CONVERGED, SEARCHED = 0.05, 0.5  # standard deviations to the minimum, where they end
TURNS = 1.0  # likewise, of a last round: colours of the noise may take turns
ROUGH = 5.0  # likewise, where friction is at a kink and no step gains
CAREFUL, BOLD = 1e-3, 1e-8  # damping of the first step: far from the minimum, and near it
STIFFEST = 1e3  # damping of steps so short that, where none gains, there is a minimum
FULFILLED, BROKEN = 0.75, 0.25  # shares of the fall that was promised
FORGOTTEN = 1e-2  # of what a stretch tells of its state, that counts
EXACT = 1e-10  # of a parameter, to which arithmetic is exact
ROUNDING = 1e-12  # of the greatest eigenvalue of a curvature
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
    colour : Colour
        Of the noise.
    converged : bool
    """

    problem: "Problem"
    z: Array
    residual: Array
    slopes: Array
    colour: Colour
    converged: bool = False

    @cached_property
    def good(self) -> Flags:
        """Samples (N,) that count."""
        return self.colour.settled(self.problem.ok)

    @cached_property
    def white(self) -> Array:
        """The white residual (N,)."""
        return self.colour.white(self.colour.bridged(self.residual, self.problem.ok))

    @cached_property
    def gradient(self) -> Array:
        """Derivatives (q, N) filtered likewise; 0 by a state that is forgotten where it counts."""
        J = self.colour.white(self.colour.bridged(self.slopes, self.problem.ok)) * self.good
        size, seen = (np.linalg.norm(rows, axis=1) for rows in (self.slopes, J))
        states = slice(self.problem.trajectory.first, -2)
        J[states][seen[states] < FORGOTTEN * size[states]] = 0.0
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
        """σ² (J Jᵀ)⁻¹, zero for what is held."""
        H, _ = self.curvature
        free, size = np.diag(H) > 0, np.sqrt(np.maximum(np.diag(H), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh((H / np.outer(size, size))[np.ix_(free, free)])
        values = np.maximum(values, ROUNDING * values.max(initial=0.0))
        covariance = np.zeros_like(H)
        covariance[np.ix_(free, free)] = vectors / values @ vectors.T
        return covariance * self.square / self.good.sum() / np.outer(size, size)

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
            step[free] = damped_step(H[np.ix_(free, free)], g[free], damping)
            out = free & (((self.z <= lower) & (step < 0)) | ((self.z >= upper) & (step > 0)))
            if not out.any():
                break
            free &= ~out
        return step

    @property
    def left(self) -> float:
        """
        How far it is to the minimum, in standard deviations.

        (N gᵀH⁻¹g/σ²)^½ is what a step of Gauss and Newton moves all unknowns together, whatever
        their units; none of them moves by more of its own deviation.
        """
        step, p = self.step(), self.problem.trajectory.p
        free = not self.problem.held[:p].all()
        if free and (abs(step[:p]) <= EXACT * abs(self.z[:p])).all():
            return 0.0  # no arithmetic comes nearer
        gain = float(self.curvature[1] @ step)
        return float(np.sqrt(max(gain, 0.0) * self.good.sum() / self.square))

    def gained(self, before: "Fitted") -> float:
        """Return the fall of −2 log L since a place, as the standard deviations it is worth."""
        fall = max(before.square / self.square - 1, 0.0) * self.good.sum()
        return float(np.sqrt(fall)) if np.isfinite(before.square) else np.inf


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
    whiten : bool
        Whether to model the noise; without, this is plain output error.
    highpass : float or None
        Corner [Hz] below which residuals do not count.
    """

    trajectory: Trajectory
    y: Array
    ok: Flags
    lower: Array
    upper: Array
    held: Flags
    whiten: bool = True
    highpass: float | None = None

    @property
    def plain(self) -> Colour:
        """The colour of white noise."""
        return colourless(self.highpass, self.trajectory.period)

    def colour(self, residual: Array) -> Colour:
        """Return the colour of a residual."""
        plain = self.plain
        if not self.whiten:
            return plain
        high, ok = plain.high(plain.bridged(residual, self.ok)), plain.settled(self.ok)
        highest = HIGHEST_ORDER  # of which no more than half of the samples see a gap
        while highest and np.mean(Colour(np.ones(highest + 1)).settled(ok)[ok]) < 0.5:
            highest //= 2
        return replace(plain, inverse=noise_model(high, highest, ok))

    def at(self, z: Array, colour: Colour | None = None) -> Fitted:
        """Return a place; its square is infinite where the axis cannot be simulated."""
        z, colour = np.clip(z, self.lower, self.upper), colour or self.plain
        if self.trajectory.fastest(z[: self.trajectory.p]) > FASTEST:
            N = len(self.y)
            return Fitted(self, z, np.full(N, np.inf), np.zeros((len(z), N)), colour)
        with np.errstate(all="ignore"):
            y, slopes = self.trajectory.along(z, self.held)
        return Fitted(self, z, self.y - y, slopes, colour)

    def descend(
        self, at: Fitted, most: int, near: float = CONVERGED, damping: float = CAREFUL
    ) -> tuple[Fitted, bool]:
        """
        Return where Levenberg and Marquardt's method comes to from a place, and if it converged.

        It has where the minimum is as near as that, in standard deviations, or steps gain
        no more than such a step would.
        """
        for _ in range(most):
            if not np.isfinite(at.square):
                break
            if at.left <= near:
                return at, True
            trial = self.at(at.z + at.step(damping), at.colour)
            if trial.square < at.square:
                step, (H, g) = trial.z - at.z, at.curvature
                share = (at.square - trial.square) / (2 * g @ step - step @ H @ step)
                # where less comes of a step than was promised the next is to be shorter
                damping *= 0.1 if share > FULFILLED else 3.0 if share < BROKEN else 1.0
                done, at, damping = trial.gained(at) <= near, trial, max(damping, BOLD)
                if done:
                    return at, True
            elif damping > STIFFEST:
                return at, at.left <= ROUGH
            else:
                damping = max(10 * damping, 1e-4)
        return at, False


def fit(
    problem: Problem, z: Array, *, rounds: int = ROUNDS, search: bool = False, plain: bool = False
) -> Fitted:
    """
    Fit parameters and noise in turn, until both stay, or only colours of the noise take turns.

    Parameters
    ----------
    problem : Problem
    z : (q,) array
        Where to start.
    rounds : int
        At most.
    search : bool
        Whether being near is enough.
    plain : bool
        Whether the first round takes noise for white. A rich model of the noise explains some of
        what parameters should, and gives it back slowly; but where an axis drifts, that is what
        parameters would explain.
    """
    most, near = (SEARCHING, SEARCHED) if search else (EVALUATIONS, CONVERGED)
    at, damping, ended = problem.at(z), CAREFUL, False
    if plain:
        at, _ = problem.descend(at, most, SEARCHED)
    for left in reversed(range(rounds)):
        if not np.isfinite(at.square):
            break  # it cannot be simulated, and has no residual that could be coloured
        before = replace(at, colour=problem.colour(at.residual))
        at, ended = problem.descend(before, most, near / 2, damping)
        ended = ended and at.gained(before) <= (near if left else TURNS)
        if ended:
            break
        damping = BOLD
    return replace(at, converged=ended)


def damped_step(H: Array, g: Array, damping: float) -> Array:
    """Return (H + damping·diag H)⁻¹ g, where what nothing is seen of stays; free of units."""
    seen, step = np.diag(H) != 0, np.zeros(len(g))
    size = np.sqrt(np.diag(H)[seen])
    scaled = H[np.ix_(seen, seen)] / np.outer(size, size) + damping * np.eye(len(size))
    step[seen] = _solved(scaled, g[seen] / size) / size
    return step


def _solved(H: Array, g: Array) -> Array:
    """Return H⁻¹ g by Cholesky's method; of an H that is almost singular, the shortest solution.

    Many gaps make many unknowns, for which a singular value decomposition takes seconds.
    """
    with suppress(LinAlgError):
        factor = cho_factor(H, lower=True)
        share, _ = dpocon(factor[0], np.abs(H).sum(axis=0).max(initial=0.0), uplo="L")
        if share > ROUNDING:
            return cho_solve(factor, g)
    return np.asarray(np.linalg.lstsq(H, g, rcond=ROUNDING)[0], float)


def pieces(ok: Flags) -> NDArray[np.int64]:
    """Return the number of the piece (N,) that each sample is in; all have as many usable ones."""
    count = np.cumsum(ok)
    return np.minimum(count * PIECES // max(int(count[-1]), 1), PIECES - 1)


def jackknife(J: Array, e: Array, good: Flags) -> tuple[Array, Array]:
    """
    Return the regression (q,) of e (N,) on rows of J (q, N), and its deviation from pieces.

    B. Efron and C. Stein, *The jackknife estimate of variance*, Ann. Statist. 9, 1981: each of the
    estimates without a piece of the record is one step of Gauss and Newton from that with all.
    Where white noise is all that there is, it is what a covariance says; what the model leaves out
    comes on top.
    """
    number = np.where(good, pieces(good), PIECES)
    parts = [J[:, number == i] for i in range(PIECES)]
    H = np.array([rows @ rows.T for rows in parts])
    g = np.array([rows @ e[number == i] for i, rows in enumerate(parts)])
    left = [damped_step(H.sum(axis=0) - H[i], g.sum(axis=0) - g[i], 0.0) for i in range(PIECES)]
    off = np.array(left) - np.mean(left, axis=0)
    whole = damped_step(H.sum(axis=0), g.sum(axis=0), 0.0)
    return whole, np.sqrt((PIECES - 1) / PIECES * np.sum(off**2, axis=0))
