"""Judge a comparison: the changes in all scores, and in the numbers of lost runs."""

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
"""The five verdicts, in the order of their priority for the overall verdict."""

SILENT = "not more"
"""Verdict if a bias or the number of lost runs does not increase significantly. The verdict "not
more" does not affect the overall verdict."""

ALPHA = 0.01
"""Largest allowed probability of a false "worse" or "better" verdict in a comparison."""

SHARES = {False: 0.5, True: 0.1, "diverged": 0.2, "never_settled": 0.2}
"""Fraction of the significance level alpha for each group of tests. The key True stands for biases,
False for all other scores, and the remaining keys for the kinds of lost runs."""

LOST_WORSE = 0.75
"""Fraction of the significance level that a test of lost runs uses for the verdict "worse". With
alpha = 0.01, ten newly lost runs and no regained runs (p = 2⁻¹⁰) lead to the verdict "worse"."""

UNSEEN = 0.5
"""Assumed log-ratio of a rare change that is opposite to the observed changes, and occurred in no
run. A log-ratio of 0.5 corresponds to a factor of 1.65."""

FAILED, SCATTER = 0.2, 4 * 1.4826
"""Limits beyond which a change counts as a failure. The log-ratio of a failure is larger than
FAILED, and exceeds the median log-ratio by more than SCATTER times the median absolute deviation
(four standard deviations)."""


class Lost(NamedTuple):
    """Numbers of lost runs (either diverged or never settled), and the verdict on these numbers.

    The attribute `newly` is the number of runs that only the candidate lost. The attribute
    `regained` is the number of runs that only the base lost.
    """

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
        Paired scores of base and candidate.
    alpha : float
        Largest allowed probability of a false verdict "worse" or "better" in the whole comparison.

    Returns
    -------
    DataFrame
        One row per score, with the most important score first. The columns include ``scenario,
        metric, parameter, verdict, runs, pairs``. ``base`` and ``candidate`` are means over the
        paired runs, or geometric means if ratios are compared. ``change`` is candidate/base − 1,
        and ``interval`` is the confidence interval of ``change``. For a bias, ``change`` is the
        difference candidate − base. ``margin`` has the unit of ``change``. ``p`` is the p-value
        without correction for multiple tests. ``reason`` explains why the verdict on a clear change
        is "undecided". ``reason`` is "few" if there are too few runs to exclude rare failures.
        ``reason`` is "far" if the candidate is better on average, but much worse in at least one
        run.
    """
    scores = paired.scores.reset_index(drop=True)
    if scores.empty:
        return pd.DataFrame({"verdict": []})
    changes = pd.DataFrame(scores["changes"].tolist())  # rows with fewer runs are padded with NaN
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
        Change in each score for each seed: log(candidate/base), or (candidate − base)/scale. An
        entry is NaN if the base or the candidate lacks the score for the seed.
    scenarios, metrics, margins : ndarray (S,)
        Scenario, metric and smallest relevant relative change for each score.
    alpha : float
        Largest probability of any false verdict "worse" or "better" in the whole comparison.

    Returns
    -------
    DataFrame
        One row per score, with the columns ``pairs, change, low, high, p, verdict, reason``.
    """
    pairs = pd.DataFrame(changes)
    n, mean, se = pairs.count(axis=1), pairs.mean(axis=1), pairs.sem(axis=1)
    mean, se = (x.mask(abs(x) <= 1e-12, 0.0).to_numpy() for x in (mean, se))  # rounding errors
    n, margin = n.to_numpy(), np.log1p(np.asarray(margins, float))
    freedom, level = np.maximum(n - 1, 1), np.empty(len(n))
    guard = np.array([SCORES[metric].guard for metric in metrics])
    with np.errstate(all="ignore"):
        # If a score is equal on every seed, p is NaN and Holm's procedure ignores the score.
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
    """Count the runs that confirm each change, and the ways to select the confirming scenarios.

    The runs on a scenario confirm a change if any score of the same metric changes in the same
    direction on this scenario. Each run counts once. The first returned array contains the number
    of confirming runs for each score (S,). The second array (S,) contains the number of ways to
    select k of K scenarios, where k scenarios confirm the change in the score. If a failure has the
    probability q per run, the probability of no failure in n runs is (1 − q)ⁿ. Therefore n runs
    cannot exclude failures with a probability q below 1 − alpha^(1/n).
    """
    table = pd.DataFrame({"metric": metrics, "way": way, "scenario": scenarios, "n": n})
    most = table.groupby(["metric", "way", "scenario"])["n"].max()
    own = table.join(most.groupby(["metric", "way"]).agg(["sum", "size"]), on=["metric", "way"])
    return own["sum"].to_numpy(), comb(
        table.groupby("metric")["scenario"].transform("nunique"), own["size"]
    )


def judge_lost(newly: int, regained: int, way: str, alpha: float = ALPHA) -> str:
    """Return the verdict of McNemar's exact test on the runs that only one estimator lost.

    If the test is not significant, the verdict is "undecided" or "not more". The verdict is
    "undecided" if the candidate newly loses at least one run, and regains at most as many runs.
    """
    share = SHARES[way] * alpha
    if sign_p(newly, regained) <= LOST_WORSE * share:
        return WORSE
    if sign_p(regained, newly) <= (1 - LOST_WORSE) * share:
        return BETTER
    return UNDECIDED if newly and newly >= regained else SILENT


def losses(paired: Paired, *, alpha: float = ALPHA) -> list[Lost]:
    """Return a verdict for each kind of lost run; `alpha` has the same meaning as in `judge`."""
    verdicts = []
    for way in LOST:
        base, candidate = paired.lost[[f"{way} base", f"{way} candidate"]].to_numpy(bool).T
        counts = [int(x.sum()) for x in (base, candidate, candidate & ~base, base & ~candidate)]
        verdicts.append(Lost(way, len(base), *counts, judge_lost(*counts[2:], way, alpha)))  # type: ignore[arg-type, call-arg]
    return verdicts


def alarming(lost: Sequence[Lost]) -> bool:
    """Return whether newly lost runs need attention, even if the increase is not significant.

    The function examines diverged runs and unsettled runs separately. The result is true if at
    least two runs of one kind are newly lost, and if the increase in lost runs is clear. An
    increase is clear if the base loses no run of the same kind, or if the p-value of the increase
    is at most 5 %.
    """
    return any(
        way.newly >= 2 and (not way.base or sign_p(way.newly, way.regained) <= 0.05) for way in lost
    )


def overall(verdicts: Sequence[str], lost: Sequence[Lost] = ()) -> str:
    """Return the overall verdict, which is the verdict with the highest priority in `ORDER`.

    If no verdict appears in `ORDER`, the overall verdict is "same". If there are no scores, the
    overall verdict is "undecided".
    """
    words = {*verdicts, *(way.verdict for way in lost)}
    return next((word for word in ORDER if word in words), SAME if len(verdicts) else UNDECIDED)
