"""From pairs to verdicts: better, worse, same within the margin, or undecided."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.compare.pairs import LOST, METRICS, Pairs
from flexaxis.experiments.scoring import statistics

ALPHA = 0.01
BETTER, WORSE, SAME, UNDECIDED = "better", "worse", "same", "undecided"
VERDICTS = (WORSE, BETTER, SAME, UNDECIDED)


@dataclass(frozen=True)
class Verdict:
    """What can be said of one score.

    Attributes
    ----------
    scenario, metric, parameter : str
        Which score; metric ``"diverged"`` and ``"never_settled"`` are numbers of lost runs.
    verdict : str
        ``"better"``, ``"worse"``, ``"same"`` (within the margin) or ``"undecided"``.
    base, candidate : float or None
        Geometric means over the pairs; of lost runs the numbers.
    runs, pairs : int
        Seeds run, and those on which both have the score.
    change : float or None
        Geometric mean of candidate/base, less one; None for lost runs.
    interval : (float, float) or None
        Of `change`, at `level`.
    p : float
        Two-sided p-value, not corrected.
    level : float
        Probability with which the interval may miss, corrected after Holm.
    margin : float or None
        A change smaller than this does not matter.
    seeds_needed : int or None
        If undecided: about how many seeds would decide; None if that cannot be said.
    worst_seed : int or None
        Seed on which the candidate compares worst.
    """

    scenario: str
    metric: str
    parameter: str
    verdict: str
    base: float | None
    candidate: float | None
    runs: int
    pairs: int
    change: float | None
    interval: tuple[float, float] | None
    p: float
    level: float
    margin: float | None
    seeds_needed: int | None
    worst_seed: int | None


def judge(
    pairs: Sequence[Pairs], margins: Mapping[str, float], *, alpha: float = ALPHA
) -> list[Verdict]:
    """Return a verdict for each score.

    Worse (better) is a change larger than the margin whose interval leaves out zero, at the level
    that Holm's procedure gives it in the family of all scores. Same is an interval within
    ±margin.

    Parameters
    ----------
    pairs : sequence of Pairs
    margins : mapping of metric to float
        As shares; .02 is 2 %.
    alpha : float
        Chance of any wrong "worse" or "better" in the whole family, at most.
    """
    # Where neither side lost a run there is nothing to test, and nothing to pay for.
    tested = [item for item in pairs if item.metric not in LOST or _losses(item) != (0, 0)]
    levels = statistics.holm_levels([_p(item) for item in tested], alpha)
    by_item = {id(item): float(level) for item, level in zip(tested, levels, strict=True)}
    return [
        _judge_lost(item, by_item.get(id(item), alpha))
        if item.metric in LOST
        else _judge_ratio(item, by_item[id(item)], margins[item.metric])
        for item in pairs
    ]


def overall(verdicts: Sequence[str]) -> str:
    """Return the one word for several: any worse, else any undecided, else any better, or same."""
    return next((word for word in (WORSE, UNDECIDED, BETTER) if word in verdicts), SAME)


def by_metric(verdicts: Sequence[Verdict]) -> dict[str, str]:
    """Return a word for each metric; one that is better here and worse there is "mixed"."""
    words: dict[str, str] = {}
    present = {v.metric for v in verdicts}
    for metric in (m for m in (*LOST, *METRICS) if m in present):
        found = {v.verdict for v in verdicts if v.metric == metric}
        decided = found & {BETTER, WORSE}
        words[metric] = "mixed" if len(decided) == 2 else overall(list(decided or found))
    return words


def _losses(item: Pairs) -> tuple[int, int]:
    return int(item.base.sum()), int(item.candidate.sum())


def _p(item: Pairs) -> float:
    if item.metric in LOST:
        return statistics.lost_p(*_losses(item), len(item.seeds))
    return statistics.paired(item.base[item.both], item.candidate[item.both]).p


def _judge_lost(item: Pairs, level: float) -> Verdict:
    (base, candidate), runs, p = _losses(item), len(item.seeds), _p(item)
    if base == candidate:
        verdict = SAME
    elif p <= level:
        verdict = WORSE if candidate > base else BETTER
    else:
        verdict = UNDECIDED
    needed = None
    if verdict == UNDECIDED:
        needed = statistics.seeds_for_lost(base, candidate, runs, level)
    return Verdict(
        item.scenario,
        item.metric,
        "",
        verdict,
        base=base,
        candidate=candidate,
        runs=runs,
        pairs=runs,
        change=None,
        interval=None,
        p=p,
        level=level,
        margin=None,
        seeds_needed=needed,
        worst_seed=_worst(item, item.candidate - item.base),
    )


def _judge_ratio(item: Pairs, level: float, margin: float) -> Verdict:
    base, candidate = item.base[item.both], item.candidate[item.both]
    found, most = statistics.paired(base, candidate), math.log1p(margin)
    low, high = found.interval(level)
    if (low > 0 or high < 0) and abs(found.mean) > most:
        verdict = WORSE if found.mean > 0 else BETTER
    elif -most < low and high < most:
        verdict = SAME
    else:
        verdict = UNDECIDED
    needed = None
    if verdict == UNDECIDED:
        needed = statistics.seeds_for_ratio(found, level, most)
    with np.errstate(invalid="ignore", divide="ignore"):
        worst = _worst(item, np.log(item.candidate) - np.log(item.base))
    return Verdict(
        item.scenario,
        item.metric,
        item.parameter,
        verdict,
        base=_geometric_mean(base),
        candidate=_geometric_mean(candidate),
        runs=len(item.seeds),
        pairs=found.n,
        change=_share(found.mean) if found.n else None,
        interval=(_share(low), _share(high)) if found.n > 1 else None,
        p=found.p,
        level=level,
        margin=margin,
        seeds_needed=needed,
        worst_seed=worst,
    )


def _share(log_ratio: float) -> float:
    return math.expm1(min(log_ratio, 700.0))  # more is beyond the largest number


def _geometric_mean(values: NDArray[np.float64]) -> float | None:
    if not len(values):
        return None
    return math.exp(float(np.log(np.maximum(values, statistics.FLOOR)).mean()))


def _worst(item: Pairs, harm: NDArray[np.float64]) -> int | None:
    harm = np.where(np.isnan(harm), -np.inf, harm)
    return int(item.seeds[np.argmax(harm)]) if len(item.seeds) else None
