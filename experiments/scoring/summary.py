"""Pool the scores from all seeds into one row per scenario, estimator and parameter."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.curves import CURVE_STEP, later, near_fault, shifted
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import by_seed, mean_interval, pseudo_values
from flexaxis.experiments.scoring.score_table import SCORES, rows
from flexaxis.experiments.scoring.score_table import columns as kinds
from flexaxis.experiments.scoring.scores import Track, finite
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

POOLED = tuple(score.name for score in SCORES.values() if score.pool is not None)
NUMBERS = (
    "changed",
    *(name for name, kind in kinds().items() if kind != "text"),
    "cost.us_per_sample",
    "cost.seconds",
    "onset",
)
"""Names of the numeric columns, in the order in which the columns are stored."""


@dataclass(frozen=True, eq=False)
class Case:
    """The scores of one estimator on one record.

    Attributes
    ----------
    names : tuple of str
        Estimated parameters.
    curve : ndarray (M, p)
        Estimates at every tenth sample, divided by the nominal values.
    near : ndarray (W, p)
        Estimates at all samples around the first fault (`near_fault`), divided by the nominal
        values. Without a fault, the array has the shape (0, p).
    rows : list of dict
        Scores of the run, with one row for each parameter.
    theta : ndarray (N, p) or None
        All estimates.
    """

    names: tuple[str, ...]
    curve: NDArray[np.float32]
    near: NDArray[np.float32]
    rows: Sequence[dict[str, Any]] = ()
    theta: NDArray[np.float64] | None = None


def scored(
    track: Track, *, identity: Mapping[str, Any], cost: Mapping[str, Any],
    written: Scenario | None = None,
) -> Case:  # fmt: skip
    """Compute the scores of a run, and its trajectories for figures.

    Parameters
    ----------
    track : Track
        Estimates and true values of the run.
    identity, cost : mapping
        Columns that each row contains in addition to the scores. The columns of `identity` precede
        the scores, and `cost` is the last column.
    written : Scenario, optional
        Scenario before its random onset is drawn. The trajectories of all runs are shifted to the
        fault onset in `written`.
    """
    late = later(track.scenario, written or track.scenario)
    with np.errstate(over="ignore", invalid="ignore"):  # a diverged run may have any values
        shape = shifted(track.theta, late)[::CURVE_STEP] / track.nominal
        near = track.theta[near_fault(track.scenario)] / track.nominal
        return Case(
            names=track.names,
            curve=shape.astype(np.float32),
            near=near.astype(np.float32),
            rows=[dict(identity) | row | {"cost": dict(cost)} for row in rows(track)],
            theta=track.theta,
        )


def pool_rows(rows: pd.DataFrame, scenario: Scenario) -> list[dict[str, Any]]:
    """Return the pooled scores of one estimator on one scenario, with one row per parameter.

    Parameters
    ----------
    rows : DataFrame
        One row per run and parameter.
    scenario : Scenario
        Scenario of the runs.

    Returns
    -------
    list of dict
        Pooled scores, as defined in `scoring.score_table.SCORES`, with one row per parameter. Each
        row also contains ``scenario, parameter, changed`` and ``seeds`` (the number of seeds).
    """
    columns = {name: columns_of(own) for name, own in rows.groupby("parameter", sort=False)}
    shared = excess(columns, scenario)
    return [
        {"scenario": scenario.name, "parameter": name, "changed": bool(own["changed"][0]),
         "seeds": len(own["seed"])} | pool_columns(own) | shared
        for name, own in columns.items()
    ]  # fmt: skip


def columns_of(rows: pd.DataFrame) -> dict[Any, Array]:
    """Return the scores of one parameter as arrays, in which NaN replaces None.

    Parameters
    ----------
    rows : DataFrame
        One row per run. The optional column ``point`` contains the sweep point of each run. A
        missing column is filled with NaN. Without the column ``point``, all runs belong to the same
        sweep point.
    """
    numbers = rows.reindex(columns=["seed", "point", *NUMBERS]).astype(float)
    return {name: values.to_numpy() for name, values in numbers.items()}


def pool_columns(columns: pooling.Columns, names: Iterable[str] | None = None) -> dict[str, Any]:
    """Return the pooled scores of one parameter.

    The result does not contain the excess error, which depends on all parameters of a run (see
    `excess`).

    Parameters
    ----------
    columns : mapping of str to ndarray (n,)
        Columns for the functions in `flexaxis.experiments.scoring.pooling`.
    names : iterable of str, optional
        Scores to pool (default: all).
    """
    pooled: dict[str, Any] = {}
    with np.errstate(over="ignore", invalid="ignore"):
        for name in POOLED if names is None else names:
            pool = SCORES[name].pool
            if pool is not None and name != "excess":
                pooled |= pool(columns, name)
    return pooled


def cost(columns: pooling.Columns) -> dict[str, Any]:
    """Return the median computing time per sample over all runs [µs]."""
    us = pooling.by(np.median)(columns, "cost.us_per_sample")["cost.us_per_sample"]
    return {"cost": {"us_per_sample": us}}


def excess(by_name: Mapping[Any, pooling.Columns], scenario: Scenario) -> dict[str, Any]:
    """Return the pooled excess error and its confidence interval, which all parameters share.

    Parameters
    ----------
    by_name : mapping of str to columns
        Score columns of each estimated parameter, for the same runs of one scenario.
    scenario : Scenario
        Scenario of the runs. The excess error depends on the estimation biases of all identified
        parameters. The bias of a parameter that the estimator does not estimate counts as zero.
    """
    first = next(iter(by_name.values()))
    each, lost = first["excess"], first["lost_before"] > 0
    M = information(scenario)
    if M is None or np.isnan(each).any():
        return {"excess": None, "excess_interval": None}
    none = np.zeros(len(each))
    biases = np.column_stack(
        [np.nan_to_num(by_name[n]["bias"]) if n in by_name else none for n in scenario.identify]
    )

    def statistic(runs: Any) -> float:
        return pooling.excess(each[runs], lost[runs], biases[runs], M)

    within = None
    if not lost.any():
        values = pseudo_values(statistic, len(each))
        within = mean_interval(by_seed(values, first["seed"], first["point"]))
    return {
        "excess": finite(max(0.0, statistic(slice(None)))),
        "excess_interval": within and [max(0.0, end) for end in within],
    }
