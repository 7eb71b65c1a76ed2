r"""Steps and ramps in a sequence of estimates with known deviations, at a stated false-alarm rate.

The estimates x of n logs are taken to be

.. math:: x = Z\beta + \sum_j \delta_j h_j + e,

with a level and covariates in Z, and e as `flexaxis.experiments.logs.trend.scatter` has it. A
change h is a step, a ramp that begins at some log, or one log that is out of line. They are looked
for by generalised least squares with the likelihood-ratio scan over all places and shapes
(M. Basseville and I. Nikiforov, *Detection of Abrupt Changes*, 1993, section 2.4), one after the
other. The greatest of the ratios has no closed distribution, see there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.trend.scatter import Scatter, chance_of, ratios

Array = NDArray[np.float64]

FEWEST = 8  # logs, below which no scatter from log to log can be told from a change
EDGE = 3  # logs that a step or a ramp must have on each side
MOST = 6  # changes and logs out of line in a sequence
PLACES = 150  # that are scanned of a long sequence
CURVED = 20  # logs from which on the effect of a covariate may be curved
ALONGSIDE = 2  # changes beside which the scatter is estimated: one can hide another
SURE = 3.84  # 95 % point of χ² with one degree of freedom, for the place of a change


@dataclass(frozen=True)
class Series:
    """Estimates of one parameter over many logs.

    Attributes
    ----------
    time : ndarray (n,)
        In any unit, increasing.
    value, deviation : ndarray (n,)
    covariates : ndarray (n, q)
        What may explain the values; q may be 0.
    """

    time: Array
    value: Array
    deviation: Array
    covariates: Array

    def course(self, shape: str, place: int) -> Array:
        """Return the course (n,) of a change that is one on the last log, or on the log itself."""
        number, t = np.arange(len(self.time)), self.time
        if shape == "ramp":
            return np.maximum(t - t[place], 0.0) / max(t[-1] - t[place], 1e-300)
        return (number >= place if shape == "step" else number == place).astype(float)


@dataclass(frozen=True)
class Change:
    """A change in a series.

    Attributes
    ----------
    shape : {"step", "ramp", "outlier"}
    place : int
        First log after a step, last log before a ramp, or the log that is out of line.
    earliest, latest : int
        Places that are as good within a likelihood ratio of exp(1.92): about 95 % sure.
    chance : float
        Probability that a series without change shows one as large.
    size, deviation : float
        From before the change to the last log, and its standard deviation.
    """

    shape: str
    place: int
    earliest: int
    latest: int
    chance: float
    size: float = 0.0
    deviation: float = 0.0


@dataclass(frozen=True)
class Explained:
    """What a series is made of.

    Attributes
    ----------
    changes, outliers : tuple of Change
        In the order of time.
    level : float
        At the mean of the covariates and before any change.
    slopes, slope_deviations : ndarray (q,)
        Of the value with each covariate, at its mean.
    fitted : ndarray (n,)
        Level, covariates and changes.
    of_covariates : ndarray (n,)
        What of it is due to the covariates.
    scatter, correlation : float
        τ and ρ.
    """

    changes: tuple[Change, ...]
    outliers: tuple[Change, ...]
    level: float
    slopes: Array
    slope_deviations: Array
    fitted: Array
    of_covariates: Array
    scatter: float
    correlation: float


def explain(given: Series, *, false_alarms: float = 0.01, seed: int = 0) -> Explained:
    """Find the changes of a series, one after the other, as long as there are significant ones.

    Parameters
    ----------
    given : Series
        Of `FEWEST` logs or more.
    false_alarms : float
        Probability of any change in a series without one.
    seed : int
        Of the simulated series.
    """
    scan, rng = _Scan(given), np.random.default_rng(seed)
    while len(scan.found) < MOST and (change := scan.likeliest(false_alarms, rng)):
        scan.add(change)
    return scan.summary()


def size_of(given: Series, change: Change) -> Change:
    """Return a change with the size that it has where the covariates are accounted for."""
    scan = _Scan(given)
    scan.add(change)
    scan.noise.fit(scan.x, scan.design)
    beta, deviations = scan.solved()
    return replace(change, size=float(beta[-1]), deviation=float(deviations[-1]))


class _Scan:
    """A series in units of its median deviation, and the changes that were found in it so far."""

    def __init__(self, given: Series) -> None:
        self.given = given
        self.scale = float(np.median(given.deviation)) or 1.0
        self.x = given.value / self.scale
        self.explaining, self.design = _base(given)
        self.first, self.found = self.design.shape[1], list[Change]()
        self.noise = Scatter(given.time, given.deviation / self.scale)
        self.places = _places(len(given.time))
        self.courses = np.column_stack([given.course(*place) for place in self.places])

    def add(self, change: Change) -> None:
        """Add a change to what explains the series."""
        self.found.append(change)
        column = self.given.course(change.shape, change.place)
        self.design = np.column_stack([self.design, column])

    def likeliest(self, false_alarms: float, rng: np.random.Generator) -> Change | None:
        """Return the likeliest further change, None if its like is seen too often without one."""
        if len(self.x) - self.design.shape[1] <= EDGE:
            return None
        white, whole = self.noise.white, self.design
        for _ in range(ALONGSIDE):
            # with what changes, or it would be taken for scatter and hide itself
            top = int(np.argmax(ratios(white(self.x), white(whole), white(self.courses))[0]))
            whole = np.column_stack([whole, self.courses[:, top]])
            self.noise.fit(self.x, whole)
        design, courses = white(self.design), white(self.courses)
        ratio, gain = ratios(white(self.x), design, courses)
        top = int(np.argmax(ratio))
        # where there is no scatter besides, estimates scatter by what they claim, however alike
        # they are by chance
        largest = float(ratio[top] if self.noise.size else min(ratio[top], gain[top]))
        chance = chance_of(largest, design, courses, rng)
        if chance > false_alarms:
            return None
        shape, place = self.places[top]
        near = [place] if shape == "outlier" else [
            k for (s, k), g in zip(self.places, gain, strict=True)
            if s == shape and g > gain[top] - SURE
        ]  # fmt: skip
        return Change(shape, place, min(near), max(near), chance)

    def solved(self) -> tuple[Array, Array]:
        """Return the coefficients of the design, and their deviations, in units of the series."""
        Z, y = self.noise.white(self.design), self.noise.white(self.x)
        norm = np.linalg.norm(Z, axis=0)
        inverse = np.linalg.pinv(Z / norm)
        beta = inverse @ y / norm
        # the sizes of scatter that are tried are some way apart; logs claim no more than they do
        variance = float(np.sum((y - Z @ beta) ** 2)) / (len(y) - len(beta))
        variance = variance if self.noise.size else max(variance, 1.0)
        deviations = np.sqrt(variance) * np.linalg.norm(inverse, axis=1) / norm
        return self.scale * beta, self.scale * deviations

    def summary(self) -> Explained:
        """Return what the series is made of."""
        beta, deviations = self.solved()
        slopes, slope_deviations = np.zeros((2, self.given.covariates.shape[1]))
        for i, column in self.explaining.items():
            slopes[i], slope_deviations[i] = beta[column], deviations[column]
        sizes = zip(self.found, beta[self.first :], deviations[self.first :], strict=True)
        sized = [replace(c, size=float(b), deviation=float(s)) for c, b, s in sizes]
        sized.sort(key=lambda change: change.place)
        return Explained(
            changes=tuple(c for c in sized if c.shape != "outlier"),
            outliers=tuple(c for c in sized if c.shape == "outlier"),
            level=float(beta[0]),
            slopes=slopes,
            slope_deviations=slope_deviations,
            fitted=self.design @ beta,
            of_covariates=self.design[:, 1 : self.first] @ beta[1 : self.first],
            scatter=self.scale * self.noise.size,
            correlation=self.noise.memory,
        )


def _base(given: Series) -> tuple[dict[int, int], Array]:
    """Return the column of the slope of each covariate, and level and covariates (n, …).

    Their effect is curved where there are enough logs, for that on friction is.
    """
    columns, places = [np.ones(len(given.time))], {}
    for i, values in enumerate(given.covariates.T):
        spread, centred = float(np.std(values)), values - values.mean()
        if spread <= 1e-9 * float(np.max(abs(values))):
            continue
        places[i] = len(columns)
        columns.append(centred)
        if len(values) >= CURVED:
            columns.append((centred / spread) ** 2 - 1)
    return places, np.column_stack(columns)


def _places(n: int) -> list[tuple[str, int]]:
    """Return shape and place of the changes to look for in n logs."""
    thin = max(1, n // PLACES)
    steps = [("step", k) for k in range(EDGE, n - EDGE + 1, thin)]
    ramps = [("ramp", k) for k in range(0, n - EDGE, thin)]
    return [*steps, *ramps, *(("outlier", k) for k in range(n))]
