"""From rows of scores to pairs: what base and candidate got on each common run."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring import statistics
from flexaxis.experiments.scoring import table as scores
from flexaxis.sim.errors import FlexaxisError, did_you_mean

METRICS: Mapping[str, str] = {name: scores.SCORES[name].unit or "" for name in scores.METRICS}
"""Scores that can be compared, with their units; of each, less is better."""

MARGINS: Mapping[str, float] = scores.MARGINS
"""What is compared unless told otherwise, and how large a change matters (.02 is 2 %)."""

LOST = ("diverged", "never_settled")
"""Ways to lose a run; they are counted, apart from each other and from the scores."""

Key = tuple[str, int, str]
Table = Mapping[Key, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Pairs:
    """One score of base and candidate, seed by seed.

    Attributes
    ----------
    scenario : str
    metric : str
        One of `METRICS`.
    parameter : str
        Whose score it is.
    seeds : ndarray (n,) of int
        Those that both were run on, in increasing order.
    base, candidate : ndarray (n,)
        Scores [unit of the metric], NaN where either side diverged or has none.
    """

    scenario: str
    metric: str
    parameter: str
    seeds: NDArray[np.int64]
    base: NDArray[np.float64]
    candidate: NDArray[np.float64]

    @property
    def ratios(self) -> NDArray[np.float64]:
        """log(candidate/base) (n,); NaN where there is no pair."""
        return statistics.log_ratio(self.base, self.candidate)

    @property
    def both(self) -> NDArray[np.bool_]:
        """On which seeds there is a pair."""
        return np.isfinite(self.ratios)


@dataclass(frozen=True, eq=False)
class Runs:
    """Which runs on a scenario were lost, seed by seed.

    Attributes
    ----------
    scenario : str
    seeds : ndarray (n,) of int
    base, candidate : mapping of way to ndarray (n,) of bool
        For each way of `LOST`. A run that diverged is not said to have never settled, on neither
        side: it is counted once.
    """

    scenario: str
    seeds: NDArray[np.int64]
    base: Mapping[str, NDArray[np.bool_]]
    candidate: Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Paired:
    """All that a comparison is made of.

    Attributes
    ----------
    scores : list of Pairs
    runs : list of Runs
        Of each scenario.
    missing : tuple of (scenario, parameter)
        What changes and is estimated by the base, but not by the candidate.
    estimated : (tuple of str, tuple of str)
        All parameters that base and candidate estimate.
    """

    scores: list[Pairs]
    runs: list[Runs]
    missing: tuple[tuple[str, str], ...] = ()
    estimated: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())


def parse_margins(texts: Sequence[str]) -> dict[str, float]:
    """Return the margins with those of texts such as ``lag=2%`` added or changed.

    A text may hold several, with commas between them.

    Examples
    --------
    >>> parse_margins(["lag=5%,t10=0.1"])
    {'lag': 0.05, 'std': 0.02, 't10': 0.1}
    """
    margins = dict(MARGINS)
    for text in (part.strip() for given in texts for part in given.split(",")):
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


def pair(base: Table, candidate: Table, metrics: Iterable[str]) -> Paired:
    """Return what base and candidate got on the runs common to both.

    Raises
    ------
    FlexaxisError
        If no scenario, seed and parameter is common to both.
    """
    by_kind: dict[tuple[str, str], list[Key]] = {(s, p): [] for s, _, p in base}
    for key in sorted(base.keys() & candidate.keys()):
        by_kind[key[0], key[2]].append(key)
    common = {kind: keys for kind, keys in by_kind.items() if keys}
    if not common:
        raise FlexaxisError(
            "base and candidate have nothing in common: they estimate "
            f"{_names(base)} and {_names(candidate)}, and must share a parameter, a scenario and "
            "a seed"
        )
    found = [
        _metric(base, candidate, keys, metric) for keys in common.values() for metric in metrics
    ]
    by_scenario: dict[str, list[Key]] = {}
    for (scenario, _), keys in common.items():
        by_scenario.setdefault(scenario, []).extend(keys)
    runs = [_runs(base, candidate, keys) for keys in by_scenario.values()]
    changed = dict.fromkeys((s, p) for (s, _, p), row in base.items() if row.get("changed"))
    missing = tuple(k for k in changed if k[0] in by_scenario and k not in common)
    estimated = (_estimated(base, by_scenario), _estimated(candidate, by_scenario))
    return Paired([pairs for pairs in found if pairs is not None], runs, missing, estimated)


def _names(rows: Table) -> str:
    return ", ".join(dict.fromkeys(parameter for _, _, parameter in rows))


def _estimated(rows: Table, scenarios: Container[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for scenario, _, name in rows if scenario in scenarios))


def _runs(base: Table, candidate: Table, keys: Sequence[Key]) -> Runs:
    """Count a run as lost if it is so in any of the common parameters."""
    by_seed: dict[int, list[Key]] = {}
    for key in keys:
        by_seed.setdefault(key[1], []).append(key)
    seeds = sorted(by_seed)

    def lost(rows: Table, way: str) -> NDArray[np.bool_]:
        return np.array([any(rows[key][way] for key in by_seed[seed]) for seed in seeds], bool)

    sides = [{way: lost(rows, way) for way in LOST} for rows in (base, candidate)]
    alive = ~(sides[0]["diverged"] | sides[1]["diverged"])
    for side in sides:
        side["never_settled"] &= alive
    return Runs(keys[0][0], np.array(seeds), *sides)


def _metric(base: Table, candidate: Table, keys: Sequence[Key], metric: str) -> Pairs | None:
    sides = [[rows[key] for key in keys] for rows in (base, candidate)]
    scored = np.array([[_number(row[metric]) for row in side] for side in sides])
    if not np.isfinite(scored).any():  # not defined here: the lag of what did not change
        return None
    # A diverged run is counted with the lost ones. That leaves its pair without a score, but not
    # the score out of the comparison: of what has no pair left, nothing can be said.
    lost = np.array([[row["diverged"] for row in side] for side in sides], bool).any(axis=0)
    seeds = np.array([seed for _, seed, _ in keys])
    first, second = np.where(lost | ~np.isfinite(scored).all(axis=0), np.nan, scored)
    return Pairs(keys[0][0], metric, keys[0][2], seeds, first, second)


def _number(value: float | None) -> float:
    return np.nan if value is None else value
