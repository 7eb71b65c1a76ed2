"""Find when parameters changed in a record, and name them, without any recursive estimator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOWS = 40  # that a record is cut into
FEWEST = 3  # windows on each side of a change
SCATTERS = 5.0  # of a difference of means; 22 false alarms in 10 000 sequences of white noise
SMALLEST = 0.02  # relative change that is worth a word
STEPS = 4  # of Gauss and Newton to the values on both sides of a change
FARTHEST = 0.5  # relative change of a parameter in one of them


@dataclass(frozen=True)
class Change:
    """A parameter that is another one from some time on.

    Attributes
    ----------
    name : str
    time : float
        [s], to about one window.
    relative : float
        Change over the value before it.
    scatters : float
        Change in units of its standard deviation, from the scatter between windows.
    """

    name: str
    time: float
    relative: float
    scatters: float


def find_changes(
    time: Array,
    error: Array,
    psi: Array,
    theta: Array,
    names: Sequence[str],
    *,
    windows: int = WINDOWS,
) -> list[Change]:
    """Find changes from the residual ε and its gradient ψ at fixed parameters.

    ε ≈ ψᵀ Δθ for a small change of the parameters: the local approach of M. Basseville and
    I. Nikiforov, *Detection of Abrupt Changes* (1993), chapter 8. Least squares in each of forty
    windows gives forty nearly independent Δθ; the split of their sequence with the greatest
    difference of means, in units of the scatter within both parts, is a change if it is great
    enough. The parts are split again. As scatter is measured and not assumed, an error of the
    model that is always there raises no alarm.

    Parameters
    ----------
    time : ndarray (N,)
        [s], of usable samples only.
    error : ndarray (N,)
        ε.
    psi : ndarray (N, p)
        ψ.
    theta : ndarray (p,)
        Where ε and ψ were taken.
    names : sequence of str
        Of the p parameters.
    windows : int
        That the samples are cut into.

    Returns
    -------
    list of Change
        In the order of time.
    """
    bounds = np.linspace(0, len(time), windows + 1).astype(int)
    local = np.full((windows, len(names)), np.nan)
    for i, (start, stop) in enumerate(pairwise(bounds)):
        if stop - start > 10 * len(names):
            local[i] = np.linalg.lstsq(psi[start:stop] * theta, error[start:stop])[0]
    kept = np.isfinite(local).all(axis=1)
    found = [
        Change(name, float(time[bounds[:-1][kept][place]]), difference, scatters)
        for column, name in enumerate(names)
        for place, difference, scatters in _splits(
            local[kept, column], _scatter(local[kept, column])
        )
    ]
    return sorted(found, key=lambda change: (change.time, -change.scatters))


def changes_along(
    look: Callable[[Array], Sequence[Array]], time: Array, theta: Array, names: Sequence[str]
) -> list[Change]:
    """Find changes however large they are: the parameters are fitted anew on both sides of each.

    A residual is linear in small changes only, and where a motor sticks hardly at all: seen from
    the values after a large change, what was before has the wrong size, and changes of others
    beside it that never were. So both sides are looked at again from their own values.

    Parameters
    ----------
    look : callable
        Returns ε (N,) and ψ (N, p) of the usable samples at any θ.
    time, theta, names
        As for `find_changes`.

    Returns
    -------
    list of Change
        In the order of time.
    """
    return _along(_Record(look, time, names), np.ones(len(time), bool), theta)


@dataclass(frozen=True)
class _Record:
    look: Callable[[Array], Sequence[Array]]
    time: Array
    names: Sequence[str]


def _along(record: _Record, inside: NDArray[np.bool_], theta: Array) -> list[Change]:
    """Return the changes of a stretch, seen from its own parameters."""
    error, psi = (signal[inside] for signal in record.look(theta))
    windows = round(WINDOWS * np.mean(inside))
    if windows < 2 * FEWEST:
        return []
    first = find_changes(record.time[inside], error, psi, theta, record.names, windows=windows)
    if not first:
        return []
    at = max(first, key=lambda change: change.scatters).time
    sides = inside & (record.time < at), inside & (record.time >= at)
    before, after = (_fitted(record.look, side, theta) for side in sides)
    here = [
        replace(change, relative=float((after / before)[record.names.index(change.name)] - 1))
        for change in first
        if change.time == at
    ]
    here = [change for change in here if abs(change.relative) >= SMALLEST]
    if not here:
        return []
    return [*_along(record, sides[0], before), *here, *_along(record, sides[1], after)]


def _fitted(
    look: Callable[[Array], Sequence[Array]], inside: NDArray[np.bool_], theta: Array
) -> Array:
    """Return the parameters (p,) of a stretch: as long as steps of Gauss and Newton help."""
    best, least, at = theta, np.inf, theta
    for _ in range(STEPS + 1):
        error, psi = (signal[inside] for signal in look(at))
        square = float(error @ error)
        if not square < least:
            break
        best, least = at, square
        step = np.linalg.lstsq(psi * at, error)[0]
        at = at * (1 + np.clip(step, -FARTHEST, FARTHEST))
    return best


def _scatter(values: Array) -> float:
    """Return the standard deviation of a sequence about a mean that changes now and then."""
    steps = np.diff(values)
    # 1.4826 makes the median deviation that of a normal distribution; a step has twice the variance
    return 1.4826 * float(np.median(abs(steps - np.median(steps)))) / np.sqrt(2) + 1e-12


def _splits(values: Array, scatter: float, offset: int = 0) -> list[tuple[int, float, float]]:
    """Return place, relative difference of means and significance of each change in a sequence."""
    n = len(values)
    places = np.arange(FEWEST, n - FEWEST + 1)
    if not len(places):
        return []
    sums = np.cumsum(values)[places - 1]
    before, after = sums / places, (values.sum() - sums) / (n - places)
    # the split that explains most of the sequence is the likeliest one
    significance = abs(after - before) / (scatter * np.sqrt(1 / places + 1 / (n - places)))
    best = int(np.argmax(significance))
    relative = float((after - before)[best] / (1 + before[best]))
    if significance[best] < SCATTERS or abs(relative) < SMALLEST:
        return []
    k = int(places[best])
    return [
        *_splits(values[:k], scatter, offset),
        (offset + k, relative, float(significance[best])),
        *_splits(values[k:], scatter, offset + k),
    ]
