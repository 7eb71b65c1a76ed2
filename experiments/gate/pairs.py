"""Pair the scores of a base estimator and a candidate estimator for each run."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.comparison.noise_interpolation import SPREADS
from flexaxis.experiments.scoring.score_table import METRICS, SCORES
from flexaxis.sim.errors import FlexaxisError

Array = NDArray[np.float64]

LOST = ("diverged", "never_settled")
"""Kinds of lost runs. Lost runs are counted over all scenarios and judged separately from the
scores. An average of scores over the remaining runs would reward an estimator for losing difficult
runs."""

SIDES = ("base", "candidate")
CASE = ["scenario", "seed"]
KIND = ["scenario", "parameter"]
KEY = [*CASE, "parameter"]
FLAGS = ["changed", "failed", *LOST]
NUMBERS = [*dict.fromkeys([*METRICS, *(bias for bias, _ in SPREADS.values())])]


class Gap(NamedTuple):
    """Missing results of one estimator; if `must_look` is true, the exit status is not 0."""

    side: str
    text: str
    must_look: bool = False


@dataclass(frozen=True, eq=False)
class Paired:
    """Paired scores of the base and the candidate in a comparison.

    Attributes
    ----------
    scores : DataFrame
        One row per score. The columns ``scenario, parameter, metric, margin`` identify the score.
        The columns ``base`` and ``candidate`` contain means over the pairs [unit of the metric], or
        geometric means if ratios are compared. Each entry of the column ``changes`` is an array
        (n,) with one value per run: log(candidate/base) if ratios are compared, and otherwise
        (candidate − base)/``scale``. The value is NaN for runs in which either estimator diverged
        or lacks the score. The column ``scale`` is NaN if ratios are compared.
    lost : DataFrame
        Table that marks lost runs, with one row per scenario and seed. The four Boolean columns,
        such as ``"diverged base"``, mark the lost runs. A run that diverged for either estimator
        does not count as a run that never settled.
    gaps : sequence of Gap
        Missing results of the base or the candidate.
    estimated : mapping of side to set of str
        Parameters that each of the two estimators estimates.
    failed : mapping of side to int
        Number of failed runs of each of the two estimators.
    """

    scores: pd.DataFrame
    lost: pd.DataFrame
    gaps: Sequence[Gap] = ()
    estimated: Mapping[str, set[str]] = field(default_factory=dict)
    failed: Mapping[str, int] = field(default_factory=dict)


def table(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the scores of one estimator in the form that a comparison needs.

    A failed run has rows for all parameters that the scenario identifies. If the estimator
    estimates a parameter in no successful run on a scenario, the function removes the rows for this
    parameter from its failed runs on this scenario.

    Parameters
    ----------
    rows : iterable of mapping, or DataFrame
        One row per run and parameter, with the keys ``scenario, seed, parameter, changed, failed,
        diverged, never_settled``, the names of the scores, and optionally ``hash`` and ``error``.
    """
    frame = pd.DataFrame(rows).reindex(columns=[*KEY, *FLAGS, *NUMBERS, "hash", "error"])
    frame[FLAGS] = frame[FLAGS].eq(True)
    frame[NUMBERS] = frame[NUMBERS].astype(float)
    ran = ~frame["failed"] | frame.groupby("scenario")["failed"].transform("all")
    return frame.merge(frame.loc[ran, KIND].dropna().drop_duplicates()).sort_values(KEY)


def pair(base: pd.DataFrame, candidate: pd.DataFrame, margins: Mapping[str, float]) -> Paired:
    """Pair the scores of the base and the candidate for all common runs.

    Parameters
    ----------
    base, candidate : DataFrame
        Rows from `table`.
    margins : mapping of metric to float
        Smallest relevant relative change in each score to compare.

    Raises
    ------
    FlexaxisError
        If the base and the candidate have fewer than two common seeds, or no common scenario or
        parameter.
    """
    both = base.merge(candidate, on=KEY, suffixes=(" base", " candidate"))
    if both["seed"].nunique() < 2:
        raise FlexaxisError(
            "the base and the candidate have fewer than 2 runs in common: compare estimators that "
            "estimate the same parameter, on the same scenarios and seeds"
        )
    groups, sides = both.groupby(KIND), dict(zip(SIDES, (base, candidate), strict=True))
    scores = [_score(part, *key, *each) for key, part in groups for each in margins.items()]  # type: ignore[call-arg]
    shared = {s: rows[rows["scenario"].isin(both["scenario"])] for s, rows in sides.items()}
    changed = shared["base"].loc[shared["base"]["changed"], KIND].drop_duplicates()
    gaps = [Gap("candidate", f"the candidate does not estimate {parameter} on {scenario}")
            for scenario, parameter in changed.itertuples(index=False)
            if (scenario, parameter) not in groups.groups]  # fmt: skip
    return Paired(
        pd.DataFrame([score for score in scores if score]),
        _lost(both),
        gaps + _lacking(sides),
        {side: {*rows["parameter"]} for side, rows in shared.items()},
        {side: len(rows[rows["failed"]].drop_duplicates(CASE)) for side, rows in sides.items()},
    )


def _lacking(sides: Mapping[str, pd.DataFrame]) -> list[Gap]:
    """Return a `Gap` for each pair of estimator and scenario that lacks runs with common seeds."""
    seeds = set.intersection(*({*rows["seed"]} for rows in sides.values()))
    cases = pd.DataFrame({
        side: rows[rows["seed"].isin(seeds)].drop_duplicates(CASE)["scenario"].value_counts()
        for side, rows in sides.items()
    }).fillna(0)  # fmt: skip
    lacks = cases.rsub(cases.max(axis=1), axis=0).stack()
    return [Gap(side, f"the {side} has {n:.0f} missing runs on {scenario}", side == "candidate")
            for (scenario, side), n in lacks.items() if n]  # fmt: skip


def _lost(both: pd.DataFrame) -> pd.DataFrame:
    """Return a table that marks lost runs per estimator, for parameters that both estimate."""
    columns = [f"{way} {side}" for way in LOST for side in SIDES]
    lost = both.groupby(CASE)[columns].any()
    lost[columns[2:]] &= ~lost[columns[:2]].any(axis=1).to_numpy()[:, None]
    return lost


def _score(
    part: pd.DataFrame, scenario: str, parameter: str, metric: str, margin: float
) -> dict[str, Any]:
    """Return one score of both estimators, or {} if the score is undefined for both of them."""

    def sides(name: str) -> Array:
        return part[[f"{name} base", f"{name} candidate"]].to_numpy(float).T.copy()

    values, score, scale = sides(metric), SCORES[metric], np.nan
    if np.isnan(values).all():
        return {}
    pairs = np.isfinite(values).all(axis=0) & ~sides("diverged").any(axis=0)
    values[:, ~pairs] = np.nan
    if pairs.any():
        if metric in SPREADS:  # std around the mean over all runs of a side
            errors = np.nan_to_num(sides(SPREADS[metric][0]))
            mean = errors[:, pairs].mean(axis=1, keepdims=True)
            values = np.sqrt(np.maximum(values**2 + mean * (mean - 2 * errors), 0.0))
        if score.guard:  # change signs so that the mean of each side is positive
            scale = max(np.sqrt(np.mean(sides("std")[0, pairs] ** 2)), 1e-3 / margin)
            values *= np.sign(np.nanmean(values, axis=1, keepdims=True))
    # values below `zero` count as equal
    logs = values / scale if score.guard else np.log(np.maximum(values, score.zero))
    middle = logs[:, pairs].mean(axis=1) if pairs.any() else np.full(2, np.nan)
    base, candidate = scale * middle if score.guard else np.exp(middle)
    return {
        "scenario": scenario, "parameter": parameter, "metric": metric, "margin": margin,
        "base": base, "candidate": candidate, "changes": logs[1] - logs[0], "scale": scale,
    }  # fmt: skip
