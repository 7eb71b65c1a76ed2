"""Find when parameters changed in a record, and name them, without any recursive estimator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

from flexaxis.experiments.logs.trend.change_points import FEWEST, Series, explain

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Look = Callable[[Array], Sequence[Array]]

WINDOWS = 40  # that a record is cut into
FALSE_ALARMS = 0.002  # probability of a change in a record without one
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
    windows gives forty nearly independent Δθ, whose changes are found as those of a trend are, see
    `change_points`. As scatter is measured and not assumed, an error of the model that is always
    there raises no alarm.

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
    pieces = np.array_split(np.arange(len(time)), max(windows, 1))
    pieces = [k for k in pieces if len(k) > 10 * len(names)]
    if len(pieces) < FEWEST:
        return []
    local = np.array([np.linalg.lstsq(psi[k] * theta, error[k])[0] for k in pieces])
    at, found = time[[k[0] for k in pieces]], []
    for name, values in zip(names, local.T, strict=True):
        claimed = np.full(len(values), _scatter(values))
        series = Series(at, values, claimed, np.empty((len(values), 0)))
        explained = explain(series, false_alarms=FALSE_ALARMS / len(names))
        for change in explained.changes:
            relative = change.size / (1 + explained.level)
            if abs(relative) >= SMALLEST:
                scatters = abs(change.size) / change.deviation
                found.append(Change(name, float(at[change.place]), relative, scatters))
    return sorted(found, key=lambda change: (change.time, -change.scatters))


def changes_along(look: Look, time: Array, theta: Array, names: Sequence[str]) -> list[Change]:
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

    def along(inside: Flags, theta: Array) -> list[Change]:
        error, psi = (signal[inside] for signal in look(theta))
        windows = round(WINDOWS * np.mean(inside))
        first = find_changes(time[inside], error, psi, theta, names, windows=windows)
        if not first:
            return []
        at = max(first, key=lambda change: change.scatters).time
        sides = inside & (time < at), inside & (time >= at)
        before, after = (_fitted(look, side, theta) for side in sides)
        sizes = dict(zip(names, (after / before - 1).tolist(), strict=True))
        here = [replace(c, relative=sizes[c.name]) for c in first if c.time == at]
        here = [change for change in here if abs(change.relative) >= SMALLEST]
        return [*along(sides[0], before), *here, *along(sides[1], after)] if here else []

    return along(np.ones(len(time), bool), theta)


def _fitted(look: Look, inside: Flags, theta: Array) -> Array:
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
    # a step has twice the variance
    return float(median_abs_deviation(np.diff(values), scale="normal")) / np.sqrt(2) + 1e-12
