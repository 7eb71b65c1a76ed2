"""The rules: what can be said of each score, and of the runs that were lost."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.special import comb, stdtr, stdtrit

from flexaxis.experiments.gate.pairs import LOST, Array, Paired
from flexaxis.experiments.scoring.intervals import holm_levels, sign_p
from flexaxis.experiments.scoring.score_table import METRICS, SCORES

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

MOST_SEEDS = 4000  # more are no answer to "how many seeds?"


def judge(paired: Paired, *, alpha: float = ALPHA) -> pd.DataFrame:
    """Return a verdict for each way to lose a run, and for each score.

    Parameters
    ----------
    paired : Paired
    alpha : float
        Largest probability of any false "worse" or "better" in the whole comparison.

    Returns
    -------
    DataFrame
        One row a verdict: ``scenario`` ("all" of lost runs), ``metric, parameter, verdict``;
        ``base, candidate``, means over the pairs (geometric where ratios are compared) or counts
        of lost runs; ``runs, pairs``; ``change, interval``, candidate/base − 1, or where scores
        may be 0 the difference in ``unit``; ``p, level``, uncorrected and by Holm's procedure;
        ``margin`` and ``scale``, as the change is; ``bias``; ``seeds_needed``, about how many would
        decide; ``reason``, why a clear change is undecided: "few" (rare failures may not have
        shown in so few runs), "far" (a run lies far on the other side); ``newly, regained``, runs
        that one side alone lost; ``worst_scenario, worst_seed``, where the candidate is worst.
    """
    rows = [_lost(paired, way, alpha) for way in LOST]
    if len(paired.scores):
        scores = paired.scores
        changes = pd.DataFrame(scores["changes"].tolist()).to_numpy()  # NaN where one has fewer
        scenario, metric, margin = (
            scores[name].to_numpy() for name in ("scenario", "metric", "margin")
        )
        decided = scores.assign(**decide(changes, scenario, metric, margin, alpha))
        rows += [_row(score) for _, score in decided.iterrows()]
    return pd.DataFrame(rows)


def decide(changes: Array, scenarios: Any, metrics: Any, margins: Any, alpha: float = ALPHA) -> Any:
    """Judge all scores of one comparison.

    Parameters
    ----------
    changes : ndarray (S, n)
        log(candidate/base) of each score and seed, or the difference as a share; NaN where there
        is no pair.
    scenarios, metrics, margins : ndarray (S,)
        What each score is, and the share by which a change matters.
    alpha : float
        Of the whole comparison.

    Returns
    -------
    dict of str to ndarray (S,)
        ``n, mean, low, high, p, level, verdict, reason, seeds_needed``.
    """
    n, mean, se = _moments(changes)
    freedom, margin = np.maximum(n - 1, 1), np.log1p(margins)
    guard = np.array([SCORES[metric].guard for metric in metrics])
    level = np.empty(len(n))
    with np.errstate(all="ignore"):
        # Scores that are equal on every seed cannot differ: their p is NaN, no member of a family.
        p = np.where(n > 1, 2 * stdtr(freedom, -abs(mean) / se), 1.0)
        for kind in (False, True):
            level[guard == kind] = holm_levels(p[guard == kind], SHARES[kind] * alpha)
        half = np.where(n > 1, -stdtrit(freedom, level / 2) * se, np.inf)
        low, high = mean - half, mean + half
        way = np.where(low > 0, 1, 0) - np.where(high < 0, 1, 0)
        runs, ways = _agreeing(way, n, scenarios, metrics)
        seen = abs(mean) > UNSEEN * np.expm1(-np.log(alpha / ways) / runs)
        narrow = n * (half / abs(abs(mean) - margin)) ** 2
        rare = np.log(1 / alpha) / np.log1p(abs(mean) / UNSEEN) * n / runs
    beyond, inside = np.maximum(low, -high) > margin, np.maximum(-low, high) < margin
    spoilt = np.isin(metrics, metrics[far_pairs(changes).any(axis=1)])
    far = beyond & seen & (way < 0) & spoilt
    clear = beyond & seen & ~far
    choices = [clear & (way > 0), clear, inside & (way != 0), inside]
    words = np.select(choices, [WORSE, BETTER, SLIGHT, SAME], UNDECIDED)
    words = np.where(guard & (words != WORSE), SILENT, words)
    needed = np.maximum(np.ceil(np.maximum(narrow, np.where(beyond, rare, 0))), n + 1)
    unknown = far | (words != UNDECIDED) | ~(needed <= MOST_SEEDS)
    return {
        "n": n, "mean": mean, "low": low, "high": high, "p": p, "level": level, "verdict": words,
        "reason": np.select([far, beyond & ~seen], ["far", "few"], ""),
        "seeds_needed": np.where(unknown, np.nan, needed),
    }  # fmt: skip


def _moments(changes: Array) -> tuple[Any, Array, Array]:
    """Return number, mean and standard error (S,) of the pairs; rounding errors are equal."""
    pairs = np.isfinite(changes)
    n = pairs.sum(axis=1)
    mean = np.where(pairs, changes, 0.0).sum(axis=1) / np.maximum(n, 1)
    off = np.where(pairs, changes - mean[:, None], 0.0)
    se = np.sqrt((off**2).sum(axis=1) / np.maximum(n - 1, 1) / np.maximum(n, 1))
    se[abs(off).max(axis=1) <= 1e-12] = 0.0
    return n, np.where((se == 0) & (abs(mean) <= 1e-12), 0.0, mean), se


def far_pairs(changes: Array) -> NDArray[np.bool_]:
    """Return which pairs (S, n) are far slower or noisier than the base, and than the others."""
    values = np.ma.masked_invalid(changes)
    off = values - np.ma.median(values, axis=1, keepdims=True)
    scatter = np.ma.median(abs(off), axis=1, keepdims=True)
    return np.ma.filled((values > FAILED) & (off > SCATTER * scatter), False)


def _agreeing(way: Any, n: Any, scenarios: Any, metrics: Any) -> tuple[Any, Array]:
    """Return the runs (S,) behind each change, and the ways to choose the scenarios that agree.

    These are the runs of all scores of the metric that change the same way, each run once. What
    happens in a share q of the runs is missed by all n with probability (1 − q)ⁿ, so failures in
    fewer than 1 − alpha^(1/n) of them must be reckoned with.
    """
    runs, ways = np.ones_like(n), np.ones(len(n))
    for metric, side in product(np.unique(metrics), (-1, 1)):
        places = np.unique(scenarios[metrics == metric])
        agree = (metrics == metric) & (way == side)
        most = [n[agree & (scenarios == place)].max(initial=0) for place in places]
        runs[agree], ways[agree] = sum(most), comb(len(most), np.count_nonzero(most))
    return runs, ways


def _row(s: pd.Series) -> dict[str, Any]:
    """Return the verdict on a score as `judge` returns it."""
    ratio, paired = np.isnan(s["scale"]), np.isfinite(s["changes"])
    average = stats.gmean if ratio else np.mean

    def back(changes: Any) -> Any:
        return np.expm1(np.minimum(changes, 700)) if ratio else s["scale"] * changes

    worst = np.argmax(np.where(paired, s["changes"], -np.inf))
    both = [average(x[paired]) if s["n"] else None for x in s["values"]]
    shown = s[["scenario", "metric", "parameter", "verdict", "reason", "p", "level", "bias"]]
    return dict(shown) | {
        "base": both[0], "candidate": both[1], "runs": len(paired), "pairs": s["n"],
        "change": back(s["mean"]) if s["n"] else None,
        "interval": back(np.array([s["low"], s["high"]])) if s["n"] > 1 else None,
        "margin": s["margin"] * (1 if ratio else s["scale"]),
        "unit": None if ratio else METRICS[s["metric"]], "scale": None if ratio else s["scale"],
        "seeds_needed": s["seeds_needed"],
        "worst_scenario": s["scenario"], "worst_seed": int(s["seeds"][worst]),
    }  # fmt: skip


def judge_lost(newly: int, regained: int, way: str, alpha: float = ALPHA) -> tuple[str, float]:
    """Return the word for runs that one side alone lost, and the level of McNemar's exact test.

    Undecided where a run is newly lost, and not made up for.
    """
    worse, better = (SHARES[way] * alpha * part for part in (LOST_WORSE, 1 - LOST_WORSE))
    if sign_p(newly, regained) <= worse:
        return WORSE, worse
    if sign_p(regained, newly) <= better:
        return BETTER, better
    return UNDECIDED if newly and newly >= regained else SILENT, worse


def _lost(paired: Paired, way: str, alpha: float) -> dict[str, Any]:
    base, candidate = paired.lost[[f"{way} base", f"{way} candidate"]].to_numpy().T
    new, back = candidate & ~base, base & ~candidate
    newly, regained, runs = int(new.sum()), int(back.sum()), len(base)
    word, level = judge_lost(newly, regained, way, alpha)
    # To look at: a run newly lost, else a lost one, else any.
    scenario, seed = paired.lost.index[np.argmax(2 * new + (base | candidate))]
    return {
        "scenario": "all", "metric": way, "parameter": "", "verdict": word, "reason": "",
        "p": sign_p(max(newly, regained), min(newly, regained)), "level": level,
        "base": int(base.sum()), "candidate": int(candidate.sum()), "runs": runs, "pairs": runs,
        "newly": newly, "regained": regained, "worst_scenario": scenario, "worst_seed": int(seed),
    }  # fmt: skip


def alarming(verdicts: pd.DataFrame) -> bool:
    """Return whether so many runs were newly lost that somebody must look, significant or not.

    Two are enough if the base loses none; else chance must lose so many more in at most 5 %.
    """
    lost = verdicts.loc[verdicts["metric"].isin(LOST), ["newly", "regained", "base"]]
    counts = [*lost.astype(int).to_numpy(), lost.sum().astype(int).to_numpy()]
    return any(new >= 2 and (not base or sign_p(new, back) <= 0.05) for new, back, base in counts)


def overall(verdicts: pd.DataFrame) -> str:
    """Return the one word: any worse, else any undecided, any better, any slight, or same."""
    scored = not verdicts["metric"].isin(LOST).all()
    words = {*verdicts["verdict"]}
    return next((word for word in ORDER if word in words), SAME if scored else UNDECIDED)
