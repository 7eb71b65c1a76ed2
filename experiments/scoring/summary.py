"""Pool the scores of all seeds into one row per scenario, estimator and parameter."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

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

IDENTITY = ("scenario", "hash", "estimator", "parameter", "changed")
POOLED = tuple(score.name for score in SCORES.values() if score.pool is not None)
NUMBERS = (
    "changed",
    *(name for name, kind in kinds().items() if kind != "text"),
    "cost.us_per_sample",
)
"""Columns that the pooling functions may use."""


@dataclass(frozen=True, eq=False)
class Case:
    """The scores of one estimator on one record.

    Attributes
    ----------
    names : tuple of str
        Estimated parameters.
    curve : ndarray (M, p)
        Every tenth estimate, divided by the nominal value.
    near : ndarray (W, p)
        Every estimate around the first fault (`near_fault`), divided by the nominal value. The
        array is empty (0, p) if there is no fault.
    rows : list of dict
        Scores, one row for each parameter.
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
    """Compute the scores of a track, and the curves for its figures.

    Parameters
    ----------
    track : Track
        Estimates and true values of the run.
    identity, cost : mapping
        Columns that each row contains in addition to the scores. The columns of `identity` precede
        the scores, and `cost` is the last column.
    written : Scenario, optional
        Scenario without a random onset. Curves of all runs are shifted to the onset of this
        scenario.
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


Rows: TypeAlias = "Iterable[Mapping[str, Any]] | pd.DataFrame"


def pool_rows(rows: Rows, scenario: Scenario) -> list[dict[str, Any]]:
    """Return the pooled rows of one estimator on one scenario, one for each parameter.

    Parameters
    ----------
    rows : iterable of mapping, or DataFrame
        One row per run and parameter.
    scenario : Scenario
        Scenario of the runs.

    Returns
    -------
    list of dict
        Rows of scores that are pooled as in `scoring.score_table.SCORES`. Each row also contains
        the number of `seeds` and the median `cost`.
    """
    by_name = dict(tuple(_flat(rows).groupby("parameter", sort=False)))
    columns = {name: columns_of(own) for name, own in by_name.items()}
    shared = excess(columns, scenario)
    return [
        dict(own.iloc[0][[*IDENTITY]])
        | {"seeds": len(own), "runs": len(own)}
        | pool_columns(columns[name]) | shared | cost(columns[name])
        for name, own in by_name.items()
    ]  # fmt: skip


def _flat(rows: Rows) -> pd.DataFrame:
    """Return rows as a table sorted by seed; nested mappings become columns such as ``a.b``."""
    frame = rows if isinstance(rows, pd.DataFrame) else pd.json_normalize(list(rows))
    return frame.sort_values("seed", kind="stable") if "seed" in frame else frame


def columns_of(rows: Rows) -> dict[str, Array]:
    """Return the numbers in some rows as columns, in which None becomes NaN.

    Columns of nested mappings have names such as ``a.b``.

    Parameters
    ----------
    rows : iterable of mapping, or DataFrame
        Rows of one parameter.
    """
    frame = rows if isinstance(rows, pd.DataFrame) else pd.json_normalize(list(rows))
    names = frame.reindex(columns=["hash", "estimator"], fill_value="").astype(str)
    points = names.agg(" ".join, axis=1)
    numbers = {name: frame.get(name, np.nan) for name in NUMBERS}
    return {
        "seed": np.asarray(frame.get("seed", range(len(frame))), float),
        "point": points.factorize(sort=True)[0].astype(float),
        **{name: np.broadcast_to(np.asarray(x, float), len(frame)) for name, x in numbers.items()},
    }


def pool_columns(columns: pooling.Columns, names: Iterable[str] | None = None) -> dict[str, Any]:
    """Return the pooled scores of the rows of one parameter.

    The result does not contain the excess error, which depends on all parameters of a case (see
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
    """Return the median computing time per sample [µs]."""
    us = pooling.by(np.median)(columns, "cost.us_per_sample")["cost.us_per_sample"]
    return {"cost": {"us_per_sample": us}}


def excess(by_name: Mapping[str, pooling.Columns], scenario: Scenario) -> dict[str, Any]:
    """Return the pooled excess error and its interval, which are the same for all parameters.

    Parameters
    ----------
    by_name : mapping of str to columns
        Columns of each estimated parameter, for the same runs of one scenario.
    scenario : Scenario
        Scenario of the runs. The common bias applies to the parameters of `identify`. A parameter
        that the estimator does not estimate counts as unbiased.
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
