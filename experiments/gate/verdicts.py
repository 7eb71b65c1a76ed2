"""The verdict on each score and on the lost runs of one comparison, with its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.gate import decide
from flexaxis.experiments.gate.decide import (
    ALPHA,
    BETTER,
    SAME,
    SLIGHT,
    UNDECIDED,
    UNSEEN,
    WORSE,
    Decision,
    Family,
)
from flexaxis.experiments.gate.pairs import LOST, Paired, Pairs, Runs
from flexaxis.experiments.scoring.score_table import METRICS

VERDICTS = (WORSE, UNDECIDED, BETTER, SLIGHT, SAME)

ALL = "all"
"""Stands for the scenario in a verdict on lost runs, which are counted over all."""


@dataclass(frozen=True)
class Verdict:
    """What can be said of one score, or of one way to lose a run.

    Attributes
    ----------
    scenario, metric, parameter : str
        Which score; metric ``"diverged"`` and ``"never_settled"`` are numbers of lost runs, over
        all scenarios and without a parameter.
    verdict : str
        ``"better"``, ``"worse"``, ``"slight"``, ``"same"`` or ``"undecided"``; of lost runs also
        ``"not more"``, which has no say.
    base, candidate : float or None
        Means over the pairs [unit of the metric], geometric ones where ratios are compared; of
        lost runs the numbers.
    runs, pairs : int
        Runs common to both, and those on which both have the score.
    change : float or None
        Geometric mean of candidate/base, less one; where differences are compared, as scores may
        be 0, their mean [unit]. None for lost runs.
    interval : (float, float) or None
        Of `change`: Student's, of this score alone, at `level`.
    p : float
        p-value, not corrected; two-sided, of lost runs one-sided.
    level : float
        Probability with which the interval may miss, as Holm's procedure gives it; of lost runs
        the level of the test.
    margin : float or None
        A change smaller than this does not matter, written as `change` is.
    seeds_needed : int or None
        If undecided: about how many seeds would decide; None if that cannot be said.
    worst_seed : int or None
        Seed on which the candidate compares worst.
    worst_scenario : str
        Scenario of that seed.
    newly, regained : int or None
        Runs that only the candidate lost, and only the base; None for scores.
    by_scenario : dict of str to (int, int)
        The same for each scenario where there is any.
    reason : str
        Why a clear change is undecided: ``"few"`` (too few runs show it to exclude that others
        would undo it), ``"far"`` (a run of the metric lies far on the other side), or empty.
    enough : float or None
        If it is ``"few"``: from what change on the runs that agree could say it.
    agreeing : int or None
        If it is ``"few"``: how many runs that are, over all scenarios.
    unit : str or None
        Of `change`, where differences are compared; None where ratios are.
    scale : float or None
        What the differences are shares of [unit].
    bias : (float, float) or None
        Of a standard deviation, which is about them: the means of base and candidate [%].
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
    worst_scenario: str
    newly: int | None = None
    regained: int | None = None
    by_scenario: dict[str, tuple[int, int]] = field(default_factory=dict)
    reason: str = ""
    enough: float | None = None
    agreeing: int | None = None
    unit: str | None = None
    scale: float | None = None
    bias: tuple[float, float] | None = None


def judge(paired: Paired, margins: Mapping[str, float], *, alpha: float = ALPHA) -> list[Verdict]:
    """Return a verdict for each way to lose a run, and for each score.

    Parameters
    ----------
    paired : Paired
    margins : mapping of metric to float
        As shares; .02 is 2 %.
    alpha : float
        Chance of any wrong "worse" or "better" in the whole comparison, at most.
    """
    return [
        *(_judge_lost(paired.runs, way, alpha) for way in LOST),
        *_judge_scores(paired.scores, margins, alpha),
    ]


def newly_lost(verdicts: Sequence[Verdict]) -> int:
    """Return how many runs more the candidate lost, one way or the other."""
    return sum(max(0, v.newly - (v.regained or 0)) for v in verdicts if v.newly is not None)


def alarming(verdicts: Sequence[Verdict]) -> bool:
    """Return whether somebody should look at the runs newly lost, one way or the other."""
    counts = [(v.newly or 0, v.regained or 0, v.base or 0) for v in verdicts if v.metric in LOST]
    return bool(decide.alarming(*zip(*counts, strict=True))) if counts else False


def overall(verdicts: Sequence[Verdict]) -> str:
    """Return the one word: any worse, else any undecided, any better, any slight, or same."""
    words, counts = (
        np.array([[v.verdict for v in verdicts if (v.metric in LOST) is wanted]], str)
        for wanted in (False, True)
    )
    return str(decide.overall(words, counts)[0])


def by_metric(verdicts: Sequence[Verdict]) -> dict[str, str]:
    """Return a word for each metric; one that is better here and worse there is "mixed"."""
    words: dict[str, str] = {}
    present = {v.metric for v in verdicts}
    for metric in (m for m in (*LOST, *METRICS) if m in present):
        found = [v.verdict for v in verdicts if v.metric == metric]
        decided = {BETTER, WORSE} & {*found}
        if len(decided) == 2:
            words[metric] = "mixed"
        else:
            words[metric] = next((w for w in (*decided, *VERDICTS) if w in found), found[0])
    return words


def _judge_lost(runs: Sequence[Runs], way: str, alpha: float) -> Verdict:
    sides = [np.concatenate([getattr(r, s)[way] for r in runs]) for s in ("base", "candidate")]
    scenarios = np.concatenate([[r.scenario] * len(r.seeds) for r in runs])
    seeds = np.concatenate([r.seeds for r in runs])
    new, back = sides[1] & ~sides[0], sides[0] & ~sides[1]
    newly, regained, total = int(new.sum()), int(back.sum()), len(seeds)
    word = str(decide.judge_lost(newly, regained, way, alpha=alpha)[()])
    level = decide.levels(way, alpha)[int(newly < regained)]
    runs_needed = decide.runs_needed(newly, regained, total, level) if word == UNDECIDED else None
    # Where it happens: a run newly lost, else a lost one, else any.
    worst = int(np.argmax(2 * new + (sides[0] | sides[1])))
    return Verdict(
        scenario=ALL,
        metric=way,
        parameter="",
        verdict=word,
        base=int(sides[0].sum()),
        candidate=int(sides[1].sum()),
        runs=total,
        pairs=total,
        change=None,
        interval=None,
        p=float(statistics.sign_p(max(newly, regained), min(newly, regained))),
        level=level,
        margin=None,
        seeds_needed=None if runs_needed is None else math.ceil(runs_needed / len(runs)),
        worst_seed=int(seeds[worst]),
        worst_scenario=str(scenarios[worst]),
        newly=newly,
        regained=regained,
        by_scenario={
            name: (int(new[here].sum()), int(back[here].sum()))
            for name in dict.fromkeys(scenarios.tolist())
            if (new | back)[here := scenarios == name].any()
        },
    )


def _judge_scores(
    scores: Sequence[Pairs], margins: Mapping[str, float], alpha: float
) -> list[Verdict]:
    if not scores:
        return []
    family = Family.of(
        [s.scenario for s in scores],
        [s.metric for s in scores],
        [margins[s.metric] for s in scores],
    )
    ratios = np.full((1, len(scores), max(len(s.seeds) for s in scores)), np.nan)
    for row, score in zip(ratios[0], scores, strict=True):
        row[: len(score.seeds)] = score.changes
    found = decide.decide(ratios, family, alpha=alpha)
    return [
        _score(item, found, i, family, margins[item.metric], alpha=alpha)
        for i, item in enumerate(scores)
    ]


def _score(
    item: Pairs, found: Decision, i: int, family: Family, margin: float, *, alpha: float
) -> Verdict:
    word, few, far = str(found.words[0, i]), found.few[0, i], found.far[0, i]
    n, mean = int(found.n[0, i]), float(found.mean[0, i])
    open_ = word == UNDECIDED and not far
    needed = _seeds_needed(found, i, family, alpha) if open_ else None
    said = _share if item.scale is None else lambda share: float(share * (item.scale or 0.0))
    interval = (said(found.low[0, i]), said(found.high[0, i])) if n > 1 else None
    worst = int(np.argmax(np.where(item.both, item.changes, -np.inf)))
    mean_of = _geometric_mean if item.scale is None else _mean
    return Verdict(
        scenario=item.scenario,
        metric=item.metric,
        parameter=item.parameter,
        verdict=word,
        base=mean_of(item.base[item.both]),
        candidate=mean_of(item.candidate[item.both]),
        runs=len(item.seeds),
        pairs=n,
        change=said(mean) if n else None,
        interval=interval,
        p=float(found.p[0, i]),
        level=float(found.level[0, i]),
        margin=margin if item.scale is None else margin * item.scale,
        seeds_needed=needed,
        worst_seed=int(item.seeds[worst]),
        worst_scenario=item.scenario,
        reason="far" if far else "few" if few else "",
        enough=said(_enough(found, i, alpha)) if few else None,
        agreeing=int(found.support[0, i]) if few else None,
        unit=None if item.scale is None else METRICS[item.metric],
        scale=item.scale,
        bias=item.bias,
    )


def _enough(found: Decision, i: int, alpha: float) -> float:
    """Return the logarithm, or share, that as many runs as agree could call better or worse."""
    share = alpha / found.choices[0, i]
    shift = float(statistics.unseen_shift(found.support[0, i], share, UNSEEN))
    return math.copysign(shift, found.mean[0, i])


def _seeds_needed(found: Decision, i: int, family: Family, alpha: float) -> int | None:
    """Return from how many pairs on score i would be decided, at mean, deviation, level of now.

    All scores have so many times more pairs then, none of them far: the interval must be narrow
    enough, and what was not seen too rare. Other metrics have no say in that.
    """
    mine = np.flatnonzero(family.metrics == family.metrics[i])
    alike = Family(family.scenarios[mine], family.metrics[mine], family.margins[mine])
    known = {key: getattr(found, key)[:, mine] for key in ("mean", "sd", "p", "level")}
    now, own, place = found.n[:, mine], int(found.n[0, i]), mine.tolist().index(i)

    def decided(n: int) -> bool:
        then = decide.judged(now * n // own, alike, alpha, **known)
        return bool(then.words[0, place] != UNDECIDED)

    return statistics.first_above(decided, own) if own > 1 else None


def _share(log_ratio: float) -> float:
    return math.expm1(min(log_ratio, 700.0))  # more is beyond the largest number


def _mean(values: NDArray[np.float64]) -> float | None:
    return float(values.mean()) if len(values) else None


def _geometric_mean(values: NDArray[np.float64]) -> float | None:
    if not len(values):
        return None
    return math.exp(float(np.log(np.maximum(values, statistics.FLOOR)).mean()))
