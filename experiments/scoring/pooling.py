"""Pool the scores of all seeds into one row per scenario, estimator and parameter."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring import pools
from flexaxis.experiments.scoring.case import Track, finite, relative_error
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import mean_interval, pseudo_values
from flexaxis.experiments.scoring.table import SCORES, rows
from flexaxis.experiments.scoring.theory import RMSE_AT
from flexaxis.experiments.scoring.theta import true_theta
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

BAND = (10.0, 50.0, 90.0)  # percentiles of the trajectories
CURVE_STEP = 10  # samples from one kept point of a trajectory to the next


@dataclass(frozen=True)
class Case:
    """What is kept of one estimator on one record.

    Attributes
    ----------
    scenario, estimator : str
    seed : int
    names : tuple of str
        Estimated parameters.
    rows : list of dict
        Scores, one row for each parameter, as they stand in scores.jsonl.
    curve : ndarray (M, p)
        Every tenth estimate over its nominal value.
    relative : dict of str to ndarray (n,)
        θ̃/D in the first scored window of each changed parameter.
    theta : ndarray (N, p) or None
        All estimates, where they were asked for.
    """

    scenario: str
    estimator: str
    seed: int
    names: tuple[str, ...]
    rows: list[dict[str, Any]]
    curve: NDArray[np.float32]
    relative: dict[str, NDArray[np.float32]]
    theta: NDArray[np.float64] | None = None


def scored(
    track: Track,
    *,
    estimator: str,
    seed: int,
    identity: Mapping[str, Any],
    cost: Mapping[str, Any],
    whole: bool = False,
) -> Case:
    """Return the case of a track: its rows, and what its figures are made of.

    Parameters
    ----------
    track : Track
    estimator : str
        As typed.
    seed : int
    identity, cost : mapping
        What stands in each row before and after the scores.
    whole : bool
        Whether to keep all estimates.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a lost run may hold anything
        relative = relative_error(track)
        return Case(
            scenario=track.scenario.name,
            estimator=estimator,
            seed=seed,
            names=track.names,
            rows=[dict(identity) | row | {"cost": dict(cost)} for row in rows(track)],
            curve=(track.theta[::CURVE_STEP] / track.nominal).astype(np.float32),
            relative={name: error.astype(np.float32) for name, error in relative.items()},
            theta=track.theta if whole else None,
        )


def case_of(own: Sequence[dict[str, Any]], trace: Any = None) -> Case:
    """Return a case from its rows, without trajectories unless there is a trace."""
    first = own[0]
    return Case(
        scenario=first["scenario"],
        estimator=first["estimator"],
        seed=first["seed"],
        names=tuple(row["parameter"] for row in own),
        rows=list(own),
        curve=np.empty((0, 0), np.float32) if trace is None else trace.curve,
        relative={} if trace is None else dict(trace.relative),
    )


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
        The scores as `flexaxis.experiments.scoring.table.SCORES` pools them, `seeds` their number;
        `t63` and `t90` are those of the median run; `rmse` maps samples after onset to the root
        mean square of θ̃/D, `efficiency` the same over the bound; `cost` is the median.
    curves : list of Curve
    """
    groups: dict[tuple[str, str], list[Case]] = defaultdict(list)
    for case in cases:
        groups[case.rows[0]["hash"], case.estimator].append(case)
    by_hash = {scenario.hash: scenario for scenario in scenarios}
    pooled: list[dict[str, Any]] = []
    curves = []
    for (key, _), group in groups.items():
        pooled += pool_group(group, by_hash[key])
        curves.append(_curve(group, by_hash[key]))
    return pooled, curves


def pool_group(group: Sequence[Case], scenario: Scenario) -> list[dict[str, Any]]:
    """Return the pooled rows of one estimator on one scenario, one for each parameter."""
    found = []
    for i, name in enumerate(group[0].names):
        errors = [case.relative[name] for case in group if name in case.relative]
        found.append(pool_rows([c.rows[i] for c in group], errors, period=scenario.period))
    excess = _excess(group, scenario)
    return [row | excess for row in found]


def _excess(group: Sequence[Case], scenario: Scenario) -> dict[str, Any]:
    """Return the pooled excess error with its interval, the same for all parameters."""
    each, lost, biases = excess_runs([case.rows for case in group], scenario)
    M = information(scenario)
    if M is None or np.isnan(each).any():
        return {"excess": None, "excess_interval": None}

    def statistic(index: NDArray[np.intp]) -> float:
        return pools.excess(each[index], lost[index], biases[index], M)

    every = np.arange(len(each))
    within = None if lost.any() else mean_interval(pseudo_values(statistic, len(each)))
    return {
        "excess": finite(max(0.0, statistic(every))),
        "excess_interval": within and [max(0.0, end) for end in within],
    }


def excess_runs(
    runs: Sequence[Sequence[Mapping[str, Any]]], scenario: Scenario
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Return of each run (n) its excess error, whether it was lost by then, and its biases (n, p).

    Parameters
    ----------
    runs : sequence of sequence of mapping
        The rows of each run, one for each parameter.
    scenario : Scenario
        The biases are those of its `identify` [% of nominal].
    """
    each = [np.nan if rows[0]["excess"] is None else rows[0]["excess"] for rows in runs]
    lost = [bool(rows[0]["lost_before"]) for rows in runs]
    by_name = [{row["parameter"]: row["bias"] or 0.0 for row in rows} for rows in runs]
    biases = [[found.get(name, 0.0) for name in scenario.identify] for found in by_name]
    return np.array(each, float), np.array(lost, bool), np.array(biases, float)


def pool_rows(
    rows: Sequence[dict[str, Any]], relative: Sequence[NDArray[np.float32]] = (), *, period: float
) -> dict[str, Any]:
    """Return one pooled row, as from `pool`, of the rows of one parameter over seeds.

    Parameters
    ----------
    rows : sequence of dict
        As in scores.jsonl.
    relative : sequence of ndarray
        θ̃/D of the runs; `t63`, `t90`, `rmse` and `efficiency` are made of it.
    period : float
        Sampling period [s].
    """
    first = rows[0]
    identity = ("scenario", "hash", "estimator", "parameter", "changed")
    found: dict[str, Any] = {key: first[key] for key in identity} | {"seeds": len(rows)}
    with np.errstate(over="ignore", invalid="ignore"):
        for score in SCORES.values():
            if score.pool is not None:
                found |= score.pool(rows, score.name)
        errors = pools.rmse(relative, RMSE_AT)
    return found | {
        "t63": pools.settles(relative, 0.37, period),
        "t90": pools.settles(relative, 0.10, period),
        "rmse": errors,
        "efficiency": pools.efficiency(errors, rows),
        "cost": {"us_per_sample": finite(np.median([r["cost"]["us_per_sample"] for r in rows]))},
    }


def _curve(group: Sequence[Case], scenario: Scenario) -> Curve:
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
