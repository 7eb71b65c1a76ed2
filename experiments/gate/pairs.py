"""Pair the scores of base and candidate, run by run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.comparison.matching import SPREADS
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.experiments.scoring.score_table import METRICS, SCORES
from flexaxis.sim.errors import FlexaxisError

Array = NDArray[np.float64]

LOST = ("diverged", "never_settled")
"""Ways to lose a run. They are counted over all scenarios, apart from each other and from scores:
an average over the runs that are left would reward an estimator for losing the hard ones."""

SIDES = ("base", "candidate")
KEY = ["scenario", "seed", "parameter"]
FLAGS = ["changed", "failed", *LOST]
NUMBERS = [*dict.fromkeys([*METRICS, *(bias for bias, _ in SPREADS.values())])]


class Lack(NamedTuple):
    """Cases of a scenario that `side` lacks; `unreadable` if it cannot read the scenario."""

    scenario: str
    side: str
    cases: int
    unreadable: bool = False


@dataclass(frozen=True, eq=False)
class Paired:
    """All that a comparison is made of.

    Attributes
    ----------
    scores : DataFrame
        One row a score: ``scenario, parameter, metric``; ``seeds`` (n,), and ``values`` (2, n) of
        base and candidate [unit of the metric], NaN where either side diverged or has no score;
        ``changes`` (n,), log(candidate/base) or (candidate − base)/``scale``; ``scale``, NaN where
        ratios are compared; ``bias``, of a standard deviation the mean errors of both sides [%].
    lost : DataFrame
        By scenario and seed: whether the run was lost, columns ``"diverged base"`` and so on. A
        run that diverged on either side does not count as never settled.
    missing : sequence of (scenario, parameter)
        Changed parameters that the base estimates, and the candidate does not.
    estimated : mapping of side to sequence of str
        Parameters that base and candidate estimate.
    lacking : sequence of Lack
    failed : mapping of side to int
        Cases that failed.
    """

    scores: pd.DataFrame
    lost: pd.DataFrame
    missing: Sequence[tuple[str, str]] = ()
    estimated: Mapping[str, Sequence[str]] = field(default_factory=dict)
    lacking: Sequence[Lack] = ()
    failed: Mapping[str, int] = field(default_factory=dict)


def table(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the rows of one estimator as they are compared, by scenario, seed and parameter.

    Parameters
    ----------
    rows : iterable of mapping, or DataFrame
        One row a run and parameter: ``scenario, seed, parameter, changed, failed, diverged,
        never_settled``, the scores, and optionally ``hash`` and ``error``.
    """
    frame = pd.DataFrame(rows).reindex(columns=[*KEY, *FLAGS, *NUMBERS, "hash", "error"])
    frame = frame[frame["parameter"].notna()]  # without a parameter, there was no record
    frame[FLAGS] = frame[FLAGS].eq(True)
    frame[NUMBERS] = frame[NUMBERS].astype(float)
    return frame.set_index(KEY).sort_index()


def pair(base: pd.DataFrame, candidate: pd.DataFrame, margins: Mapping[str, float]) -> Paired:
    """Return what base and candidate scored on the runs common to both.

    Parameters
    ----------
    base, candidate : DataFrame
        As from `table`.
    margins : mapping of metric to float
        What is compared, and how large a change matters.

    Raises
    ------
    FlexaxisError
        If no scenario, seed and parameter is common to both.
    """
    sides = dict(zip(SIDES, (base, candidate), strict=True))
    kinds = {side: _estimated(rows) for side, rows in sides.items()}
    common = kinds["base"].intersection(kinds["candidate"])
    both = base.add_suffix(" base").join(candidate.add_suffix(" candidate"), how="inner")
    both = both[both.index.droplevel("seed").isin(common)]
    if both.empty:
        names = (", ".join(rows.index.unique("parameter")) for rows in (base, candidate))
        raise FlexaxisError(
            "base and candidate have no run in common. They estimate {} and {}: compare "
            "estimators that share a parameter, on the same scenarios and seeds".format(*names)
        )
    shared = {s: kind[kind.isin(both.index.unique("scenario"), 0)] for s, kind in kinds.items()}
    changed = base.index[base["changed"]].droplevel("seed")
    groups = both.groupby(level=["scenario", "parameter"])
    scores = [_score(part, key[0], key[1], m, margins[m]) for key, part in groups for m in margins]
    return Paired(
        pd.DataFrame([score for score in scores if score]),
        _lost(both),
        [kind for kind in shared["base"].difference(common) if kind in changed],
        {side: list(kind.unique("parameter")) for side, kind in shared.items()},
        _lacking(sides),
        {side: _cases(rows[rows["failed"]]).size for side, rows in sides.items()},
    )


def _estimated(rows: pd.DataFrame) -> pd.MultiIndex:
    """Return the scenarios with the parameters that are estimated there.

    A failed case has rows of all parameters of the scenario: they count where no other case tells.
    """
    ran = rows.index[~rows["failed"]]
    untold = rows.index[~rows.index.isin(ran.unique("scenario"), level="scenario")]
    return ran.append(untold).droplevel("seed").unique()


def _lacking(sides: Mapping[str, pd.DataFrame]) -> list[Lack]:
    """Return what one side alone was run on, of the seeds on which both were run at all."""
    base, candidate = map(_cases, sides.values())
    seeds = base.unique("seed").intersection(candidate.unique("seed"))
    gone = {"base": candidate.difference(base), "candidate": base.difference(candidate)}
    lacks = []
    for side, runs in gone.items():
        counts = runs[runs.isin(seeds, "seed")].to_frame().groupby(level="scenario").size()
        lacks += [Lack(str(name), side, int(cases)) for name, cases in counts.items()]
    return lacks


def _cases(rows: pd.DataFrame) -> pd.MultiIndex:
    return rows.index.droplevel("parameter").unique()


def _lost(both: pd.DataFrame) -> pd.DataFrame:
    """Return which runs each side lost, in any of the common parameters."""
    columns = [f"{way} {side}" for way in LOST for side in SIDES]
    lost = both[columns].groupby(level=["scenario", "seed"]).any()
    lost[columns[2:]] &= ~lost[columns[:2]].any(axis=1).to_numpy()[:, None]
    return lost


def _score(
    part: pd.DataFrame, scenario: str, parameter: str, metric: str, margin: float
) -> dict[str, Any]:
    """Return one score; nothing where it is not defined, such as the lag of what is constant."""
    values, score, scale, bias = _sides(part, metric), SCORES[metric], np.nan, None
    if not np.isfinite(values).any():
        return {}
    pairs = np.isfinite(values).all(axis=0) & ~_sides(part, "diverged").any(axis=0)
    values[:, ~pairs] = np.nan
    if pairs.any():
        if metric in SPREADS:  # about the mean of all runs of a side
            errors = np.nan_to_num(_sides(part, SPREADS[metric][0]))
            bias = errors[:, pairs].mean(axis=1)
            about = values**2 + bias[:, None] * (bias[:, None] - 2 * errors)
            values = np.sqrt(np.maximum(about, 0.0))
        if score.guard:  # the modulus of the mean, and the runs on its side
            scale = max(np.sqrt(np.mean(_sides(part, "std")[0, pairs] ** 2)), 1e-3 / margin)
            values *= np.sign(np.nanmean(values, axis=1, keepdims=True))
        elif np.nanmin(values) < score.zero:  # less is as good as none
            scale = max(np.nanmean(values[0]), score.zero / margin)
    logs = np.log(np.maximum(values, FLOOR)) if np.isnan(scale) else values / scale
    logs = np.where(np.isnan(values), np.nan, logs)
    return {
        "scenario": scenario, "parameter": parameter, "metric": metric, "values": values,
        "seeds": part.index.get_level_values("seed"), "changes": logs[1] - logs[0],
        "margin": margin, "scale": scale, "bias": bias,
    }  # fmt: skip


def _sides(part: pd.DataFrame, name: str) -> Array:
    """Return a column of base and candidate (2, n)."""
    return part[[f"{name} base", f"{name} candidate"]].to_numpy(float).T.copy()
