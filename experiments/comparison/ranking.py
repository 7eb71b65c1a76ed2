"""Rank estimators on paired runs: the best for each fault, and those not significantly worse."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.scoring.intervals import LEAST, difference, holm_levels, mean_interval

Row = Mapping[str, Any]

REFERENCE = "rpem-forgetting"
MATCHED, QUIETER, NOISIER = "matched", "quieter", "noisier"
CONTROLS = ("frozen", "oracle-reset")  # they know more than an estimator may, or nothing
AT_MOST = {QUIETER: "≤ ", NOISIER: "≥ "}
"""Sign before a lag that no setting matches; before a score it is the other way round."""
AT_LEAST = {QUIETER: "≥ ", NOISIER: "≤ ", "mixed": "about "}
LEVEL = 0.05  # probability that any of those that are equally good is wrongly told apart


Scores = Sequence[float | None]
"""A score seed by seed; None where an estimator has none, such as where it could not be run."""


def leaders(values: Mapping[str, Scores], *, most: bool = False) -> list[str]:
    """Return the best and all that are not significantly worse.

    Pairs are compared on their common seeds, and the best is the one that is behind the fewest
    others. As it is chosen on the same seeds, the level is divided as for all k(k−1)/2 pairs
    (Bonferroni over the choice of the best, Holm over the rest).

    Parameters
    ----------
    values : mapping of str to sequence of float or None (n,)
        A score by name, seed by seed; less is better.
    most : bool
        Whether more is better.

    Returns
    -------
    list of str
        The best first; empty where none has the five seeds that a ranking takes.
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
    """Return the rows of each fault, by scenario and parameter."""
    faults: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        faults.setdefault((row["scenario"], row["parameter"]), []).append(row)
    return faults


def mark(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return the rows with `leads`: whether an estimator is among the best at its fault.

    The rows are of a sweep, or of estimators at the one setting that they were run at (without
    `how`). Controls do not compete, nor does one that is noisier than the reference at every
    setting. One that is quieter at every setting may be quicker than its lag here, and never counts
    as slower.
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
    """Return the rows that can be ranked: at equal noise, or quieter and better than all of these.

    Parameters
    ----------
    rows : sequence of mapping
        ``estimator, how``, the score, and ``values`` of it.
    score : {"lag", "score"}
    """
    sign = 1 if score == "lag" else -1
    able = [r for r in rows if r["estimator"] not in CONTROLS and r["values"].get(score)]
    matched = [row for row in able if row.get("how", MATCHED) == MATCHED]
    best = min((sign * row[score] for row in matched), default=np.inf)
    return matched + [r for r in able if r.get("how") == QUIETER and sign * r[score] < best]


def overall(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return one number an estimator over all faults: its mean score at equal excess error.

    Parameters
    ----------
    rows : sequence of mapping
        Of a sweep, matched on the excess error: one for each fault and estimator.

    Returns
    -------
    list of dict
        ``estimator, score, score_interval, how, faults, leads``, the best first. The set of faults
        is the same for all, those for which a bound is defined; an estimator without a score at
        one has 0 there. `how` is "quieter" or "noisier" where that is all that can be said at some
        of them (the score is then at least, or at most, so much), "mixed" where both occur.
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
    """Return in words that there are fewer seeds than a ranking takes.

    Empty where there are enough, or no rows with a lag.
    """
    lags = [np.array(row["values"]["lag"], float) for row in rows if row["values"].get("lag")]
    seeds = max((int(np.sum(~np.isnan(lag))) for lag in lags), default=LEAST)
    are = "seed is" if seeds == 1 else "seeds are"
    return f"{seeds} {are} too few to rank: from {LEAST} on" if seeds < LEAST else ""


def faults_of(rows: Sequence[Row]) -> pd.DataFrame:
    """Return rows of a sweep as a DataFrame, with the name of their `fault`."""
    table = pd.DataFrame(rows, columns=None if rows else ["scenario", "parameter", "lag"])
    return table.assign(fault=table["scenario"] + ": " + table["parameter"],
                        lag=table["lag"].astype(float))  # fmt: skip


def widest(matched: pd.DataFrame) -> str:
    """Return the fault at which the lags of estimators at equal noise differ most."""
    lags = matched.groupby("fault")["lag"].agg(["max", "min"])
    return str((lags["max"] / lags["min"]).fillna(0).idxmax())
