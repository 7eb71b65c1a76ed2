"""What a record leaves open to a model, as a least-squares problem, and the way to its bottom."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from flexaxis.estimators.offline.colour import HIGHEST_ORDER, Colour, colourless, noise_model
from flexaxis.estimators.offline.trajectory import Course

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FASTEST = 4 * np.pi  # radians a sample: an axis with such a pole is none that the log can show
CONVERGED = 0.05  # standard deviations that it is to the bottom, where a fit ends
CAREFUL, BOLD = 1e-3, 1e-8  # damping of the first step: far from the bottom, and near it
ROUGH = 5.0  # standard deviations that may be left where friction is at a kink and no step gains
FULFILLED, BROKEN = 0.75, 0.25  # shares of the fall that was promised
LEAST = 1e-4  # of what a stretch tells of its state, that is to be left of it
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
    """

    course: Course
    y: Array
    ok: Flags
    lower: Array
    upper: Array
    held: Flags
    whiten: bool = True
    highpass: float | None = None

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
        highest = HIGHEST_ORDER  # of which no more than half of the samples see a gap
        while highest and np.mean(Colour(np.ones(highest + 1)).settled(ok)[ok]) < 0.5:
            highest //= 2
        return replace(plain, inverse=noise_model(high, highest, ok))

    def seen(self, J: Array, slopes: Array, good: Flags) -> Array:
        """
        Return derivatives (q, N) by what is seen of the states behind gaps; they stay in all else.

        Where what counts of a stretch lies behind a while in which its state is forgotten, noise
        would drive it away without end. J is what a filter leaves of ``slopes``, (q, N) too.
        """
        edges = [*self.course.begins, J.shape[1]]
        for (begin, end), place in zip(pairwise(edges), self.course.states, strict=True):
            if len(edges) == 2 or place.start == place.stop:
                continue
            moves = place.start + np.flatnonzero(~self.held[place])
            every, counts = slopes[moves, begin:end], J[moves, begin:end] * good[begin:end]
            size = np.sqrt(np.sum(every**2, axis=1))
            size[size == 0] = 1.0
            every, counts = every / size[:, None], counts / size[:, None]
            B = every @ every.T + LEAST * np.eye(len(moves))
            shares, ways = eigh(counts @ counts.T, B)
            ways = ways[:, shares > LEAST]
            kept = B @ ways @ ways.T * np.outer(size, 1 / size)
            J[moves] = kept @ J[moves]
        return J

    def at(self, z: Array, colour: Colour, *, coarse: bool = False) -> Point:
        """Return what a step of Gauss and Newton needs at z."""
        q, N = len(z), len(self.y)
        nowhere = Point(z, np.zeros(N), np.zeros((q, N)), np.inf, np.eye(q), np.zeros(q), 1)
        if self.course.fastest(z[: self.course.p]) > FASTEST:
            return nowhere
        residual, slopes = self.residual(z, coarse=coarse)
        if not np.isfinite(residual).all() or not np.isfinite(slopes).all():
            return nowhere
        return self.weighed(replace(nowhere, residual=residual, slopes=slopes), colour)

    def weighed(self, at: Point, colour: Colour) -> Point:
        """Return a point as noise of another colour has it, without simulating it again."""
        good = colour.settled(self.ok)
        e = colour.white(colour.bridged(at.residual, self.ok))[good]
        J = self.seen(colour.white(colour.bridged(at.slopes, self.ok)), at.slopes, good)[:, good]
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

    def start(self, theta: Array, delay: float, state: Array | None = None) -> Array:
        """Return z at parameters, a delay and a state, the rest by a few linear steps at first."""
        z = np.r_[theta, np.zeros(self.course.q - len(theta) - 1), delay]
        if state is not None:
            first = self.course.p + self.course.m
            z[first : first + len(state)] = state
        z = np.clip(z, self.lower, self.upper)
        rest = np.ones(self.course.q, bool)
        rest[len(theta) : -1] = False
        nuisance = replace(self, held=self.held | rest)
        plain = colourless(self.highpass, self.course.period)
        return nuisance.descend(nuisance.at(z, plain, coarse=True), plain, 4, coarse=True)[0].z

    def descend(
        self,
        at: Point,
        colour: Colour,
        most: int,
        *,
        coarse: bool = False,
        near: float = CONVERGED,
        damping: float = CAREFUL,
    ) -> tuple[Point, bool]:
        """
        Return where Levenberg and Marquardt's method comes to from a point, and if it ended there.

        It ends where the bottom is as near as that, in standard deviations, or steps gain no more
        than such a step would.
        """
        for _ in range(most):
            if self.left(at) <= near:
                return at, True
            tried = self.at(self._next(at, damping), colour, coarse=coarse)
            if tried.square < at.square:
                step = tried.z - at.z
                share = (at.square - tried.square) / (2 * at.g @ step - step @ at.H @ step)
                # where less comes of a step than was promised the next is to be shorter
                damping *= 0.1 if share > FULFILLED else 3.0 if share < BROKEN else 1.0
                done, at, damping = gained(at, tried) <= near, tried, max(damping, BOLD)
                if done:
                    return at, True
            else:
                damping = max(10 * damping, 1e-4)
                if damping > STIFFEST:
                    return at, self.left(at) <= ROUGH
        return at, False

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
    seen, step = np.diag(H) != 0, np.zeros(len(g))
    size = np.sqrt(np.diag(H)[seen])
    scaled = H[np.ix_(seen, seen)] / np.outer(size, size) + damping * np.eye(len(size))
    step[seen] = np.linalg.lstsq(scaled, g[seen] / size, rcond=1e-12)[0] / size
    return step
