"""From rows of scores to pairs: what base and candidate got on each common run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.comparison.matching import SPREADS
from flexaxis.experiments.scoring import table as scores
from flexaxis.sim.errors import FlexaxisError

LOST = ("diverged", "never_settled")
"""Ways to lose a run; they are counted, apart from each other and from the scores."""

Array = NDArray[np.float64]
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
        Scores [unit of the metric], NaN where either side diverged or has none. A standard
        deviation is about the mean of all runs of its side, and of a bias the sign is that mean's.
    scale : float or None
        Where differences are compared: what they are shares of [unit of the metric].
    bias : (float, float) or None
        Of a standard deviation: the mean of each side [%].
    """

    scenario: str
    metric: str
    parameter: str
    seeds: NDArray[np.int64]
    base: NDArray[np.float64]
    candidate: NDArray[np.float64]
    scale: float | None = None
    bias: tuple[float, float] | None = None

    @property
    def changes(self) -> NDArray[np.float64]:
        """log(candidate/base), or (candidate − base)/scale, (n,); NaN where there is no pair."""
        if self.scale is not None:
            return np.asarray((self.candidate - self.base) / self.scale)
        return statistics.log_ratio(self.base, self.candidate)

    @property
    def both(self) -> NDArray[np.bool_]:
        """On which seeds there is a pair."""
        return np.isfinite(self.changes)


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


class Lack(NamedTuple):
    """Cases of a scenario that one side has and the other, `side`, has not.

    `unreadable` says that it cannot read the scenario, such as one with another `output`.
    """

    scenario: str
    side: str
    cases: int
    unreadable: bool = False


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
    lacking : tuple of Lack
        Cases that one side alone was run on.
    failed : (int, int)
        Cases that failed, of base and candidate.
    """

    scores: list[Pairs]
    runs: list[Runs]
    missing: tuple[tuple[str, str], ...] = ()
    estimated: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    lacking: tuple[Lack, ...] = ()
    failed: tuple[int, int] = (0, 0)


def table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return the rows of one estimator by scenario, seed and parameter.

    A row without a parameter is of a record that nobody can make, and left out.
    """
    return {
        (row["scenario"], row["seed"], row["parameter"]): row
        for row in rows
        if row["parameter"] is not None
    }


def pair(base: Table, candidate: Table, margins: Mapping[str, float]) -> Paired:
    """Return what base and candidate got on the runs common to both.

    Parameters
    ----------
    base, candidate : mapping
        As from `table`.
    margins : mapping of metric to float
        What is compared, and how large a change matters.

    Raises
    ------
    FlexaxisError
        If no scenario, seed and parameter is common to both.
    """
    kinds = [_kinds(side) for side in (base, candidate)]
    common: dict[tuple[str, str], list[Key]] = {}
    for key in sorted(base.keys() & candidate.keys()):
        if all((key[0], key[2]) in side for side in kinds):
            common.setdefault((key[0], key[2]), []).append(key)
    if not common:
        raise FlexaxisError(
            "base and candidate have nothing in common: they estimate "
            f"{_names(base)} and {_names(candidate)}, and must share a parameter, a scenario and "
            "a seed"
        )
    found = [
        _metric(base, candidate, keys, metric, margin)
        for keys in common.values()
        for metric, margin in margins.items()
    ]
    by_scenario: dict[str, list[Key]] = {}
    for (scenario, _), keys in common.items():
        by_scenario.setdefault(scenario, []).extend(keys)
    runs = [_runs(base, candidate, keys) for keys in by_scenario.values()]
    changed = dict.fromkeys(
        (s, p) for (s, _, p), row in base.items() if row.get("changed") and (s, p) in kinds[0]
    )
    missing = tuple(k for k in changed if k[0] in by_scenario and k not in common)
    first, second = (tuple(dict.fromkeys(p for s, p in k if s in by_scenario)) for k in kinds)
    return Paired(
        [pairs for pairs in found if pairs is not None],
        runs,
        missing,
        (first, second),
        _lacking(base, candidate),
        (_failed(base), _failed(candidate)),
    )


def _kinds(rows: Table) -> dict[tuple[str, str], None]:
    """Return the scenarios with the parameters that are estimated there.

    A case that failed has those of the scenario: they count where no other case tells.
    """
    ran = {(s, p): None for (s, _, p), row in rows.items() if not row.get("failed")}
    known = {scenario for scenario, _ in ran}
    return ran | {(s, p): None for s, _, p in rows if s not in known}


def _lacking(base: Table, candidate: Table) -> tuple[Lack, ...]:
    """Return what one side alone was run on, of the seeds on which both were run at all."""
    cases = {"base": base, "candidate": candidate}
    ran = {side: dict.fromkeys(key[:2] for key in rows) for side, rows in cases.items()}
    seeds = {seed for _, seed in ran["base"]} & {seed for _, seed in ran["candidate"]}
    gone = [
        (scenario, side)
        for side, mine in ran.items()
        for other in ran.values()
        for scenario, seed in other
        if seed in seeds and (scenario, seed) not in mine
    ]
    return tuple(Lack(*key, gone.count(key)) for key in dict.fromkeys(gone))


def _failed(rows: Table) -> int:
    return len({key[:2] for key, row in rows.items() if row.get("failed")})


def _names(rows: Table) -> str:
    return ", ".join(dict.fromkeys(parameter for _, _, parameter in rows))


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


def _metric(
    base: Table, candidate: Table, keys: Sequence[Key], metric: str, margin: float
) -> Pairs | None:
    sides = [[rows[key] for key in keys] for rows in (base, candidate)]
    scored = _column(sides, metric)
    if not np.isfinite(scored).any():  # not defined here: the lag of what did not change
        return None
    # A diverged run is counted with the lost ones. That leaves its pair without a score, but not
    # the score out of the comparison: of what has no pair left, nothing can be said.
    lost = np.array([[row["diverged"] for row in side] for side in sides], bool).any(axis=0)
    scored[:, lost | ~np.isfinite(scored).all(axis=0)] = np.nan
    seeds = np.array([seed for _, seed, _ in keys])
    here, score, bias = np.isfinite(scored[0]), scores.SCORES[metric], None
    if metric in SPREADS and np.isfinite(biases := _column(sides, SPREADS[metric][0])).any():
        scored, bias = _about_the_mean(scored, biases, here) if here.any() else (scored, None)
    scale = _scale(scored, sides, here, score, margin) if here.any() else None
    if score.guard and here.any():
        scored = scored * np.sign(scored[:, here].mean(axis=1, keepdims=True))
    return Pairs(keys[0][0], metric, keys[0][2], seeds, scored[0], scored[1], scale, bias)


def _about_the_mean(
    rms: Array, biases: Array, here: NDArray[np.bool_]
) -> tuple[Array, tuple[float, float]]:
    """Return rms errors (2, n) about the mean of all runs of a side, and these means."""
    biases = np.nan_to_num(biases)
    first, second = biases[:, here].mean(axis=1)
    mean = np.array([[first], [second]])
    square = rms**2 - 2 * mean * biases + mean**2
    return np.sqrt(np.maximum(square, 0.0)), (float(first), float(second))


def _scale(
    scored: Array,
    sides: Sequence[Any],
    here: NDArray[np.bool_],
    score: scores.Score,
    margin: float,
) -> float | None:
    """Return what differences are shares of, None where ratios are compared.

    That is the mean of the base; of a bias its error, in which the bias is. What is less than the
    zero of a score is within its margin.
    """
    if score.guard:
        level, zero = _column(sides, "std")[0, here], scores.SCORES["std"].zero
        return max(float(np.sqrt(np.mean(level**2))), zero / margin)
    if scored[:, here].min() >= score.zero:
        return None
    return max(float(scored[0, here].mean()), score.zero / margin)


def _column(sides: Sequence[Sequence[Mapping[str, Any]]], name: str) -> NDArray[np.float64]:
    found = [[row.get(name) for row in side] for side in sides]
    return np.array([[np.nan if x is None else x for x in side] for side in found], float)
