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

ROUNDS = 12
LAST = 2  # rounds that solve laws to their full accuracy, at least
EVALUATIONS, SEARCHING = 25, 12  # in a round of a fit, and of a search
FASTEST = 4 * np.pi  # radians a sample: an axis with such a pole is none that the log can show
CONVERGED = 0.05  # standard deviations that it is to the bottom, where a fit ends
SEARCHED = 0.5  # likewise, where a search does
UNSEEN = 1e200  # variance of what a record shows nothing of
CAREFUL, BOLD = 1e-3, 1e-8  # damping of the first step: far from the bottom, and near it
STIFFEST = 1e3  # damping of steps so short that, where none gains, there is a bottom


@dataclass(frozen=True)
class Point:
    """
    A place, and what a step of Gauss and Newton from it needs.

    Attributes
    ----------
    z : (q,) array
    residual, slopes : (N,), (q, N) arrays
        y − ŷ and the derivatives of ŷ, as simulated.
    square : float
        Mean square of the white residual.
    H, g : (q, q), (q,) arrays
        Half its curvature, and its descent.
    samples : int
        Which these are means over.
    """

    z: Array
    residual: Array
    slopes: Array
    square: float
    H: Array
    g: Array
    samples: int


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
        high, ok = plain.high(plain.bridged(residual, self.ok)), plain.settled(self.ok)
        return replace(plain, inverse=noise_model(high, HIGHEST_ORDER, ok))

    def at(self, z: Array, colour: Colour, *, coarse: bool = False) -> Point:
        """Return what a step of Gauss and Newton needs at z."""
        q, N = len(z), len(self.y)
        nowhere = Point(z, np.zeros(N), np.zeros((q, N)), np.inf, np.eye(q), np.zeros(q), 1)
        if self.course.fastest(z[: self.course.p]) > FASTEST:
            return nowhere
        residual, slopes = self.residual(z, coarse=coarse)
        self.tell()
        if not np.isfinite(residual).all() or not np.isfinite(slopes).all():
            return nowhere
        return self.weighed(replace(nowhere, residual=residual, slopes=slopes), colour)

    def weighed(self, at: Point, colour: Colour) -> Point:
        """Return a point as noise of another colour has it, without simulating it again."""
        good = colour.settled(self.ok)
        e = colour.white(colour.bridged(at.residual, self.ok))[good]
        J = colour.white(colour.bridged(at.slopes, self.ok))[:, good]
        N = len(e)
        return replace(at, square=float(e @ e) / N, H=J @ J.T / N, g=J @ e / N, samples=N)

    def left(self, at: Point) -> float:
        """
        Return how far it is to the bottom, in standard deviations.

        (N gᵀH⁻¹g/σ²)^½ is what a step of Gauss and Newton moves all unknowns together, whatever
        their units; none of them moves by more of its own deviation.
        """
        if not np.isfinite(at.square):
            return np.inf
        gain = float(at.g @ self._step(at, 0.0))
        return float(np.sqrt(max(gain, 0.0) * at.samples / at.square))

    def start(self, theta: Array, delay: float) -> Array:
        """Return z at parameters and a delay, the rest by a few linear steps at first."""
        z = np.r_[theta, np.zeros(self.course.q - len(theta) - 1), delay]
        rest = np.ones(self.course.q, bool)
        rest[len(theta) : -1] = False
        nuisance = replace(self, held=self.held | rest)
        plain = colourless(self.highpass, self.course.period)
        return nuisance.descend(nuisance.at(z, plain, coarse=True), plain, 4, coarse=True).z

    def descend(
        self,
        at: Point,
        colour: Colour,
        most: int,
        *,
        coarse: bool = False,
        near: float = CONVERGED,
        damping: float = CAREFUL,
    ) -> Point:
        """
        Return where Levenberg and Marquardt's method comes to from a point within the box.

        It ends where the bottom is as near as that, in standard deviations, or steps gain no more
        than such a step would.
        """
        for _ in range(most):
            if self.left(at) <= near:
                break
            tried = self.at(self._next(at, damping), colour, coarse=coarse)
            if tried.square < at.square:
                done, at, damping = gained(at, tried) <= near, tried, max(damping / 10, BOLD)
                if done:
                    break
            else:
                damping = max(10 * damping, 1e-4)
                if damping > STIFFEST:
                    break
        return at

    def _next(self, at: Point, damping: float) -> Array:
        """Return the next place to try."""
        return np.clip(at.z + self._step(at, damping), self.lower, self.upper)

    def _step(self, at: Point, damping: float) -> Array:
        """Return the damped step; what would leave the box stays at its side."""
        free, step = ~self.held, np.zeros(len(at.z))
        for _ in range(len(at.z)):
            step = np.zeros(len(at.z))
            step[free] = damped_step(at.H[np.ix_(free, free)], at.g[free], damping)
            out = free & (((at.z <= self.lower) & (step < 0)) | ((at.z >= self.upper) & (step > 0)))
            if not out.any():
                break
            free &= ~out
        return step


def gained(before: Point, after: Point) -> float:
    """Return the fall of −2 log L between points, as the standard deviations it is worth."""
    if not np.isfinite(before.square):
        return np.inf
    return float(np.sqrt(max(before.square / after.square - 1, 0.0) * after.samples))


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
    coarse, most = problem.course.coarsens, EVALUATIONS if fine else SEARCHING
    near, damping, converged = CONVERGED if fine else SEARCHED, CAREFUL, False
    colour = colourless(problem.highpass, problem.course.period)
    point = problem.at(z, colour, coarse=coarse)
    if plain:
        point = problem.descend(point, colour, most, coarse=coarse, near=SEARCHED)
    for left in reversed(range(rounds)):
        colour = problem.colour(point.residual)
        point = problem.weighed(point, colour)
        if coarse and fine and (converged or left < LAST):
            point, coarse, converged = problem.at(point.z, colour), False, False
        converged = converged or problem.left(point) <= near
        if converged and not (coarse and fine):
            break
        before = point
        point = problem.descend(point, colour, most, coarse=coarse, near=near / 2, damping=damping)
        converged, damping = gained(before, point) <= near, BOLD
    return finished(problem, point, colour, converged)


def finished(problem: Problem, point: Point, colour: Colour, converged: bool = True) -> Fitted:
    """Return what there is to know of a fit that ended at a point."""
    white = colour.white(colour.bridged(point.residual, problem.ok))
    slopes = colour.white(colour.bridged(point.slopes, problem.ok))
    good = colour.settled(problem.ok)
    covariance = _covariance(point, problem)
    return Fitted(
        point.z, covariance, colour, point.square, point.residual, white, slopes, good, converged
    )


def discretisation(problem: Problem, fitted: Fitted) -> Array:
    """
    Return by how much unknowns (q,) depend on how laws are solved; zero without laws.

    Of Coulomb friction it is the step of Gauss and Newton that is left where no step gains: there a
    speed only just reaches zero, and derivatives hold for less than a standard deviation. Of other
    laws it is such a step from the fit with fine steps to that with coarse ones, which are twice as
    long: as the error where friction reverses is of the first order, that is about what fine steps
    are off themselves (L. F. Richardson, 1911).
    """
    step = np.zeros_like(fitted.z)
    if problem.course.model.laws is None:
        return step
    e = fitted.white[fitted.good]
    if problem.course.coarsens:
        coarse = fitted.colour.bridged(problem.residual(fitted.z, coarse=True)[0], problem.ok)
        e = fitted.colour.white(coarse)[fitted.good] - e
    free = np.diag(fitted.covariance) > 0
    J = fitted.slopes[:, fitted.good][free]
    step[free] = damped_step(J @ J.T, J @ e, 0.0)
    return abs(step)


def _covariance(point: Point, problem: Problem) -> Array:
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
        known = point.square / point.samples * inverse / np.outer(size, size)
    covariance[np.ix_(free, free)] = np.clip(known, -UNSEEN, UNSEEN)
    return covariance
