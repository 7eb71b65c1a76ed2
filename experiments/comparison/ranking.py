"""Rank estimators on paired runs: find the best for each fault, and those not clearly worse."""

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
"""Sign before a lag if the noise is not matched; `AT_LEAST` contains the signs before a score."""
AT_LEAST = {QUIETER: "≥ ", NOISIER: "≤ ", "mixed": "about "}
LEVEL = 0.05  # probability that any of several equally good estimators is ranked as worse


Scores = Sequence[float | None]
"""A score for each seed; None where the score is undefined, as after a failed run."""


def leaders(values: Mapping[str, Scores], *, most: bool = False) -> list[str]:
    """Return the best estimator and all estimators that are not significantly worse.

    Estimators are compared in pairs on their common seeds. The best estimator is the one to which
    the fewest others are superior on average. The same seeds are used to choose the best estimator
    and to test the others, so the level is divided as if all k(k−1)/2 pairs were tested (Bonferroni
    for the choice of the best, Holm for the tests).

    Parameters
    ----------
    values : mapping of str to sequence of float or None (n,)
        Values of a score for each seed, keyed by estimator. Smaller values are better by default.
    most : bool
        Whether larger values are better.

    Returns
    -------
    list of str
        Names of the estimators with the best first; empty if no estimator has values for the five
        seeds that a ranking needs.
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
    """Group rows by fault, that is by scenario and parameter."""
    faults: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        faults.setdefault((row["scenario"], row["parameter"]), []).append(row)
    return faults


def mark(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Add `leads` to each row: true if the estimator is among the best for the fault of the row.

    The rows come from a sweep, or (without `how`) from runs of each estimator at one setting.
    Baselines are not ranked, nor are estimators that are noisier than the reference at every
    setting. An estimator that is quieter at every setting is ranked only if its lag is shorter than
    the lags of all estimators at equal noise.
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
    """Return the rows to rank: estimators at equal noise, and better estimators with less noise.

    Parameters
    ----------
    rows : sequence of mapping
        Rows with ``estimator, how``, the score, and ``values``, the score for each seed.
    score : {"lag", "score"}
        Score that is ranked; a short lag or a high score is better.
    """
    sign = 1 if score == "lag" else -1
    able = [r for r in rows if r["estimator"] not in CONTROLS and r["values"].get(score)]
    matched = [row for row in able if row.get("how", MATCHED) == MATCHED]
    best = min((sign * row[score] for row in matched), default=np.inf)
    return matched + [r for r in able if r.get("how") == QUIETER and sign * r[score] < best]


def overall(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the mean score of each estimator at equal excess error, averaged over all faults.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of a sweep at equal excess error, one for each fault and estimator.

    Returns
    -------
    list of dict
        Dicts with ``estimator, score, score_interval, how, faults, leads`` and ``values``, the best
        first. The mean is over all faults that have a bound; a missing score counts as 0. ``how``
        is "quieter" if all settings are quieter than the reference for some faults (the score is
        then a lower limit), "noisier" if all settings are noisier for some faults (an upper limit),
        and "mixed" if both occur.
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
    """Return a message if there are fewer seeds than a ranking needs.

    The message is empty if there are enough seeds, or if no row has a lag.
    """
    lags = [np.array(row["values"]["lag"], float) for row in rows if row["values"].get("lag")]
    seeds = max((int(np.sum(~np.isnan(lag))) for lag in lags), default=LEAST)
    are = "seed is" if seeds == 1 else "seeds are"
    return f"{seeds} {are} too few for a ranking, which needs {LEAST}" if seeds < LEAST else ""


def faults_of(rows: Sequence[Row]) -> pd.DataFrame:
    """Return rows of a sweep as a DataFrame with a column `fault` (scenario and parameter)."""
    table = pd.DataFrame(rows, columns=None if rows else ["scenario", "parameter", "lag"])
    return table.assign(fault=table["scenario"] + ": " + table["parameter"],
                        lag=table["lag"].astype(float))  # fmt: skip


def widest(matched: pd.DataFrame) -> str:
    """Return the fault for which the lags at equal noise differ most between estimators."""
    lags = matched.groupby("fault")["lag"].agg(["max", "min"])
    return str((lags["max"] / lags["min"]).fillna(0).idxmax())
