"""Pool the scores of all seeds into one row per scenario, estimator and parameter.

Lost runs are counted beside the scores, never averaged into them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.harness import CURVE_STEP, Case
from flexaxis.experiments.scoring.case import finite
from flexaxis.experiments.scoring.theory import RMSE_AT
from flexaxis.experiments.theta import true_theta
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

BAND = (10.0, 50.0, 90.0)  # percentiles of the trajectories
MANY = 5000  # values from which on no resampling is needed for the interval of their mean


@dataclass(frozen=True)
class Curve:
    """Trajectories of one estimator on one scenario, over all seeds, over nominal.

    `truth`, `low`, `median`, `high` are (M, p), `time` is (M,) [s]; low and high are the 10th and
    90th percentile.
    """

    scenario: str
    estimator: str
    names: tuple[str, ...]
    time: Array
    truth: Array
    low: Array
    median: Array
    high: Array


def pool(
    cases: Iterable[Case], scenarios: Sequence[Scenario]
) -> tuple[list[dict[str, Any]], list[Curve]]:
    """Return the pooled rows and the trajectories of all cases.

    Returns
    -------
    rows : list of dict
        `lag`, `std` and `bias` are means over the runs that are not lost, with 95 % bootstrap
        intervals in `lag_interval` and `std_interval`; `t10` is the median with never settled
        runs counted as infinite; `t63` and `t90` are those of the median run; `rmse` maps
        samples after onset to the root mean square of θ̃/D; `diverged` and `never_settled` count.
    curves : list of Curve
    """
    groups: dict[tuple[str, str], list[Case]] = defaultdict(list)
    for case in cases:
        groups[case.scenario, case.estimator].append(case)
    by_name = {scenario.name: scenario for scenario in scenarios}
    rows: list[dict[str, Any]] = []
    curves = []
    for (name, _), group in groups.items():
        columns = range(len(group[0].names))
        with np.errstate(over="ignore", invalid="ignore"):  # runs that are all but lost
            rows += [_pooled(group, i, by_name[name].period) for i in columns]
        curves.append(_curve(group, by_name[name]))
    return rows, curves


def _pooled(group: list[Case], i: int, period: float) -> dict[str, Any]:
    rows = [case.rows[i] for case in group]
    alive = [case.relative for case in group if not case.rows[i]["diverged"]]
    name = rows[0]["parameter"]
    return pool_rows(rows, [errors[name] for errors in alive if name in errors], period=period)


def pool_rows(
    rows: Sequence[dict[str, Any]], relative: Sequence[NDArray[np.float32]] = (), *, period: float
) -> dict[str, Any]:
    """Return one pooled row, as from `pool`, of the rows of one parameter over seeds.

    Parameters
    ----------
    rows : sequence of dict
        As in scores.jsonl.
    relative : sequence of ndarray
        θ̃/D of the runs that are not lost; `t63`, `t90`, `rmse` and `efficiency` are made of it.
    period : float
        Sampling period [s].
    """
    kept = [row for row in rows if not row["diverged"]]
    first = rows[0]
    scores = [row["score"] for row in kept if row.get("score") is not None]
    lags = [row["lag"] for row in kept if row["lag"] is not None]
    return {
        "scenario": first["scenario"],
        "hash": first["hash"],
        "estimator": first["estimator"],
        "parameter": first["parameter"],
        "changed": first["changed"],
        "seeds": len(rows),
        "lag": finite(np.mean(lags)) if lags else None,
        "lag_interval": interval(lags),
        "t10": _median_time([row["t10"] for row in kept]) if first["changed"] else None,
        "t63": settling(relative, 0.37, period),
        "t90": settling(relative, 0.10, period),
        "std": _spread(kept),
        "std_interval": _std_interval(kept),
        "bias": _mean(kept, "bias"),
        "cross_talk": _root_mean_square(kept, "cross_talk"),
        "rmse": (errors := rmse(relative)),
        "efficiency": efficiency(errors, kept),
        "score": finite(np.mean(scores)) if scores else None,
        "score_interval": interval(scores),
        "nees": _mean(kept, "nees"),
        "nees_interval": interval(_values(kept, "nees").tolist()),
        "detection": detection(kept),
        "diverged": sum(row["diverged"] for row in rows),
        "never_settled": sum(bool(row["never_settled"]) for row in rows),
        "cost": {"us_per_sample": float(np.median([r["cost"]["us_per_sample"] for r in rows]))},
    }


def interval(values: Sequence[float], statistic: Any = np.mean) -> list[float] | None:
    """Return the 95 % bootstrap interval over seeds, or None for fewer than two of them.

    The resampling is seeded, so that the same scores give the same interval. The mean of very many
    values is normal: there resampling would only take time.
    """
    from scipy.stats import bootstrap

    if len(values) < 2 or not np.isfinite(values).all():
        return None
    if len(values) > MANY and statistic is np.mean:
        half = 1.96 * np.std(values, ddof=1) / np.sqrt(len(values))
        return [float(np.mean(values) - half), float(np.mean(values) + half)]
    if np.ptp(values) == 0:  # a bootstrap of equal values is that value
        return [float(values[0])] * 2
    found = bootstrap(
        (np.asarray(values),),
        statistic,
        n_resamples=2000,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return [float(found.low), float(found.high)]


def settling(relative: Sequence[NDArray[np.float32]], level: float, period: float) -> float | None:
    """Return when the median run comes inside ±level of θ̃/D and stays [s], or None."""
    if not relative:
        return None
    middle = np.abs(np.median(np.stack(relative).astype(float), axis=0))
    outside = np.flatnonzero(~(middle <= level))
    settled = 0 if not outside.size else int(outside[-1]) + 1
    return None if settled == len(middle) else settled * period


def rmse(relative: Sequence[NDArray[np.float32]]) -> dict[str, float]:
    """Return the root mean square of θ̃/D over the runs, n samples after onset, by n."""
    if not relative:
        return {}
    runs = np.stack(relative).astype(float)
    return {str(n): float(np.sqrt(np.mean(runs[:, n] ** 2))) for n in RMSE_AT if n < runs.shape[1]}


def efficiency(errors: dict[str, float], rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return rmse over the oracle Cramér–Rao bound, n samples after onset; 1 is perfect."""
    limits = [row["bound"] for row in rows if row.get("bound")]
    return {
        n: value / float(np.sqrt(np.mean([limit[n] ** 2 for limit in limits])))
        for n, value in errors.items()
        if limits and n in limits[0]
    }


def detection(rows: list[dict[str, Any]]) -> dict[str, float | None] | None:
    """Return alarms and false alarms a run, missed faults a run, mean delay [s], share isolated."""
    found = [row["detection"] for row in rows if row.get("detection")]
    return {key: _mean(found, key) for key in found[0]} if found else None


def _median_time(times: Sequence[float | None]) -> float | None:
    if not times:
        return None
    middle = float(np.median([np.inf if time is None else time for time in times]))
    return middle if np.isfinite(middle) else None


def _values(rows: list[dict[str, Any]], key: str) -> Array:
    return np.array([row[key] for row in rows if row.get(key) is not None], float)


def _mean(rows: list[dict[str, Any]], key: str) -> float | None:
    values = _values(rows, key)
    return finite(values.mean()) if values.size else None


def _root_mean_square(rows: list[dict[str, Any]], key: str) -> float | None:
    values = _values(rows, key)
    return finite(np.sqrt(np.mean(values**2))) if values.size else None


def _spread(rows: list[dict[str, Any]]) -> float | None:
    """Return √(mean std² − mean bias²): a row's std is about zero, the spread is not."""
    std, bias = _values(rows, "std"), _values(rows, "bias")
    if not std.size:
        return None
    square, constant = np.mean(std**2), np.mean(bias**2)
    if np.isclose(square, constant, rtol=1e-12, atol=0.0):  # a difference of rounding errors
        return 0.0
    return finite(np.sqrt(np.maximum(0.0, square - constant)))


def _std_interval(rows: list[dict[str, Any]]) -> list[float] | None:
    std, bias = _values(rows, "std"), _values(rows, "bias")
    within = interval(np.maximum(0.0, std**2 - bias**2).tolist())
    return None if within is None else [float(np.sqrt(end)) for end in within]


def _curve(group: list[Case], scenario: Scenario) -> Curve:
    names = group[0].names
    nominal = true_theta(names, scenario.nominal.as_array())
    truth = true_theta(names, scenario.true_parameters()) / nominal
    runs = np.stack([case.curve for case in group]).astype(float)
    with np.errstate(all="ignore"):  # a lost run may hold anything
        low, median, high = np.percentile(np.where(np.isnan(runs), np.inf, runs), BAND, axis=0)
    return Curve(
        scenario=scenario.name,
        estimator=group[0].estimator,
        names=names,
        time=scenario.times[::CURVE_STEP],
        truth=truth[::CURVE_STEP],
        low=low,
        median=median,
        high=high,
    )
