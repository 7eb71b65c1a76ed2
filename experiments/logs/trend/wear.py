"""Wear told from warm: what changed from log to log, and what of it a covariate explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.trend.change_points import (
    FEWEST,
    Change,
    Explained,
    Series,
    explain,
    size_of,
)

Array = NDArray[np.float64]

STEADY, CHANGED, EXPLAINED, OPEN = "steady", "changed", "explained", "open"
UNTOLD = "untold"
FOUND = 4.5  # standard deviations of a change that is found more often than not
COARSE = 0.1  # part, of which a change has to be found for a parameter to be called steady
SMALLEST = 0.01  # relative change that is worth a word, where nobody says another
GONE = 3.0  # standard deviations of a size that is none; fewer would be found by itself
OTHER = 2.0  # standard deviations by which a size is another one
PROPORTIONAL = 0.2  # relative deviation up to which ratios of estimates are taken


@dataclass(frozen=True)
class WearVerdict:
    """What became of a parameter.

    Attributes
    ----------
    name : str
    kind : {"steady", "changed", "explained", "open", "untold"}
        Changed is beyond what the covariates explain; explained is a change that they explain;
        open is one of which it cannot be said; untold is a parameter of which the logs repeat so
        poorly that a change of `COARSE` would not be found.
    logs : ndarray (n,) of int
        Numbers of the logs it is about.
    series : Series
        Logarithms of the estimates, or where those may be negative parts of their median.
    proportional : bool
        Whether they are logarithms.
    found : Explained
        With the covariates.
    bare : Explained
        Without them.
    change : Change or None
        Of kind explained and open: the change without covariates, with its size besides them.
    smallest : float
        Change that was worth a word, as a part.
    least : float
        Change half way that would be found more often than not, as a part.
    """

    name: str
    kind: str
    logs: NDArray[np.int64]
    series: Series
    proportional: bool
    found: Explained
    bare: Explained
    change: Change | None = None
    smallest: float = SMALLEST
    least: float = 0.0

    def percent(self, amount: Any) -> Any:
        """Return a difference of the series as a change in per cent."""
        return 100 * (np.expm1(amount) if self.proportional else np.asarray(amount))

    def percent_deviation(self, change: Change) -> float:
        """Return the standard deviation of the size of a change in per cent."""
        return 100 * change.deviation * (np.exp(change.size) if self.proportional else 1.0)


def verdict(
    name: str,
    time: Array,
    value: Array,
    deviation: Array,
    covariates: Array,
    *,
    false_alarms: float,
    smallest: float = SMALLEST,
) -> WearVerdict:
    """Return what became of a parameter.

    Parameters
    ----------
    name : str
    time, value, deviation : ndarray (n,)
        Of the logs, in the order of time.
    covariates : ndarray (n, q)
        NaN where a log has none: it is left out.
    false_alarms : float
        Probability of a change where there is none.
    smallest : float
        Change that is worth a word, as a part.
    """
    logs = np.flatnonzero(np.isfinite(covariates).all(axis=1) & np.isfinite(value))
    x, s = value[logs], deviation[logs]
    proportional = bool((x > 0).all() and np.median(s / abs(x)) < PROPORTIONAL)
    middle = float(np.median(x if proportional else abs(x)))
    series = Series(
        time[logs],
        np.log(x / middle) if proportional else x / middle,
        s / (x if proportional else middle),
        covariates[logs],
    )
    bare = explain(replace(series, covariates=np.empty((len(logs), 0))), false_alarms=false_alarms)
    found = explain(series, false_alarms=false_alarms) if covariates.shape[1] else bare
    kind, change = STEADY, None
    if any(abs(c.size) >= smallest for c in found.changes):
        kind = CHANGED
    elif any(abs(c.size) >= smallest for c in bare.changes) and not found.changes:
        # of the same shape and at the same place, but with the covariates beside it
        largest = max(bare.changes, key=lambda c: abs(c.size))
        change = size_of(series, largest)
        gone = abs(change.size) < GONE * change.deviation
        other = abs(change.size - largest.size) > OTHER * change.deviation
        kind = EXPLAINED if gone and other else OPEN
    half_way = Change("step", len(logs) // 2, 0, 0, 1.0)
    least = FOUND * size_of(series, half_way).deviation
    if kind == STEADY and not found.changes and least > max(COARSE, smallest):
        kind = UNTOLD
    return WearVerdict(name, kind, logs, series, proportional, found, bare, change, smallest, least)


def fewest_logs(covariates: int) -> int:
    """Return how many logs a trend needs beside that many covariates."""
    return FEWEST + 2 * covariates


def verdicts(
    rows: Sequence[Mapping[str, Any]],
    time: Array,
    covariates: Mapping[str, Array],
    *,
    false_alarms: float,
    smallest: float = SMALLEST,
) -> list[WearVerdict]:
    """Return what became of each parameter.

    Parameters
    ----------
    rows : sequence of mapping
        Of the logs that have estimates, in the order of time.
    time : ndarray (n,)
    covariates : mapping of str to ndarray (n,)
    false_alarms : float
        Probability that any parameter of an axis that does not change is said to.
    smallest : float
        Change that is worth a word, as a part.

    Raises
    ------
    LogError
        If there are too few logs.
    """
    columns = np.column_stack([*covariates.values()]) if covariates else np.empty((len(rows), 0))
    complete = int(np.isfinite(columns).all(axis=1).sum())
    fewest = fewest_logs(columns.shape[1])
    if complete < fewest:
        raise LogError(
            f"{complete} logs have estimates{' and a covariate' if covariates else ''}; a trend "
            f"needs {fewest}"
        )
    names, found = list(rows[0]["estimates"]), []
    options = {"false_alarms": false_alarms / len(names), "smallest": smallest}
    for name in names:
        each = [row["estimates"][name] for row in rows]
        value, sd = (np.array([entry[key] for entry in each]) for key in ("value", "sd"))
        found.append(verdict(name, time, value, sd, columns, **options))
    return found
