"""How the rows of many seeds become one number, with its interval; a function a kind of score.

Each takes rows as in scores.jsonl, all of one parameter of one estimator on one scenario, and the
name of a score; each returns what goes into the pooled row. Lost runs count in all of them but the
consistency of the claim: of an estimate that is not there nothing was claimed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.scoring.case import finite, settling
from flexaxis.experiments.scoring.intervals import (
    FLOOR,
    log_interval,
    mean_interval,
    median_interval,
    spread_interval,
)

Row = Mapping[str, Any]
Pooled = dict[str, Any]
Array = NDArray[np.float64]


def values(rows: Sequence[Row], name: str) -> Array:
    """Return the values of a score where it is defined."""
    return np.array([row[name] for row in rows if row.get(name) is not None], float)


def geometric(rows: Sequence[Row], name: str) -> Pooled:
    """Pool by the geometric mean: what a ratio of two estimators is a ratio of."""
    x = values(rows, name)
    if not x.size:
        return {name: None, f"{name}_interval": None}
    centre = float(np.exp(np.log(np.maximum(x, FLOOR)).mean()))
    return {name: finite(centre), f"{name}_interval": log_interval(x)}


def mean(rows: Sequence[Row], name: str) -> Pooled:
    """Pool by the mean."""
    x = values(rows, name)
    return {
        name: finite(x.mean()) if x.size else None,
        f"{name}_interval": mean_interval(x),
    }


def root_mean_square(rows: Sequence[Row], name: str) -> Pooled:
    """Pool by the root of the mean square."""
    x = values(rows, name)
    within = mean_interval(x**2)
    return {
        name: finite(np.sqrt(np.mean(x**2))) if x.size else None,
        f"{name}_interval": within and [float(np.sqrt(max(0.0, end))) for end in within],
    }


def median(rows: Sequence[Row], name: str) -> Pooled:
    """Pool by the median; a run without the score counts as never, if it could have had it."""
    if not any(row["changed"] and row["never_settled"] is not None for row in rows):
        return {name: None, f"{name}_interval": None}
    x = np.array([np.inf if row[name] is None else row[name] for row in rows], float)
    with np.errstate(invalid="ignore"):  # the mean of a number and never is never
        middle = finite(float(np.median(x)))
    return {name: middle, f"{name}_interval": median_interval(x)}


def count(rows: Sequence[Row], name: str) -> Pooled:
    """Count the runs in which it is so."""
    return {name: sum(bool(row[name]) for row in rows)}


def count_kept(rows: Sequence[Row], name: str) -> Pooled:
    """Count the runs in which it is so, lost ones aside: they are counted already."""
    return {name: sum(bool(row[name]) and not row["diverged"] for row in rows)}


def deviation(bias: str, lost: str) -> Any:
    """Return the pool of a standard deviation.

    Parameters
    ----------
    bias : str
        Score of the mean over the same samples.
    lost : str
        Score that says whether the run was lost by then.
    """

    def pooled(rows: Sequence[Row], name: str) -> Pooled:
        here = [row for row in rows if row[name] is not None]
        std, mean = values(here, name), values(here, bias)
        gone = np.array([bool(row.get(lost)) for row in here])
        return {
            name: finite(scatter(std, mean, gone)) if here else None,
            f"{name}_interval": None if gone.any() else spread_interval(std, mean),
        }

    return pooled


def spread(std: ArrayLike, bias: ArrayLike) -> float:
    """Return the standard deviation over time and seeds about the common mean.

    √(mean std² − (mean bias)²). What is slower than the window belongs to it: taking off the mean
    of each run would make a slow estimator look quiet.

    Parameters
    ----------
    std, bias : (n,) array_like
        Root mean square about zero, and mean, of each run.
    """
    square = np.mean(np.square(np.asarray(std, float)))
    constant = np.mean(np.asarray(bias, float)) ** 2
    if np.isclose(square, constant, rtol=1e-12, atol=0.0):  # a difference of rounding errors
        return 0.0
    return float(np.sqrt(np.maximum(0.0, square - constant)))


def scatter(std: Array, bias: Array, lost: NDArray[np.bool_]) -> float:
    """Return the same where some runs are lost: of the others as `spread`, of these about zero.

    Lost runs sit at one edge, and about their own mean would have no variance at all.
    """
    whole = ~lost
    square = spread(std[whole], bias[whole]) ** 2 * whole.sum() if whole.any() else 0.0
    return float(np.sqrt((square + np.sum(std[lost] ** 2)) / len(std)))


def excess(each: Array, lost: NDArray[np.bool_], biases: Array, information: Array) -> float:
    """Return the mean excess error, without that of the common bias of the runs not lost.

    Parameters
    ----------
    each : ndarray (n,)
        Of each run.
    lost : ndarray (n,) of bool
        Whether a run was lost by then; lost runs count as they are.
    biases : ndarray (n, p)
        [% of nominal].
    information : ndarray (p, p)
        As from `flexaxis.experiments.scoring.excess.information`.
    """
    whole = ~lost
    common = biases[whole].mean(axis=0) if whole.any() else np.zeros(biases.shape[1])
    return float(each.mean() - whole.mean() * (common @ information @ common))


def spread_at_a_time(theta: ArrayLike) -> Array:
    """Return the standard deviation (…) of runs (S, M, …) at one time, pooled over the M times."""
    return np.sqrt(np.var(np.asarray(theta), axis=0, ddof=1).mean(axis=0))


def found(rows: Sequence[Row], name: str) -> Pooled:
    """Pool what findings are worth: the mean over the runs of each part, missed of all faults."""
    parts = [row[name] for row in rows if row.get(name)]
    if not parts:
        return {name: None}
    pooled = {key: mean(parts, key)[key] for key in parts[0]}
    faults = sum(part["faults"] for part in parts)
    missed = sum(part["missed"] for part in parts) / faults if faults else 0.0
    return {name: pooled | {"missed": missed}}


def first(rows: Sequence[Row], name: str) -> Pooled:
    """Keep what is the same in all rows."""
    return {name: rows[0].get(name)}


def settles(relative: Sequence[NDArray[np.float32]], level: float, period: float) -> float | None:
    """Return when the median run comes inside ±level of θ̃/D and stays [s], or None."""
    if not relative:
        return None
    return settling(np.median(np.stack(relative).astype(float), axis=0), level, period)


def rmse(relative: Sequence[NDArray[np.float32]], at: Sequence[int]) -> dict[str, float]:
    """Return the root mean square of θ̃/D over the runs, n samples after onset, by n."""
    if not relative:
        return {}
    runs = np.stack(relative).astype(float)
    return {str(n): float(np.sqrt(np.mean(runs[:, n] ** 2))) for n in at if n < runs.shape[1]}


def efficiency(errors: Mapping[str, float], rows: Sequence[Row]) -> dict[str, float]:
    """Return rmse over the oracle bound with all unknown, n samples after onset; 1 is on it."""
    limits = [row["bound"] for row in rows if row.get("bound")]
    return {
        n: value / float(np.sqrt(np.mean([limit[n] ** 2 for limit in limits])))
        for n, value in errors.items()
        if limits and n in limits[0]
    }
