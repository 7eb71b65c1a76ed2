"""A study in a sentence: who follows a change soonest, or errs least where nothing changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flexaxis.experiments.reporting.study import rows as study_rows
from flexaxis.experiments.reporting.tables import number, pair
from flexaxis.experiments.results.results import Results

TOLD = 3  # estimators in the sentence
SCORES = ("lag", "std", "bias", "diverged")


def finding(results: Results) -> str:
    """Return the sentence: pooled over all points, as the estimators are set."""
    rows = study_rows.rows_of(results, [], {}, SCORES)
    lags = [row for row in rows if row["changed"] and row["lag"] is not None]
    if lags:
        names = dict.fromkeys(row["parameter"] for row in lags)
        text = ". ".join(_soonest([r for r in lags if r["parameter"] == n], n) for n in names)
    elif rows:
        text = _surest(rows)
    else:
        return "No case could be run."
    lost = max((row["diverged"] for row in rows), default=0)
    more = f" Of the runs of one estimator up to {lost} were lost." if lost else ""
    return f"{text}.{more}"


def _soonest(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """Return who follows a change of a parameter soonest, in words."""
    ordered = sorted(rows, key=lambda row: row["lag"])
    told = [
        f"{row['who']} {number(row['lag'], 2)} s ({pair(row['lag_interval'])})"
        if row["lag_interval"]
        else f"{row['who']} {number(row['lag'], 2)} s"
        for row in ordered[:TOLD]
    ]
    rest = f" and {len(ordered) - TOLD} more" if len(ordered) > TOLD else ""
    return (
        f"Lag after a change of {name} over all points, as set and not at equal noise: "
        f"{', '.join(told)}{rest}"
    )


def _surest(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the error of each where nothing changes, the least first, in words."""
    errors = {
        (row["who"], row["parameter"]): (row["std"] ** 2 + (row["bias"] or 0.0) ** 2) ** 0.5
        for row in rows
        if row["std"] is not None
    }
    names = dict.fromkeys(name for _, name in errors)
    parts = []
    for name in names:
        least, who = min((error, who) for (who, other), error in errors.items() if other == name)
        parts.append(f"{name} {number(least, 2)} % by {who}")
    return f"Least error over all points, root mean square: {', '.join(parts)}"
