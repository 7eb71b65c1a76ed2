"""From rows of scores to pairs: what both got on each common run; what change matters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.comparison.matching import SPREADS
from flexaxis.experiments.scoring.score_table import MARGINS, METRICS, SCORES, Score
from flexaxis.sim.errors import FlexaxisError, did_you_mean

LOST = ("diverged", "never_settled")
"""Ways to lose a run; they are counted, apart from each other and from the scores."""

Array = NDArray[np.float64]
KEY = ["scenario", "seed", "parameter"]
TRUTHS = ["changed", "failed", *LOST]
NUMBERS = [*dict.fromkeys([*METRICS, *(bias for bias, _ in SPREADS.values())])]
ScoreRows: TypeAlias = "pd.DataFrame"
"""Rows of one estimator by scenario, seed and parameter."""


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
    scores : sequence of Pairs
    runs : sequence of Runs
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

    scores: Sequence[Pairs] = ()
    runs: Sequence[Runs] = ()
    missing: tuple[tuple[str, str], ...] = ()
    estimated: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    lacking: tuple[Lack, ...] = ()
    failed: tuple[int, int] = (0, 0)


def table(rows: Iterable[Mapping[str, Any]]) -> ScoreRows:
    """Return what is compared of the rows of one estimator.

    A row without a parameter is of a record that nobody can make, and left out.
    """
    columns = [*KEY, *TRUTHS, *NUMBERS, "hash", "error"]
    lines = [[row.get(name) for name in columns] for row in rows if row["parameter"] is not None]
    found = pd.DataFrame(lines, columns=columns, dtype=object).set_index(KEY)
    found[TRUTHS] = found[TRUTHS] == True  # noqa: E712, what is not said is not so
    found[NUMBERS] = found[NUMBERS].astype(float)
    return found


def pair(base: ScoreRows, candidate: ScoreRows, margins: Mapping[str, float]) -> Paired:
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
    both = base.add_suffix(" base").join(candidate.add_suffix(" candidate"), how="inner")
    both = both.sort_index()
    common = both.index.droplevel("seed").unique()
    common = common[common.isin(kinds[0]) & common.isin(kinds[1])]
    both = both[both.index.droplevel("seed").isin(common)]
    if both.empty:
        raise FlexaxisError(
            "base and candidate have nothing in common: they estimate "
            f"{_names(base)} and {_names(candidate)}, and must share a parameter, a scenario and "
            "a seed"
        )
    found = [
        _metric(part.droplevel(["scenario", "parameter"]), scenario, parameter, metric, margin)
        for (scenario, parameter), part in both.groupby(level=["scenario", "parameter"])
        for metric, margin in margins.items()
    ]
    runs = [_runs(str(name), part) for name, part in both.groupby(level="scenario")]
    there = {each.scenario for each in runs}
    changed = _kinds(base[base["changed"]])
    missing = tuple(k for k in kinds[0] if k in changed and k[0] in there and k not in common)
    first, second = (tuple(dict.fromkeys(p for s, p in k if s in there)) for k in kinds)
    return Paired(
        [pairs for pairs in found if pairs is not None],
        runs,
        missing,
        (first, second),
        _lacking(base, candidate),
        (_failed(base), _failed(candidate)),
    )


def _kinds(rows: ScoreRows) -> list[tuple[str, str]]:
    """Return the scenarios with the parameters that are estimated there.

    A case that failed has those of the scenario: they count where no other case tells.
    """
    ran = [*rows.index[~rows["failed"]].droplevel("seed").unique()]
    known = {scenario for scenario, _ in ran}
    return ran + [kind for kind in rows.index.droplevel("seed").unique() if kind[0] not in known]


def _lacking(base: ScoreRows, candidate: ScoreRows) -> tuple[Lack, ...]:
    """Return what one side alone was run on, of the seeds on which both were run at all."""
    ran = [dict.fromkeys(side.index.droplevel("parameter")) for side in (base, candidate)]
    seeds = set.intersection(*({seed for _, seed in mine} for mine in ran))
    gone = Counter(
        (scenario, side)
        for side, mine, other in zip(("base", "candidate"), ran, ran[::-1], strict=True)
        for scenario, seed in other
        if seed in seeds and (scenario, seed) not in mine
    )
    return tuple(Lack(*key, cases) for key, cases in gone.items())


def _failed(rows: ScoreRows) -> int:
    return rows.index[rows["failed"]].droplevel("parameter").nunique()


def _names(rows: ScoreRows) -> str:
    return ", ".join(rows.index.unique("parameter"))


def _runs(scenario: str, both: ScoreRows) -> Runs:
    """Count a run as lost if it is so in any of the common parameters."""
    lost = both.groupby(level="seed").any()
    sides = [{way: lost[f"{way} {side}"].to_numpy(bool) for way in LOST}
             for side in ("base", "candidate")]  # fmt: skip
    alive = ~(sides[0]["diverged"] | sides[1]["diverged"])
    for side in sides:
        side["never_settled"] = side["never_settled"] & alive
    return Runs(scenario, lost.index.to_numpy(int), *sides)


def _metric(
    both: ScoreRows, scenario: str, parameter: str, metric: str, margin: float
) -> Pairs | None:
    scored = _sides(both, metric)
    if not np.isfinite(scored).any():  # not defined here: the lag of what did not change
        return None
    # A diverged run is counted with the lost ones. That leaves its pair without a score, but not
    # the score out of the comparison: of what has no pair left, nothing can be said.
    lost = _sides(both, "diverged").any(axis=0)
    scored[:, lost | ~np.isfinite(scored).all(axis=0)] = np.nan
    here, score, bias = np.isfinite(scored[0]), SCORES[metric], None
    if metric in SPREADS and np.isfinite(biases := _sides(both, SPREADS[metric][0])).any():
        scored, bias = _about_the_mean(scored, biases, here) if here.any() else (scored, None)
    scale = _scale(scored, both, here, score, margin) if here.any() else None
    if score.guard and here.any():
        scored = scored * np.sign(scored[:, here].mean(axis=1, keepdims=True))
    seeds = both.index.to_numpy(int)
    return Pairs(scenario, metric, parameter, seeds, scored[0], scored[1], scale, bias)


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
    both: ScoreRows,
    here: NDArray[np.bool_],
    score: Score,
    margin: float,
) -> float | None:
    """Return what differences are shares of, None where ratios are compared.

    That is the mean of the base; of a bias its error, in which the bias is. What is less than the
    zero of a score is within its margin.
    """
    if score.guard:
        level, zero = _sides(both, "std")[0, here], SCORES["std"].zero
        return max(float(np.sqrt(np.mean(level**2))), zero / margin)
    if scored[:, here].min() >= score.zero:
        return None
    return max(float(scored[0, here].mean()), score.zero / margin)


def _sides(both: ScoreRows, name: str) -> Array:
    """Return a column of base and candidate (2, n)."""
    return both[[f"{name} base", f"{name} candidate"]].to_numpy(float).T.copy()


def parse_margins(texts: Sequence[str]) -> dict[str, float]:
    """Return the margins with those of texts such as ``lag=2%`` added or changed.

    A text may hold several, with commas between them.

    Examples
    --------
    >>> parse_margins(["lag=5%,t10=0.1"])
    {'lag': 0.05, 'std': 0.02, 'bias': 0.2, 't10': 0.1}
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
