"""From rows of scores to pairs: one score of base and candidate on each common seed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.errors import FlexaxisError, did_you_mean

LOST = ("diverged", "never_settled")
"""Ways to lose a run; they are counted, apart from each other and from the scores."""

METRICS = ("lag", "t10", "std", "cross_talk")
MARGINS: Mapping[str, float] = {"lag": 0.02, "std": 0.02}
"""What is compared unless told otherwise, and how large a change matters (.02 is 2 %)."""

Key = tuple[str, int, str]
Table = Mapping[Key, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Pairs:
    """One score of base and candidate, seed by seed.

    Attributes
    ----------
    scenario : str
    metric : str
        A score, or a way to lose a run.
    parameter : str
        Whose score it is; empty for lost runs.
    seeds : ndarray (n,) of int
        Those that both were run on, in increasing order.
    base, candidate : ndarray (n,)
        Scores, NaN where a run has none; for lost runs 1.
    """

    scenario: str
    metric: str
    parameter: str
    seeds: NDArray[np.int64]
    base: NDArray[np.float64]
    candidate: NDArray[np.float64]

    @property
    def both(self) -> NDArray[np.bool_]:
        """On which seeds both have the score."""
        return np.isfinite(self.base) & np.isfinite(self.candidate)


def parse_margins(texts: Sequence[str]) -> dict[str, float]:
    """Return the margins with those of texts such as ``lag=2%`` added or changed.

    Examples
    --------
    >>> parse_margins(["lag=5%", "t10=0.1"])
    {'lag': 0.05, 'std': 0.02, 't10': 0.1}
    """
    margins = dict(MARGINS)
    for text in texts:
        metric, _, number = text.partition("=")
        if metric not in METRICS:
            raise FlexaxisError(
                f"--margin {text!r}: there is no metric {metric!r}."
                f"{did_you_mean(metric, METRICS)} There are: {', '.join(METRICS)}"
            )
        try:
            value = float(number.removesuffix("%")) / (100 if number.endswith("%") else 1)
        except ValueError:
            value = -1.0
        if not 0 < value < 1:
            raise FlexaxisError(
                f"--margin {text!r}: write a share between 0 and 100 %, as in {metric}=2%"
            )
        margins[metric] = value
    return margins


def table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return the rows of one estimator by scenario, seed and parameter."""
    return {(row["scenario"], row["seed"], row["parameter"]): row for row in rows}


def pair(base: Table, candidate: Table, metrics: Iterable[str]) -> list[Pairs]:
    """Return the pairs of all that is scored on both sides, lost runs first.

    Raises
    ------
    FlexaxisError
        If no scenario, seed and parameter is common to both.
    """
    common = sorted(base.keys() & candidate.keys())
    if not common:
        raise FlexaxisError(
            "base and candidate have nothing in common: they estimate "
            f"{_names(base)} and {_names(candidate)}, and must share a parameter, a scenario and "
            "a seed"
        )
    names = list(dict.fromkeys(s for s, _, _ in base))
    kinds = dict.fromkeys((s, p) for s, _, p in base)
    found = [
        _lost(base, candidate, [k for k in common if k[0] == s], w) for s in names for w in LOST
    ]
    for kind in kinds:
        keys = [k for k in common if (k[0], k[2]) == kind]
        found += [_metric(base, candidate, keys, metric) for metric in metrics]
    return [pairs for pairs in found if pairs is not None]


def _names(rows: Table) -> str:
    return ", ".join(dict.fromkeys(parameter for _, _, parameter in rows))


def _lost(base: Table, candidate: Table, keys: Sequence[Key], way: str) -> Pairs | None:
    """Count a run as lost if it is so in any of the common parameters."""
    if not keys:
        return None
    seeds = list(dict.fromkeys(seed for _, seed, _ in keys))
    values = [
        np.array([any(rows[k][way] for k in keys if k[1] == seed) for seed in seeds], float)
        for rows in (base, candidate)
    ]
    return Pairs(keys[0][0], way, "", np.array(seeds), *values)


def _metric(base: Table, candidate: Table, keys: Sequence[Key], metric: str) -> Pairs | None:
    values = [
        np.array([_score(rows[key], metric) for key in keys], float) for rows in (base, candidate)
    ]
    if not np.isfinite(values).all(axis=0).any():
        # Not defined here, such as the lag of a parameter that did not change; or one side lost
        # every run, and the counts say so.
        return None
    seeds = np.array([seed for _, seed, _ in keys])
    return Pairs(keys[0][0], metric, keys[0][2], seeds, *values)


def _score(row: Mapping[str, Any], metric: str) -> float:
    """Return a score, NaN for a run without: a diverged one is counted, not averaged."""
    return np.nan if row["diverged"] or row[metric] is None else row[metric]
