"""Rank estimators on paired runs, and find the best estimators for each fault."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.scoring.intervals import LEAST, difference, holm_levels, mean_interval

Row = Mapping[str, Any]

REFERENCE = "rpem-forgetting"
MATCHED, QUIETER, NOISIER = "matched", "quieter", "noisier"
CONTROLS = ("frozen", "oracle-reset")  # baselines, which are not ranked
AT_MOST = {QUIETER: "≤ ", NOISIER: "≥ "}
"""Inequality signs for lags at unmatched noise; `AT_LEAST` contains the signs for scores."""
AT_LEAST = {QUIETER: "≥ ", NOISIER: "≤ ", "mixed": "about "}
LEVEL = 0.05  # probability that at least one of several equally good estimators is ranked as worse


Scores = Sequence[float | None]
"""Values of a score, one per seed; an undefined value is None."""


def leaders(values: Mapping[str, Scores], *, most: bool = False) -> list[str]:
    """Return the best estimator and all estimators that are not significantly worse.

    The function compares pairs of estimators on their common seeds. For each estimator, the
    function counts the other estimators that are better on average. The best estimator is the one
    for which this count is smallest. The function uses the same seeds to select the best estimator
    and to test all other estimators. Therefore the significance level is corrected for all k(k−1)/2
    pairs of k estimators, with Bonferroni's method for the selection and Holm's method for the
    tests.

    Parameters
    ----------
    values : mapping of str to sequence of float or None (n,)
        Values of a score, one per seed, keyed by estimator. By default, smaller scores are better.
    most : bool
        Whether larger scores are better.

    Returns
    -------
    list of str
        Names of the estimators, with the best estimator first. The list is empty if no estimator
        has scores for at least five seeds, the minimum for a ranking.
    """
    scores = {name: (-1) ** most * np.array(each, float) for name, each in values.items()}
    seeds = {name: np.sum(~np.isnan(each)) for name, each in scores.items()}

    def place(name: str) -> tuple[bool, int, float]:
        ahead = sum(difference(scores[name], other)[1] > 0 for other in scores.values())
        return bool(seeds[name] < LEAST), ahead, float(np.nanmean(scores[name]))

    best, *others = sorted(scores, key=place) or [""]
    if not best or seeds[best] < LEAST:
        return []
    apart = [difference(scores[name], scores[best]) for name in others]
    levels = holm_levels([p for *_, p in apart], 2 * LEVEL / len(scores))
    tests = zip(others, apart, levels, strict=True)
    return [best, *(name for name, (_, mean, p), level in tests if mean <= 0 or p > level)]


def by_fault(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    """Group result rows by fault, that is, by scenario and changed parameter."""
    faults: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        faults.setdefault((row["scenario"], row["parameter"]), []).append(row)
    return faults


def mark(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Add the key `leads` to each row; `leads` is true if the estimator is among the best.

    The rows come from a sweep over tuning parameters, or from runs of each estimator at a single
    setting. Rows from a single setting do not contain the key `how`. Baselines are not ranked. An
    estimator is not ranked if it is noisier than the reference at every setting. If an estimator is
    less noisy than the reference at every setting, its lag must be shorter than the lag of every
    estimator with matched noise; otherwise it is not ranked.
    """
    rows = list(rows)
    ahead = {
        fault: leaders({row["estimator"]: row["values"]["lag"] for row in compete(own)})
        for fault, own in by_fault(rows).items()
    }
    return [
        dict(row) | {"leads": row["estimator"] in ahead[row["scenario"], row["parameter"]]}
        for row in rows
    ]


def compete(rows: Sequence[Row], score: str = "lag") -> list[Row]:
    """Return the rows of estimators at equal noise, and of less noisy ones that beat them all.

    Parameters
    ----------
    rows : sequence of mapping
        Rows with the keys ``estimator``, ``how`` and ``values``, and with the name of the score as
        a further key. The entry ``values`` contains the values of each score, one per seed.
    score : {"lag", "score"}
        Score by which estimators are ranked. A shorter lag or a higher score is better.
    """
    sign = 1 if score == "lag" else -1
    able = [r for r in rows if r["estimator"] not in CONTROLS and r["values"].get(score)]
    matched = [row for row in able if row.get("how", MATCHED) == MATCHED]
    best = min((sign * row[score] for row in matched), default=np.inf)
    return matched + [r for r in able if r.get("how") == QUIETER and sign * r[score] < best]


def overall(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the score of each estimator at equal excess error, averaged over all faults.

    Parameters
    ----------
    rows : sequence of mapping
        Sweep results at equal excess error, with one row for each fault and estimator.

    Returns
    -------
    list of dict
        Dicts with the keys ``estimator, score, score_interval, how, faults, leads, values``, sorted
        by decreasing mean score. The mean score includes all faults for which a lag bound exists. A
        missing score counts as 0. If, for some faults, the estimator is less noisy than the
        reference at all settings, ``how`` is "quieter" and the mean score is a lower limit. If, for
        some faults, the estimator is noisier than the reference at all settings, ``how`` is
        "noisier" and the mean score is an upper limit. ``how`` is "mixed" if the estimator is less
        noisy than the reference for some faults and noisier for others.
    """
    faults = list(by_fault(row for row in rows if row["bound"]))
    seeds = max((len(row["values"].get("score") or ()) for row in rows), default=0)
    if not faults or not seeds:
        return []
    results: list[dict[str, Any]] = []
    for estimator in dict.fromkeys(row["estimator"] for row in rows):
        own = {(r["scenario"], r["parameter"]): r for r in rows if r["estimator"] == estimator}
        each = [own[f]["values"].get("score") if f in own else None for f in faults]
        total = np.mean([values or np.zeros(seeds) for values in each], axis=0)
        how = {own[f]["how"] for f in faults if f in own} - {MATCHED}
        results.append({
            "estimator": estimator,
            "score": float(total.mean()),
            "score_interval": mean_interval(total),
            "how": MATCHED if not how else how.pop() if len(how) == 1 else "mixed",
            "faults": len(faults),
            "values": {"score": total.tolist()},
        })  # fmt: skip
    able = {row["estimator"]: row["values"]["score"] for row in compete(results, "score")}
    ahead = leaders(able, most=True)
    order = sorted(results, key=lambda row: -row["score"])
    return [row | {"values": row["values"]["score"], "leads": row["estimator"] in ahead}
            for row in order]  # fmt: skip


def too_few(rows: Iterable[Row]) -> str:
    """Return a message if there are too few seeds for a ranking.

    The message is empty if there are enough seeds, or if no row contains a lag.
    """
    lags = [np.array(row["values"]["lag"], float) for row in rows if row["values"].get("lag")]
    seeds = max((int(np.sum(~np.isnan(lag))) for lag in lags), default=LEAST)
    are = "seed is" if seeds == 1 else "seeds are"
    return f"{seeds} {are} too few for a ranking; {LEAST} are needed" if seeds < LEAST else ""


def faults_of(rows: Sequence[Row]) -> pd.DataFrame:
    """Return sweep results as a DataFrame, with a column `fault` that names each fault."""
    table = pd.DataFrame(rows, columns=None if rows else ["scenario", "parameter", "lag"])
    return table.assign(fault=table["scenario"] + ": " + table["parameter"],
                        lag=table["lag"].astype(float))  # fmt: skip


def widest(matched: pd.DataFrame) -> str:
    """Return the fault with the largest ratio of the longest lag to the shortest lag."""
    lags = matched.groupby("fault")["lag"].agg(["max", "min"])
    return str((lags["max"] / lags["min"]).fillna(0).idxmax())
