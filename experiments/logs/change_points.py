r"""Steps and ramps in a sequence of estimates with known deviations, at a stated false-alarm rate.

The estimates x of n logs are taken to be

.. math:: x = Z\beta + \sum_j \delta_j h_j + e, \qquad
    \operatorname{cov} e = \operatorname{diag}(s^2) + \tau^2 \rho^{|t_i - t_j|/\Delta t},

with a level and covariates in Z, the deviations s that each log claims, and a scatter from log to
log of unknown size τ and memory ρ. A change h is a step, a ramp that begins at some log, or one log
that is out of line. Generalised least squares, τ and ρ by restricted likelihood (H. D. Patterson
and R. Thompson, Biometrika 58, 1971), and the likelihood-ratio scan over all places and shapes (M.
Basseville and I. Nikiforov, *Detection of Abrupt Changes*, 1993, section 2.4). The greatest of its
ratios has no closed distribution: it is simulated, for these very times, covariates and deviations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]

FEWEST = 8  # logs, below which no scatter from log to log can be told from a change
EDGE = 3  # logs that a step or a ramp must have on each side
MOST = 6  # changes and logs out of line in a sequence
PLACES = 150  # that are scanned of a long sequence
CURVED = 20  # logs from which on the effect of a covariate may be curved
FIRST_LOOK, DRAWS = 500, 10_000  # simulated sequences
CORRELATIONS = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.75])
SCATTERS = np.geomspace(0.1, 30.0, 14)  # τ over the median deviation
LEAN = 0.25  # of log-likelihood, that may be lost for more memory: the estimate of it is too low
SHAPES = ("step", "ramp", "outlier")


@dataclass(frozen=True)
class Sequence:
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


@dataclass(frozen=True)
class Change:
    """A change in a sequence.

    Attributes
    ----------
    shape : {"step", "ramp", "outlier"}
    place : int
        First log after a step, last log before a ramp, or the log that is out of line.
    earliest, latest : int
        Places that are as good within a likelihood ratio of exp(1.92): about 95 % sure.
    size, deviation : float
        From before the change to the last log, and its standard deviation.
    chance : float
        Probability that a sequence without change shows one as large.
    """

    shape: str
    place: int
    earliest: int
    latest: int
    size: float
    deviation: float
    chance: float


@dataclass(frozen=True)
class Explained:
    """What a sequence is made of.

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


def explain(given: Sequence, *, false_alarms: float = 0.01, seed: int = 0) -> Explained:
    """Find the changes of a sequence, one after the other, as long as there are significant ones.

    Parameters
    ----------
    given : Sequence
        Of `FEWEST` logs or more.
    false_alarms : float
        Probability of any change in a sequence without one.
    seed : int
        Of the simulated sequences.
    """
    base, rng = _base(given), np.random.default_rng(seed)
    scale = float(np.median(given.deviation)) or 1.0
    x = given.value / scale
    design, found = base, []
    noise = _Noise(given, scale)
    while True:
        noise.fit(x, design, _candidates(given))
        if len(found) == MOST:
            break
        best = _best(x, design, noise, _candidates(given), false_alarms, rng)
        if best is None:
            break
        found.append(best)
        design = np.column_stack([design, _column(given, best)])
    return _summary(given, x, design, found, noise, scale)


def size_of(given: Sequence, change: Change) -> Change:
    """Return a change with the size that it has where the covariates are accounted for."""
    scale = float(np.median(given.deviation)) or 1.0
    x, noise = given.value / scale, _Noise(given, scale)
    design = np.column_stack([_base(given), _column(given, change)])
    noise.fit(x, design, [])
    return replace(change, **_sized(x, design, noise, design.shape[1] - 1, scale))


def _base(given: Sequence) -> Array:
    """Return level and covariates, curved where there are enough logs."""
    columns = [np.ones(len(given.time))]
    for values in given.covariates.T:
        centred = values - values.mean()
        if np.ptp(values) <= 1e-9 * max(abs(values).max(), 1e-300):
            continue
        columns.append(centred)
        if len(values) >= CURVED:
            columns.append(centred**2 - np.mean(centred**2))
    return np.column_stack(columns)


def _candidates(given: Sequence) -> list[tuple[str, int, Array]]:
    """Return shape, place and course (n,) of the changes to look for."""
    n = len(given.time)
    thin = max(1, n // PLACES)
    found = [("step", k, _shape(given, "step", k)) for k in range(EDGE, n - EDGE + 1, thin)]
    found += [("ramp", k, _shape(given, "ramp", k)) for k in range(0, n - EDGE, thin)]
    return found + [("outlier", k, _shape(given, "outlier", k)) for k in range(n)]


def _shape(given: Sequence, shape: str, place: int) -> Array:
    """Return the course (n,) of a change that is one on the last log, or on the log itself."""
    number, t = np.arange(len(given.time)), given.time
    if shape == "step":
        return (number >= place).astype(float)
    if shape == "outlier":
        return (number == place).astype(float)
    return np.maximum(t - t[place], 0.0) / (t[-1] - t[place])


def _column(given: Sequence, change: Change) -> Array:
    return _shape(given, change.shape, change.place)


class _Noise:
    """The covariance of a sequence, in units of the median deviation; what `fit` finds stays."""

    def __init__(self, given: Sequence, scale: float) -> None:
        t = given.time
        step = float(np.median(np.diff(t))) or 1.0
        self.lags = abs(t[:, None] - t[None, :]) / step
        self.variance = (given.deviation / scale) ** 2
        self.scatter, self.correlation = 0.0, 0.0
        self.root = np.diag(np.sqrt(self.variance))

    def white(self, values: Array) -> Array:
        """Return values (n, …) in coordinates in which the noise is white."""
        return solve_triangular(self.root, values, lower=True, check_finite=False)

    def fit(self, x: Array, design: Array, candidates: list[tuple[str, int, Array]]) -> None:
        """Choose τ and ρ by restricted likelihood, with the likeliest change in the design.

        Without that a change would be taken for scatter, and hide itself.
        """
        for _ in range(2):
            whole = design
            if candidates:
                ratio, _ = _ratios(self.white(x), self.white(design), self._courses(candidates))
                whole = np.column_stack([design, candidates[int(np.argmax(ratio))][2]])
            entries = list(self._likelihoods(x, whole))
            likeliest = max(entries, key=lambda entry: entry[0])
            memory = max(
                (e[2] for e in entries if e[0] >= likeliest[0] - LEAN) if likeliest[1] else [0.0]
            )
            _, self.scatter, self.correlation, self.root = max(
                (entry for entry in entries if entry[2] == memory), key=lambda entry: entry[0]
            )

    def _courses(self, candidates: list[tuple[str, int, Array]]) -> Array:
        return self.white(np.column_stack([course for _, _, course in candidates]))

    def _likelihoods(self, x: Array, design: Array) -> Iterator[tuple[float, float, float, Array]]:
        long = len(x) > 300
        scatters = SCATTERS[::2] if long else SCATTERS
        for correlation in CORRELATIONS[::2] if long else CORRELATIONS:
            memory = correlation**self.lags if correlation else np.eye(len(x))
            for scatter in scatters if correlation else [0.0, *scatters]:
                covariance = scatter**2 * memory + np.diag(self.variance)
                root = cholesky(covariance, lower=True, check_finite=False)
                yield self._restricted(x, design, root), scatter, correlation, root

    @staticmethod
    def _restricted(x: Array, design: Array, root: Array) -> float:
        """Return the restricted log-likelihood, but for a constant."""
        Z = solve_triangular(root, design, lower=True, check_finite=False)
        r = solve_triangular(root, x, lower=True, check_finite=False)
        Q, R = np.linalg.qr(Z)
        r = r - Q @ (Q.T @ r)
        determinants = (
            np.log(np.diag(root)).sum() + np.log(np.maximum(abs(np.diag(R)), 1e-12)).sum()
        )
        return float(-determinants - r @ r / 2)


def _ratios(x: Array, design: Array, courses: Array) -> tuple[Array, Array]:
    """Return F (m, S) of each of m courses in each of S white sequences, and what each explains.

    Parameters
    ----------
    x : ndarray (n,) or (n, S)
    design : ndarray (n, q)
    courses : ndarray (n, m)
    """
    Q, _ = np.linalg.qr(design)
    left = courses - Q @ (Q.T @ courses)
    length = np.linalg.norm(left, axis=0)
    # what the design explains already is no change of its own
    there = length > 1e-3 * np.linalg.norm(courses, axis=0)
    unit = np.where(there, left / np.where(there, length, 1.0), 0.0)
    residual = x - Q @ (Q.T @ x)
    gain = (unit.T @ residual) ** 2
    freedom = len(x) - design.shape[1] - 1
    total = (residual**2).sum(axis=0)
    return gain * freedom / np.maximum(total - gain, 1e-300), gain


def _best(
    x: Array,
    design: Array,
    noise: _Noise,
    candidates: list[tuple[str, int, Array]],
    false_alarms: float,
    rng: np.random.Generator,
) -> Change | None:
    """Return the likeliest change, or None if a sequence without one shows its like too often."""
    if len(x) - design.shape[1] < EDGE + 1:
        return None
    Z, C = noise.white(design), noise._courses(candidates)
    ratio, gain = _ratios(noise.white(x), Z, C)
    top = int(np.argmax(ratio))
    # where there is no scatter besides, estimates scatter by what they claim, however alike they
    # are by chance
    largest = float(ratio[top] if noise.scatter else min(ratio[top], gain[top]))
    chance = _chance(largest, Z, C, false_alarms, rng)
    if chance > false_alarms:
        return None
    shape, place, _ = candidates[top]
    # 2 log of the likelihood ratio, as the noise is known now
    near = [
        k
        for (s, k, _), g in zip(candidates, gain, strict=True)
        if s == shape and g > gain[top] - 3.84
    ]
    if shape == "outlier":
        near = [place]
    return Change(shape, place, min(near), max(near), 0.0, 0.0, chance)


def _chance(
    largest: float, design: Array, courses: Array, enough: float, rng: np.random.Generator
) -> float:
    """Return the probability that white noise has as large a ratio; roughly where it is likely."""
    above = drawn = 0
    while drawn < DRAWS:
        more = FIRST_LOOK
        ratio, _ = _ratios(rng.standard_normal((len(design), more)), design, courses)
        above += int((ratio.max(axis=0) >= largest).sum())
        drawn += more
        if above / drawn > enough + 5 * np.sqrt(enough / drawn):
            break
    return (above + 1) / (drawn + 1)


def _solved(x: Array, design: Array, noise: _Noise) -> tuple[Array, Array]:
    """Return the coefficients of a design, and their covariance."""
    Z, y = noise.white(design), noise.white(x)
    norm = np.linalg.norm(Z, axis=0)
    inverse = np.linalg.pinv(Z / norm)
    beta = inverse @ y
    # scatter is estimated with the rest, so that the noise is of variance one already
    return beta / norm, inverse @ inverse.T / np.outer(norm, norm)


def _sized(x: Array, design: Array, noise: _Noise, column: int, scale: float) -> dict[str, float]:
    beta, covariance = _solved(x, design, noise)
    return {
        "size": float(scale * beta[column]),
        "deviation": float(scale * np.sqrt(covariance[column, column])),
    }


def _summary(
    given: Sequence, x: Array, design: Array, found: list[Change], noise: _Noise, scale: float
) -> Explained:
    beta, covariance = _solved(x, design, noise)
    deviations = np.sqrt(np.diag(covariance))
    of_changes = len(found)
    first = design.shape[1] - of_changes
    sized = [replace(c, **_sized(x, design, noise, first + i, scale)) for i, c in enumerate(found)]
    slopes, slope_deviations = np.zeros((2, given.covariates.shape[1]))
    column, curved = 1, len(x) >= CURVED
    for i, values in enumerate(given.covariates.T):
        if np.ptp(values) > 1e-9 * max(abs(values).max(), 1e-300):
            slopes[i], slope_deviations[i] = scale * beta[column], scale * deviations[column]
            column += 2 if curved else 1
    return Explained(
        changes=tuple(sorted((c for c in sized if c.shape != "outlier"), key=lambda c: c.place)),
        outliers=tuple(sorted((c for c in sized if c.shape == "outlier"), key=lambda c: c.place)),
        level=float(scale * beta[0]),
        slopes=slopes,
        slope_deviations=slope_deviations,
        fitted=scale * design @ beta,
        of_covariates=scale * design[:, 1:first] @ beta[1:first],
        scatter=scale * noise.scatter,
        correlation=noise.correlation,
    )
