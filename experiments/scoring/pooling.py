"""Pool a score from many seeds into one number with a confidence interval.

There is one pooling function for each kind of score. A pooling function receives the columns for
one parameter of one estimator on one scenario, and the name of a score. A pooling function returns
a dict with the pooled score and, if available, a confidence interval. A column is an array with one
number per run, in the order of the seeds. In a column, NaN means undefined, 1 means true, and 0
means false. The columns include ``seed`` and ``point`` (the sweep point). Confidence intervals need
both, because only runs with different seeds are independent
(`flexaxis.experiments.scoring.intervals`). Consistency scores exclude diverged runs, because no
covariance is reported for these runs. All other scores include diverged runs.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.scoring.intervals import (
    FLOOR,
    by_seed,
    mean_interval,
    median_interval,
    rate_interval,
    spread_interval,
    t_interval,
)
from flexaxis.experiments.scoring.scores import finite

Array = NDArray[np.float64]
Columns = Mapping[str, Array]
Pooled = dict[str, Any]
Pool = Callable[[Columns, str], Pooled]


def values(columns: Columns, name: str) -> Array:
    """Return the values of a score in all runs in which the score is defined."""
    x = columns[name]
    return x[~np.isnan(x)]


def by(statistic: Callable[[Array], float]) -> Pool:
    """Return a pooling function that applies a statistic, such as np.max, to all values."""

    def pooled(columns: Columns, name: str) -> Pooled:
        x = values(columns, name)
        return {name: finite(float(statistic(x))) if x.size else None}

    return pooled


def _drawn(columns: Columns, where: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the seeds and sweep points of the selected runs."""
    return columns["seed"][where], columns["point"][where]


def _through(of: Callable[[Array], Array], back: Callable[[Any], Any], within: Any) -> Pool:
    """Return a pooling function that computes the mean of transformed values.

    Parameters
    ----------
    of, back : callable
        Transformation of the values, and inverse transformation of the mean and of its interval.
    within : callable
        Function that computes a confidence interval for the mean, such as `mean_interval`.
    """

    def pooled(columns: Columns, name: str) -> Pooled:
        x = of(values(columns, name))
        ends = within(by_seed(x, *_drawn(columns, ~np.isnan(columns[name]))))
        return {
            name: finite(float(back(np.mean(x)))) if x.size else None,
            f"{name}_interval": ends and [float(back(end)) for end in ends],
        }

    return pooled


geometric = _through(lambda x: np.log(np.maximum(x, FLOOR)), np.exp, t_interval)
"""Pool a score by its geometric mean, because comparisons of estimators use ratios."""

mean = _through(np.asarray, np.asarray, mean_interval)
"""Pool a score by its arithmetic mean."""

root_mean_square = _through(np.square, lambda x: np.sqrt(max(0.0, x)), mean_interval)
"""Pool a score by its root mean square."""


def median(columns: Columns, name: str) -> Pooled:
    """Pool a settling time by its median; the time of a run that never settles is infinite."""
    could = (columns["changed"] > 0) & ~np.isnan(columns["never_settled"])
    if not could.any():
        return {name: None, f"{name}_interval": None}
    x = np.where(np.isnan(columns[name]), np.inf, columns[name])
    with np.errstate(invalid="ignore"):  # the mean of a number and infinity is infinity
        middle = finite(float(np.median(x)))
    return {name: middle, f"{name}_interval": median_interval(x, columns["seed"], columns["point"])}


def count(columns: Columns, name: str) -> Pooled:
    """Count the runs in which the score is true."""
    return {name: int(np.sum(columns[name] > 0))}


def count_kept(columns: Columns, name: str) -> Pooled:
    """Count the runs in which the score is true, excluding runs that diverged."""
    return {name: int(np.sum((columns[name] > 0) & ~(columns["diverged"] > 0)))}


def deviation(bias: str, lost: str) -> Pool:
    """Return a pooling function for a standard deviation.

    Parameters
    ----------
    bias : str
        Name of the score that contains the mean error over the evaluated samples.
    lost : str
        Name of the score that is true if the run diverged before the last evaluated sample.
    """

    def pooled(columns: Columns, name: str) -> Pooled:
        here = ~np.isnan(columns[name])
        std, mean, gone = columns[name][here], columns[bias][here], columns[lost][here] > 0
        return {
            name: finite(spread(std, mean, gone)) if here.any() else None,
            f"{name}_interval": None
            if gone.any()
            else spread_interval(std, mean, *_drawn(columns, here)),
        }

    return pooled


def parts(names: Iterable[str]) -> Pool:
    """Return a pooling function that computes the mean of each part of a score."""

    def pooled(columns: Columns, name: str) -> Pooled:
        each = {part: values(columns, f"{name}.{part}") for part in names}
        means = {part: finite(float(x.mean())) for part, x in each.items() if x.size}
        return {name: means or None}

    return pooled


def detections(names: Sequence[str]) -> Pool:
    """Return a pooling function for the detection scores, most of which are averaged.

    ``missed`` is the fraction of faults that the estimator does not report. All faults in a failed
    run count as missed. ``calm`` is the total time outside all fault windows [s], during which
    every alarm is false. ``false_alarms_interval`` is the confidence interval for the number of
    false alarms per 1000 s.
    """

    def pooled(columns: Columns, name: str) -> Pooled:
        part = {key: values(columns, f"{name}.{key}") for key in names}
        if not part["alarms"].size:
            return {name: None}
        means = {key: finite(float(x.mean())) if x.size else None for key, x in part.items()}
        failed = np.sum(columns["failed"] > 0) * part["faults"].mean()
        faults, missed = part["faults"].sum() + failed, part["missed"].sum() + failed
        seeds, calm = columns["seed"][~np.isnan(columns[f"{name}.calm"])], part["calm"].sum()
        return {
            name: means | {
                "missed": float(missed / faults) if faults else 0.0, "calm": float(calm),
                "false_alarms_interval": rate_interval(part["false_alarms"], calm / 1000, seeds),
            }
        }  # fmt: skip

    return pooled


def spread(std: ArrayLike, bias: ArrayLike, lost: Any = False) -> float:
    """Return the standard deviation over time and seeds around the mean of all runs.

    The formula √(mean std² − (mean bias)²) subtracts the mean of all runs. If the mean of each run
    were subtracted, slow variations of the estimates would disappear, which would favour slow
    estimators. In a diverged run, the estimates are replaced by a constant plausibility limit, so
    subtracting a mean would remove the whole error. Therefore no mean is subtracted from diverged
    runs.

    Parameters
    ----------
    std, bias : (n,) array_like
        Root mean square and mean of the error in each run.
    lost : (n,) array_like of bool, optional
        True for each run that diverged before the last evaluated sample.
    """
    square, whole = np.mean(np.square(std)), ~np.broadcast_to(lost, np.shape(std))
    constant = whole.mean() * np.mean(np.asarray(bias)[whole]) ** 2 if whole.any() else 0.0
    if np.isclose(square, constant, rtol=1e-12, atol=0.0):  # a difference of rounding errors
        return 0.0
    return float(np.sqrt(np.maximum(0.0, square - constant)))


def excess(each: Array, lost: NDArray[np.bool_], biases: Array, information: Array) -> float:
    """Return the mean excess error minus the contribution of the mean bias of all runs.

    Parameters
    ----------
    each : ndarray (n,)
        Excess error of each run.
    lost : ndarray (n,) of bool
        True for each run that diverged. The mean bias is not subtracted from diverged runs.
    biases : ndarray (n, p)
        Bias of each parameter in each run [% of nominal].
    information : ndarray (p, p)
        Matrix M of the excess error, from `flexaxis.experiments.scoring.excess.information`.
    """
    whole = ~lost
    common = biases[whole].mean(axis=0) if whole.any() else np.zeros(biases.shape[1])
    return float(each.mean() - whole.mean() * (common @ information @ common))
