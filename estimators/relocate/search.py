"""
Parameters from anywhere in a box that explain a stretch of the past, one evaluation a sample.

Far from the truth the sum of squares has local minima, and a recursive method that falls into one
stays there. A search looks at points all over the box, and descends from the best of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.normal import summing
from flexaxis.estimators.relocate.work import CALL, Work
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

POINTS = 64  # all over the box
REACH = 3.0  # times and parts of what is expected
DESCENTS = 4  # from the best of them
ITERATIONS = 20  # of each, at most
CONVERGED = 1e-3  # of the sum of squares, that a further step gains


@dataclass(frozen=True)
class Evaluated:
    """θ (p,), its mean square ε², and curvature (q, q) and slope (q,) of half of that."""

    theta: Array
    square: float
    H: Array
    g: Array


class Search:
    """
    A search for the identified parameters; all others stay as they are.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    theta : (p,) array
        Where the filter is.
    box : (lower, upper), each (p,)
    expected : (p,) array
        About how large each parameter may be.
    identified : int
    x : (n,) array
        State before the stretch.
    signals : u (N, 2), y (N,), present (N,)
        As of `flexaxis.estimators.relocate.fit.Past`.
    grain : float
        Operations of a piece of the work.

    Attributes
    ----------
    best : Evaluated or None
        The best so far.
    done : bool
    """

    def __init__(
        self,
        terms: Terms,
        theta: Array,
        box: tuple[Array, Array],
        *,
        expected: Array,
        identified: int,
        x: Array,
        signals: tuple[Array, Array, NDArray[np.bool_]],
        grain: float = np.inf,
    ) -> None:
        self._terms, self._x, self._signals, self._grain = terms, x, signals, grain
        self._active, self._box, self._expected = np.arange(identified), box, expected
        self._points = [self._point(theta, place) for place in halton(POINTS, identified)]
        self._seen: list[Evaluated] = []
        self._starts: list[Evaluated] = []
        self._descent: Descent | None = None
        self.best: Evaluated | None = None
        self.done = False

    def _point(self, theta: Array, place: Array) -> Array:
        point = theta.copy()
        point[self._active] = REACH ** (2 * place - 1) * self._expected[self._active]
        return np.clip(point, *self._box)

    def advance(self) -> Work[None]:
        """Evaluate one point."""
        if self._points:
            self._seen.append((yield from self._evaluate(self._points.pop(0))))
            if not self._points:
                self._starts = sorted(self._seen, key=lambda seen: seen.square)[:DESCENTS]
            return
        yield CALL
        if self._descent is None:
            self._descent = Descent(self._starts.pop(0), self._box, self._active)
        self._descent.take((yield from self._evaluate(self._descent.trial)))
        if self._descent.done:
            found = self._descent.at
            if self.best is None or found.square < self.best.square:
                self.best = found
            self._descent = None
            self.done = not self._starts

    def _evaluate(self, theta: Array) -> Work[Evaluated]:
        nothing = np.zeros(ORDER)
        stretch = self._x, *self._signals, nothing, nothing, 1.0, self._active
        square, H, g = yield from summing(self._terms, theta, *stretch, grain=self._grain)
        if not np.isfinite(square):  # an axis that is unstable there explains nothing
            return Evaluated(theta, np.inf, np.zeros_like(H), np.zeros_like(g))
        measured = max(int(np.sum(self._signals[2])), 1)
        return Evaluated(theta, square / measured, H / measured, g / measured)


class Descent:
    """
    Levenberg–Marquardt's method from one point, one evaluation at a time.

    Parameters
    ----------
    start : Evaluated
    box : (lower, upper), each (p,)
    active : (q,) int array
    sizes : (q,) array, optional
        About how far each of these may have to go; all the same by default.
    iterations, converged
        As by default here.

    Attributes
    ----------
    at : Evaluated
        Where it is.
    trial : (p,) array
        What to evaluate next, and give to `take`.
    done : bool
    """

    def __init__(
        self,
        start: Evaluated,
        box: tuple[Array, Array],
        active: NDArray[np.int64],
        *,
        sizes: Array | None = None,
        iterations: int = ITERATIONS,
        converged: float = CONVERGED,
    ) -> None:
        self.at, self.done, self._converged = start, False, converged
        self._box, self._active, self._damping, self._left = box, active, 1e-2, iterations
        self._sizes = np.ones(len(active)) if sizes is None else sizes
        self.trial = self._next()

    def take(self, tried: Evaluated) -> None:
        """Take what came of the trial."""
        self._left -= 1
        gained = self.at.square - tried.square
        if gained > 0:
            self.done = gained < self._converged * self.at.square
            self.at, self._damping = tried, max(self._damping / 10, 1e-6)
        else:
            self._damping *= 10
        self.done |= self._left == 0 or self._damping > 1e6
        self.trial = self._next()

    def _next(self) -> Array:
        damped = self.at.H + self._damping * np.diag(np.diag(self.at.H))
        trial = self.at.theta.copy()
        if np.isfinite(self.at.square):
            by, slope = self._sizes, self._sizes * self.at.g  # rank is judged free of units
            step = np.linalg.lstsq(damped * np.outer(by, by), slope, rcond=None)[0]
            trial[self._active] += by * step
        return np.clip(trial, *self._box)


def halton(count: int, dimensions: int) -> Array:
    """
    Return points (count, dimensions) that fill the unit cube evenly.

    J. H. Halton, Numer. Math. 2, 1960: the digits of 1, 2, … in a prime base, mirrored at the
    point, one prime for each dimension.
    """
    primes = [n for n in range(2, 60) if all(n % m for m in range(2, n))][:dimensions]
    return np.array([[_mirrored(k, base) for base in primes] for k in range(1, count + 1)])


def _mirrored(number: int, base: int) -> float:
    value, weight = 0.0, 1.0
    while number:
        weight /= base
        number, digit = divmod(number, base)
        value += weight * digit
    return value
