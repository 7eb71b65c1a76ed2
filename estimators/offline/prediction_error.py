"""
Fit all that a record leaves open to it, in noise of any colour: the prediction-error method.

Disturbances of a real axis are not white: they are strongest where it resonates, and plain output
error then fits those frequencies at the cost of all others. So the residual is modelled as an
autoregression, residual and gradient are filtered by its inverse, and the fit is repeated until it
stays, in the way of D. W. Clarke, *Generalized least squares estimation of the parameters of a
dynamic model* (IFAC 1967). As the residual is filtered and not the signals, the axis may have
nonlinear laws.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import HIGHEST_ORDER, Colour, colourless, noise_model
from flexaxis.estimators.offline.trajectory import Course

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDS = 8
LAST = 2  # rounds that solve laws to their full accuracy, at least
EVALUATIONS = 8  # in a round
AT_FIRST = 12  # in a round with noise that is taken for white
FASTEST = 4 * np.pi  # radians a sample: an axis with such a pole is none that the log can show
CONVERGED = 0.2  # standard deviations: a step below that ends the rounds
UNSEEN = 1e200  # variance of what a record shows nothing of
GAINED = 1e-4  # of the sum of squares: a step of less ends a search


@dataclass(frozen=True)
class Point:
    """z (q,), mean square of the white residual there, half its curvature, and its descent."""

    z: Array
    square: float
    H: Array
    g: Array


@dataclass(frozen=True)
class Problem:
    """
    A course to be fitted to a record.

    Attributes
    ----------
    course : Course
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
    tell : callable
        Told now and then that a step was taken.
    """

    course: Course
    y: Array
    ok: Flags
    lower: Array
    upper: Array
    held: Flags
    whiten: bool = True
    highpass: float | None = None
    tell: Callable[[], None] = field(default=lambda: None)

    def residual(self, z: Array, *, coarse: bool = False) -> tuple[Array, Array]:
        """Return y − ŷ (N,) and the derivatives (q, N) of ŷ."""
        simulated, slopes = self.course.along(z, coarse=coarse)
        slopes[self.held] = 0.0
        return self.y - simulated, slopes

    def colour(self, residual: Array) -> Colour:
        """Return the colour of a residual."""
        plain = colourless(self.highpass, self.course.period)
        if not self.whiten:
            return plain
        high = plain.high(plain.bridged(residual, self.ok))
        return replace(plain, inverse=noise_model(high[plain.settled(self.ok)], HIGHEST_ORDER))

    def at(self, z: Array, colour: Colour, *, coarse: bool = False) -> Point:
        """Return what a step of Gauss and Newton needs at z."""
        nowhere = Point(z, np.inf, np.eye(len(z)), np.zeros(len(z)))
        if self.course.fastest(z[: self.course.p]) > FASTEST:
            return nowhere
        residual, slopes = self.residual(z, coarse=coarse)
        self.tell()
        if not np.isfinite(residual).all() or not np.isfinite(slopes).all():
            return nowhere
        good = colour.settled(self.ok)
        e = colour.white(colour.bridged(residual, self.ok))[good]
        J = colour.white(colour.bridged(slopes, self.ok))[:, good]
        return Point(z, float(e @ e) / len(e), J @ J.T / len(e), J @ e / len(e))

    def start(self, theta: Array, delay: float) -> Array:
        """Return z at parameters and a delay, the rest by a few linear steps at first."""
        z = np.r_[theta, np.zeros(self.course.q - len(theta) - 1), delay]
        rest = np.ones(self.course.q, bool)
        rest[len(theta) : -1] = False
        nuisance = replace(self, held=self.held | rest)
        plain = colourless(self.highpass, self.course.period)
        return nuisance.descend(nuisance.at(z, plain, coarse=True), plain, 4, coarse=True).z

    def descend(self, at: Point, colour: Colour, most: int, *, coarse: bool = False) -> Point:
        """Return where Levenberg and Marquardt's method comes to from a point within the box."""
        damping = 1e-3
        for _ in range(most):
            tried = self.at(self._next(at, damping), colour, coarse=coarse)
            gained = at.square - tried.square
            if gained > 0:
                at, damping = tried, max(damping / 10, 1e-9)
                if gained < GAINED * at.square / 10:
                    break
            else:
                damping = max(10 * damping, 1e-4)
                if damping > 1e4 or abs(gained) < 1e-9 * at.square:
                    break
        return at

    def _next(self, at: Point, damping: float) -> Array:
        """Return the next place to try; what would leave the box stays at its side."""
        free = ~self.held
        for _ in range(len(at.z)):
            step = np.zeros(len(at.z))
            step[free] = damped_step(at.H[np.ix_(free, free)], at.g[free], damping)
            out = free & (((at.z <= self.lower) & (step < 0)) | ((at.z >= self.upper) & (step > 0)))
            if not out.any():
                break
            free &= ~out
        return np.clip(at.z + step, self.lower, self.upper)


def damped_step(H: Array, g: Array, damping: float) -> Array:
    """Return (H + damping·diag H)⁻¹ g, where what nothing is seen of stays; free of units."""
    size = np.sqrt(np.maximum(np.diag(H), np.finfo(float).tiny))
    scaled = H / np.outer(size, size) + damping * np.eye(len(g))
    return np.linalg.lstsq(scaled, g / size, rcond=1e-12)[0] / size


@dataclass(frozen=True)
class Fitted:
    """
    What came of a fit.

    Attributes
    ----------
    z : (q,) array
    covariance : (q, q) array
        For white residuals.
    colour : Colour
    square : float
        Mean square of the white residual: σ² of a prediction over one sample.
    residual : (N,) array
        y − ŷ of the simulation.
    white : (N,) array
        Filtered by the colour.
    slopes : (q, N) array
        Derivatives of ŷ, filtered likewise.
    good : (N,) array of bool
        Which of these count.
    converged : bool
    """

    z: Array
    covariance: Array
    colour: Colour
    square: float
    residual: Array
    white: Array
    slopes: Array
    good: Flags
    converged: bool

    @property
    def deviations(self) -> Array:
        """Standard deviations (q,) of the unknowns."""
        return np.sqrt(np.diag(self.covariance))


def fit(
    problem: Problem,
    z: Array,
    *,
    rounds: int = ROUNDS,
    fine: bool = True,
    plain: bool = False,
) -> Fitted:
    """
    Fit parameters and noise in turn.

    Parameters
    ----------
    problem : Problem
    z : (q,) array
        Where to start.
    rounds : int
        At most.
    fine : bool
        Whether the last rounds solve laws to their full accuracy.
    plain : bool
        Whether the first round takes noise for white. A rich model of the noise explains some of
        what parameters should, and gives it back slowly; but where an axis drifts, that is what
        parameters would explain.
    """
    lawful, converged = problem.course.model.laws is not None, False
    coarse = lawful
    if plain:
        colour = colourless(problem.highpass, problem.course.period)
        z = problem.descend(problem.at(z, colour, coarse=coarse), colour, AT_FIRST, coarse=coarse).z
    colour = problem.colour(problem.residual(z, coarse=coarse)[0])
    for left in reversed(range(rounds)):
        before, coarse = z, coarse and not (fine and (converged or left < LAST))
        point = problem.at(z, colour, coarse=coarse)
        point = problem.descend(point, colour, EVALUATIONS, coarse=coarse)
        z = point.z
        covariance = _covariance(point, problem, int(colour.settled(problem.ok).sum()))
        deviations = np.sqrt(np.diag(covariance))
        moved = abs(z - before)[: problem.course.p]
        converged = bool(np.all(moved <= CONVERGED * deviations[: problem.course.p]))
        if converged and not (coarse and fine):
            break
        colour = problem.colour(problem.residual(z, coarse=coarse)[0])
    return finished(problem, z, colour, converged)


def finished(problem: Problem, z: Array, colour: Colour, converged: bool = True) -> Fitted:
    """Return what there is to know of a fit at z."""
    residual, slopes = problem.residual(z)
    white = colour.white(colour.bridged(residual, problem.ok))
    slopes = colour.white(colour.bridged(slopes, problem.ok))
    good = colour.settled(problem.ok)
    e, J = white[good], slopes[:, good]
    point = Point(z, float(e @ e) / len(e), J @ J.T / len(e), J @ e / len(e))
    covariance = _covariance(point, problem, len(e))
    return Fitted(z, covariance, colour, point.square, residual, white, slopes, good, converged)


def discretisation(problem: Problem, fitted: Fitted) -> Array:
    """
    Return by how much unknowns (q,) depend on the steps that laws are solved in; zero without laws.

    One step of Gauss and Newton from the fit with fine steps to that with coarse ones, which are
    twice as long: as the error where friction reverses is of the first order, that is about what
    fine steps are off themselves (L. F. Richardson, 1911).
    """
    step = np.zeros_like(fitted.z)
    if problem.course.model.laws is None:
        return step
    coarse = fitted.colour.bridged(problem.residual(fitted.z, coarse=True)[0], problem.ok)
    e = (fitted.colour.white(coarse) - fitted.white)[fitted.good]
    free = np.diag(fitted.covariance) > 0
    J = fitted.slopes[:, fitted.good][free]
    step[free] = damped_step(J @ J.T, J @ e, 0.0)
    return abs(step)


def _covariance(point: Point, problem: Problem, samples: int) -> Array:
    """Return σ² (J Jᵀ)⁻¹, zero for what is held."""
    free, covariance = ~problem.held, np.zeros_like(point.H)
    if not free.any():
        return covariance
    H = point.H[np.ix_(free, free)]
    size = np.sqrt(np.maximum(np.diag(H), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(H / np.outer(size, size))
    values = np.maximum(values, 1e-14 * values[-1])  # smaller ones are rounding
    inverse = vectors / values @ vectors.T
    with np.errstate(over="ignore"):  # of what the record shows nothing of
        known = point.square / samples * inverse / np.outer(size, size)
    covariance[np.ix_(free, free)] = np.clip(known, -UNSEEN, UNSEEN)
    return covariance
