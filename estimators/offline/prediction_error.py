"""
Fit all that a record leaves open to it, in noise of any colour: the prediction-error method.

Disturbances of a real axis are not white: they are strongest where it resonates, and plain output
error then fits those frequencies at the cost of all others. So the residual is modelled as an
autoregression, residual and gradient are filtered by its inverse, and the fit is repeated until it
stays, in the way of D. W. Clarke, *Generalized least squares estimation of the parameters of a
dynamic model* (IFAC 1967). As the residual is filtered and not the signals, the axis may have
nonlinear laws.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import Colour, colourless
from flexaxis.estimators.offline.descent import (
    BOLD,
    CAREFUL,
    CONVERGED,
    Point,
    Problem,
    damped_step,
    gained,
)
from flexaxis.estimators.offline.trajectory import COARSE, FINE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDS = 40  # where noise and parameters explain the same, each leaves two thirds of the way
LAST = 2  # rounds that solve laws to their full accuracy, at least, and may keep a colour
TURNING, TURNS = 10, 1.0
"""Where fits of so many rounds lie within so many standard deviations, and still do not stay, the
colours of their residuals take turns (a drift would have gone further), and one is kept."""
EVALUATIONS, SEARCHING = 25, 12  # in a round of a fit, and of a search
SEARCHED = 0.5  # likewise, where a search does
UNSEEN = 1e200  # variance of what a record shows nothing of


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
    Fit parameters and noise in turn, until both stay, or only colours of the noise take turns.

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
    point, places = problem.at(z, colour, coarse=coarse), list[Array]()
    if not np.isfinite(point.square):  # it cannot be simulated from there
        return finished(problem, point, colour, False)
    if plain:
        point, _ = problem.descend(point, colour, most, coarse=coarse, near=SEARCHED)
    for left in reversed(range(rounds)):
        if not np.isfinite(point.square):
            break  # it cannot be simulated, and has no residual that could be coloured
        if not (fine and left < LAST and _takes_turns(point, places)):
            colour = problem.colour(point.residual)
        point = problem.weighed(point, colour)
        if coarse and fine and (converged or left < LAST):
            point, coarse, converged = problem.at(point.z, colour), False, False
        converged = converged or problem.left(point) <= near
        if converged and not (coarse and fine):
            break
        before = point
        point, ended = problem.descend(
            point, colour, most, coarse=coarse, near=near / 2, damping=damping
        )
        places.append(point.z)
        converged, damping = ended and gained(before, point) <= near, BOLD
    return finished(problem, point, colour, converged)


def _takes_turns(point: Point, places: list[Array]) -> bool:
    """Return whether the last fits lie around a point, as its curvature has it."""
    if len(places) < TURNING:
        return False
    off = np.array(places[-TURNING:]) - point.z
    far = np.einsum("ki,ij,kj->k", off, point.H, off) * point.samples / point.square
    return bool(np.all(far <= TURNS**2))


def finished(problem: Problem, point: Point, colour: Colour, converged: bool = True) -> Fitted:
    """Return what there is to know of a fit that ended at a point."""
    white = colour.white(colour.bridged(point.residual, problem.ok))
    good = colour.settled(problem.ok)
    slopes = colour.white(colour.bridged(point.slopes, problem.ok))
    slopes = problem.seen(slopes, point.slopes, good)
    covariance = _covariance(point, problem)
    return Fitted(
        point.z, covariance, colour, point.square, point.residual, white, slopes, good, converged
    )


def discretisation(problem: Problem, fitted: Fitted) -> Array:
    """
    Return by how much unknowns (q,) depend on how laws are solved; zero without laws.

    Of Coulomb friction it is the step of Gauss and Newton that is left where no step gains: there a
    speed only just reaches zero, and derivatives hold for less than a standard deviation.

    Of other laws it is a third of the step of Gauss and Newton from the fit with fine steps to that
    with coarse ones, which are four times as long: as the error where friction reverses is of the
    first order, that is about what fine steps are off themselves (L. F. Richardson, 1911).
    """
    step = np.zeros_like(fitted.z)
    if not problem.course.model.forces:
        return step
    e = fitted.white[fitted.good]
    if problem.course.coarsens:
        coarse = fitted.colour.bridged(problem.residual(fitted.z, coarse=True)[0], problem.ok)
        e = (fitted.colour.white(coarse)[fitted.good] - e) / (FINE / COARSE - 1)
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
    with np.errstate(over="ignore", invalid="ignore"):  # of what the record shows nothing of
        known = point.square / point.samples * inverse / np.outer(size, size)
    covariance[np.ix_(free, free)] = np.clip(known, -UNSEEN, UNSEEN)
    return covariance
