"""The rules: what can be said of each score, and of the runs that were lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from scipy.special import comb

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
        rows += [_row(score) for _, score in decide(paired.scores, alpha).iterrows()]
    return pd.DataFrame(rows)


def decide(scores: pd.DataFrame, alpha: float = ALPHA) -> pd.DataFrame:
    """Judge all scores of one comparison.

    Parameters
    ----------
    scores : DataFrame
        With ``scenario, metric, margin, changes``, as from `flexaxis.experiments.gate.pairs`.
    alpha : float
        Of the whole comparison.

    Returns
    -------
    DataFrame
        The scores with ``n, mean, se`` of the changes, ``p, level, low, high, verdict, reason,
        seeds_needed``.
    """
    moments = pd.DataFrame([_moments(x[np.isfinite(x)]) for x in scores["changes"]], scores.index)
    s = scores.join(moments)
    freedom = np.maximum(s["n"] - 1, 1)
    with np.errstate(divide="ignore", invalid="ignore"):  # equal on every seed: p is NaN
        s["p"] = np.where(s["n"] > 1, 2 * stats.t.sf(abs(s["mean"]) / s["se"], freedom), 1.0)
    guard = s["metric"].map(lambda metric: SCORES[metric].guard)
    s["level"] = s.groupby(guard)["p"].transform(lambda p: holm_levels(p, SHARES[p.name] * alpha))
    half = np.where(s["n"] > 1, stats.t.isf(s["level"] / 2, freedom) * s["se"], np.inf)
    s["low"], s["high"], margin = s["mean"] - half, s["mean"] + half, np.log1p(s["margin"])
    s["way"] = np.sign(s["low"]).where(s["low"] > 0, -np.sign(-s["high"].clip(upper=0)))
    runs, ways = _agreeing(s)
    with np.errstate(over="ignore"):
        seen = abs(s["mean"]) > UNSEEN * np.expm1(-np.log(alpha / ways) / runs)
    beyond = np.maximum(s["low"], -s["high"]) > margin
    inside = np.maximum(-s["low"], s["high"]) < margin
    far = beyond & seen & (s["way"] < 0) & s.groupby("metric")["failed"].transform("any")
    choices = [
        beyond & seen & (s["way"] > 0),
        beyond & seen & ~far,
        inside & (s["way"] != 0),
        inside,
    ]
    words = np.select(choices, [WORSE, BETTER, SLIGHT, SAME], UNDECIDED)
    s["verdict"] = np.where(guard & (words != WORSE), SILENT, words)
    s["reason"] = np.select([far, beyond & ~seen], ["far", "few"], "")
    with np.errstate(all="ignore"):
        narrow = s["n"] * (half / abs(abs(s["mean"]) - margin)) ** 2
        rare = np.log(1 / alpha) / np.log1p(abs(s["mean"]) / UNSEEN) * s["n"] / runs
    needed = np.ceil(np.maximum(narrow, rare.where(beyond, 0.0))).clip(lower=s["n"] + 1)
    decidable = (s["verdict"] == UNDECIDED) & ~far & (needed <= MOST_SEEDS)
    return s.assign(seeds_needed=needed.where(decidable))


def _moments(x: Array) -> dict[str, Any]:
    """Return number, mean and standard error of changes, and whether one of them is a failure.

    A failure is far slower or noisier than the base, and than the other runs. What differs by
    rounding errors is equal.
    """
    n = len(x)
    if not n:
        return {"n": 0, "mean": 0.0, "se": 0.0, "failed": False}
    mean, off = x.mean(), x - np.median(x)
    failed = bool(((x > FAILED) & (off > SCATTER * np.median(abs(off)))).any())
    se = x.std(ddof=1) / np.sqrt(n) if n > 1 and np.ptp(x) > 1e-12 else 0.0
    return {"n": n, "mean": mean if abs(mean) > 1e-12 else 0.0, "se": se, "failed": failed}


def _agreeing(s: pd.DataFrame) -> tuple[pd.Series, pd.Series]:
    """Return the runs behind each change, and the ways to choose the scenarios that agree.

    These are the runs of all scores of the metric that change the same way, each run once. What
    happens in a share q of the runs is missed by all n with probability (1 − q)ⁿ, so failures in
    fewer than 1 − alpha^(1/n) of them must be reckoned with.
    """
    most = s.groupby(["metric", "way", "scenario"])["n"].max().groupby(["metric", "way"])
    found = s[["metric", "way"]].join(most.agg(["sum", "size"]), on=["metric", "way"])
    scenarios = s.groupby("metric")["scenario"].transform("nunique")
    return found["sum"].clip(lower=1), comb(scenarios, found["size"])


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
