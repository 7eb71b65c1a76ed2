"""The rules for the verdict on each score and on lost runs."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import comb, stdtr, stdtrit

from flexaxis.experiments.gate.pairs import LOST, Paired
from flexaxis.experiments.scoring.intervals import holm_levels, sign_p
from flexaxis.experiments.scoring.score_table import SCORES

WORSE, UNDECIDED, BETTER, SLIGHT, SAME = "worse", "undecided", "better", "slight", "same"
ORDER = (WORSE, UNDECIDED, BETTER, SLIGHT, SAME)
"""The five words; that of a whole comparison is the first that any score has."""

SILENT = "not more"
"""Of lost runs and of a bias, which count only where they are worse: no more than by chance."""

ALPHA = 0.01
"""Largest probability of any false "worse" or "better" in a comparison."""

SHARES = {False: 0.5, True: 0.1, "diverged": 0.2, "never_settled": 0.2}
"""How alpha is shared: all scores together, all biases (guards), and each way to lose a run."""

LOST_WORSE = 0.75
"""Part of a lost-run test's share for "worse": ten runs lost and none regained (p = 2⁻¹⁰) are
enough at alpha 0.01."""

UNSEEN = 0.5
"""How far on the other side (log-ratio; 1.65 times) runs may lie that did not show."""

FAILED, SCATTER = 0.2, 4 * 1.4826
"""A pair this far on the other side (log-ratio), and so many median deviations (four standard
deviations) off the median, is a failure."""


class Lost(NamedTuple):
    """Runs that were lost in one way on each side, and ``newly`` and ``regained`` on one alone."""

    way: str
    runs: int
    base: int
    candidate: int
    newly: int
    regained: int
    verdict: str


def judge(paired: Paired, *, alpha: float = ALPHA) -> pd.DataFrame:
    """Return a verdict for each score.

    Parameters
    ----------
    paired : Paired
    alpha : float
        Largest probability of any false "worse" or "better" in the whole comparison.

    Returns
    -------
    DataFrame
        One row a score, what matters most first: ``scenario, metric, parameter, verdict``;
        ``base, candidate``, means over the pairs (geometric where ratios are compared); ``runs,
        pairs``; ``change, interval``, candidate/base − 1, of a bias (``scale``) the
        difference; ``p``, uncorrected; ``margin``, as the change is;
        ``reason``, why a clear change is undecided: "few" (rare failures may not have shown in so
        few runs), "far" (a run lies far on the other side).
    """
    scores = paired.scores.reset_index(drop=True)
    if scores.empty:
        return pd.DataFrame({"verdict": []})
    changes = pd.DataFrame(scores["changes"].tolist())  # NaN where one has fewer
    about = scores[["scenario", "metric", "margin"]].to_numpy().T
    rows = scores.join(decide(changes, *about, alpha))  # type: ignore[call-arg]
    ratio, scale = rows["scale"].isna(), rows["scale"].fillna(1.0)
    for name in ("change", "low", "high"):
        rows[name] = np.where(ratio, np.expm1(np.minimum(rows[name], 700)), scale * rows[name])
    rows["margin"] *= scale
    rows["runs"] = rows["changes"].map(len)
    rows["interval"] = rows[["low", "high"]].to_numpy().tolist()
    order = rows["verdict"].map([*ORDER, SILENT].index)
    rows = rows.iloc[np.lexsort((-abs(rows["change"]) / rows["margin"], order))]
    return rows.drop(columns=["changes", "low", "high"])


def decide(
    changes: Any, scenarios: Any, metrics: Any, margins: Any, alpha: float = ALPHA
) -> pd.DataFrame:
    """Judge all scores of one comparison.

    Parameters
    ----------
    changes : array_like (S, n)
        log(candidate/base) of each score and seed, or the difference as a share; NaN where there
        is no pair.
    scenarios, metrics, margins : ndarray (S,)
        What each score is, and the share by which a change matters.
    alpha : float
        Of the whole comparison.

    Returns
    -------
    DataFrame
        One row a score: ``pairs, change, low, high, p, verdict, reason``.
    """
    pairs = pd.DataFrame(changes)
    n, mean, se = pairs.count(axis=1), pairs.mean(axis=1), pairs.sem(axis=1)
    mean, se = (x.mask(abs(x) <= 1e-12, 0.0).to_numpy() for x in (mean, se))  # rounding errors
    n, margin = n.to_numpy(), np.log1p(np.asarray(margins, float))
    freedom, level = np.maximum(n - 1, 1), np.empty(len(n))
    guard = np.array([SCORES[metric].guard for metric in metrics])
    with np.errstate(all="ignore"):
        # Scores that are equal on every seed cannot differ: their p is NaN, no member of a family.
        p = np.where(n > 1, 2 * stdtr(freedom, -abs(mean) / se), 1.0)
        for kind in (False, True):
            level[guard == kind] = holm_levels(p[guard == kind], SHARES[kind] * alpha)
        half = np.where(n > 1, -stdtrit(freedom, level / 2) * se, np.inf)
        low, high = mean - half, mean + half
        way = 1 * (low > 0) - (high < 0)
        runs, ways = _agreeing(way, n, scenarios, metrics)
        seen = abs(mean) > UNSEEN * np.expm1(-np.log(alpha / ways) / runs)
    beyond, inside = np.maximum(low, -high) > margin, np.maximum(-low, high) < margin
    off = pairs.sub(pairs.median(axis=1), axis=0)
    outlier = off.gt(SCATTER * abs(off).median(axis=1), axis=0) & (pairs > FAILED)
    spoilt = np.isin(metrics, metrics[outlier.any(axis=1).to_numpy()])
    far = beyond & seen & (way < 0) & spoilt
    clear = beyond & seen & ~far
    choices = [clear & (way > 0), clear, inside & (way != 0), inside]
    words = np.select(choices, [WORSE, BETTER, SLIGHT, SAME], UNDECIDED)
    words = np.where(guard & (words != WORSE), SILENT, words)
    return pd.DataFrame({
        "pairs": n, "change": mean, "low": low, "high": high, "p": p,
        "verdict": words,
        "reason": np.select([far, beyond & ~seen], ["far", "few"], ""),
    })  # fmt: skip


def _agreeing(way: Any, n: Any, scenarios: Any, metrics: Any) -> tuple[Any, Any]:
    """Return the runs (S,) behind each change, and the ways to choose the scenarios that agree.

    These are the runs of all scores of the metric that change the same way, each run once. What
    happens in a share q of the runs is missed by all n with probability (1 − q)ⁿ, so failures in
    fewer than 1 − alpha^(1/n) of them must be reckoned with.
    """
    table = pd.DataFrame({"metric": metrics, "way": way, "scenario": scenarios, "n": n})
    most = table.groupby(["metric", "way", "scenario"])["n"].max()
    own = table.join(most.groupby(["metric", "way"]).agg(["sum", "size"]), on=["metric", "way"])
    return own["sum"].to_numpy(), comb(
        table.groupby("metric")["scenario"].transform("nunique"), own["size"]
    )


def judge_lost(newly: int, regained: int, way: str, alpha: float = ALPHA) -> str:
    """Return the word for runs that one side alone lost, by McNemar's exact test.

    Undecided where a run is newly lost, and not made up for.
    """
    share = SHARES[way] * alpha
    if sign_p(newly, regained) <= LOST_WORSE * share:
        return WORSE
    if sign_p(regained, newly) <= (1 - LOST_WORSE) * share:
        return BETTER
    return UNDECIDED if newly and newly >= regained else SILENT


def losses(paired: Paired, *, alpha: float = ALPHA) -> list[Lost]:
    """Return a verdict for each way to lose a run; `alpha` as for `judge`."""
    verdicts = []
    for way in LOST:
        base, candidate = paired.lost[[f"{way} base", f"{way} candidate"]].to_numpy(bool).T
        counts = [int(x.sum()) for x in (base, candidate, candidate & ~base, base & ~candidate)]
        verdicts.append(Lost(way, len(base), *counts, judge_lost(*counts[2:], way, alpha)))  # type: ignore[arg-type, call-arg]
    return verdicts


def alarming(lost: Sequence[Lost]) -> bool:
    """Return whether so many runs were newly lost that somebody must look, significant or not.

    Two are enough if the base loses none; else chance must lose so many more in at most 5 %.
    """
    return any(
        way.newly >= 2 and (not way.base or sign_p(way.newly, way.regained) <= 0.05) for way in lost
    )


def overall(verdicts: Sequence[str], lost: Sequence[Lost] = ()) -> str:
    """Return the one word: any worse, else any undecided, any better, any slight, or same.

    Without a verdict on a score it is never "same".
    """
    words = {*verdicts, *(way.verdict for way in lost)}
    return next((word for word in ORDER if word in words), SAME if len(verdicts) else UNDECIDED)
