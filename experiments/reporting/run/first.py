"""What the report of a run says first: three questions answered, and the one table that ranks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flexaxis.experiments.comparison import ranking
from flexaxis.experiments.comparison.matching import MATCHED
from flexaxis.experiments.scoring.intervals import LEAST

Row = Mapping[str, Any]

FASTEST = "Who is fastest at equal noise?"
DISTANCE = "How far from the bound?"
WHY = "Why?"
TOO_FEW = "Too few seeds to rank: nothing is said of who is faster with fewer than five."
BECAUSE = (
    "{slow} forgets at a constant rate, so it averages over a fixed time: what makes it quiet "
    "before a fault makes it slow after it. {quick} waits for evidence of a change, and gives up "
    "what it knew only then."
)


def order(summary: Mapping[str, Any]) -> list[str]:
    """Return the estimators of a run in the order of its one ranking, others behind as named.

    Parameters
    ----------
    summary : mapping
        As in summary.json.
    """
    swept = summary.get("tradeoff") or {"overall": [], "points": [], "matched": []}
    ranked = [row["estimator"] for row in swept["overall"]]
    rest = [row["estimator"] for part in ("points", "matched") for row in swept[part]]
    return list(dict.fromkeys([*ranked, *rest, *summary["estimators"]]))


def drawn_first(summary: Mapping[str, Any], number: int) -> tuple[list[str], str]:
    """Return the estimators in the order of a page that draws so many, and why those.

    Of more without a ranking those with the shortest lags as set come first, who was lost last.

    Parameters
    ----------
    summary : mapping
        As in summary.json.
    number : int
        How many estimators charts show until others are asked for.
    """
    names = order(summary)
    if len(names) <= number:
        return names, ""
    why = "the best of the first table"
    if not (summary.get("tradeoff") or {}).get("overall"):
        names, why = _by_lag(names, summary["rows"]), "those with the shortest lags as set"
    return names, (
        f"Charts draw {number} of {len(names)} estimators at first, {why}; tables have them all, "
        "and the list of estimators above draws the others."
    )


def _by_lag(names: Sequence[str], rows: Iterable[Row]) -> list[str]:
    """Return estimators by the mean logarithm of their lags, lost ones behind, others as named."""
    lags: dict[str, list[float]] = {name: [] for name in names}
    lost = dict.fromkeys(names, 0)
    for row in rows:
        lost[row["estimator"]] += row["diverged"]
        if row["changed"] and row["lag"]:
            lags[row["estimator"]].append(math.log(row["lag"]))
    return sorted(
        names,
        key=lambda name: (
            not lags[name],
            lost[name] > 0,
            sum(lags[name]) / max(1, len(lags[name])),
        ),
    )


def too_few(rows: Iterable[Row]) -> bool:
    """Return whether rows with paired ``values`` of lag are of too few seeds to be ranked."""
    counts = [len(row["values"]["lag"]) for row in rows if row["values"].get("lag")]
    return bool(counts) and max(counts) < LEAST


def at_equal_noise(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the table that the report leads with, estimator × fault at equal noise, or None."""
    swept = summary.get("tradeoff")
    if not swept:
        return None
    few = too_few(swept["matched"])
    rows = _by_fault(swept["matched"], few)
    there = {p["estimator"] for p in swept["points"]} | {key[2] for key in rows}
    overall = {row["estimator"]: _unranked(row, few) for row in swept["overall"]}
    return {
        "faults": list(dict.fromkeys(key[:2] for key in rows)),
        "estimators": [name for name in order(summary) if name in there],
        "rows": rows,
        "at_excess": _by_fault(swept.get("at_excess") or (), few),
        "overall": overall,
        "words": swept["faults"],
        "reference": ranking.REFERENCE,
        "few": few,
        "scope": _scope(list(dict.fromkeys(key[0] for key in rows)), summary["scenarios"]),
    }


def _by_fault(rows: Iterable[Row], few: bool) -> dict[tuple[str, str, str], Row]:
    return {(r["scenario"], r["parameter"], r["estimator"]): _unranked(r, few) for r in rows}


def _unranked(row: Row, few: bool) -> Row:
    return {**row, "leads": False} if few else row


def _scope(faults: Sequence[str], scenarios: Iterable[str]) -> str:
    """Return in a sentence which scenarios are compared at equal noise, and which are not."""
    others = [name for name in scenarios if name not in faults]
    only = [name for name in faults if name not in set(scenarios)]
    text = f"Compared at equal noise: {_and(faults)}." if faults else ""
    if only:
        text += f" {_and(only)} {'is' if len(only) == 1 else 'are'} run for that alone."
    if others:
        text += f" As set only, further down: {_and(others)}."
    return text


def answers(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the questions that a newcomer has, each with its answer; none without a sweep."""
    swept = summary.get("tradeoff") or {"matched": [], "overall": []}
    rows = [r for r in swept["matched"] if r["lag"]]
    if not rows:
        return []
    if too_few(rows):
        return [(FASTEST, TOO_FEW)]
    why = _why(rows, swept["overall"])
    return [
        (FASTEST, _fastest(rows, swept["overall"])),
        (DISTANCE, _distance(rows, swept["overall"])),
        *([(WHY, why)] if why else []),
    ]


def _why(rows: Sequence[Row], overall: Sequence[Row]) -> str:
    """Return why who leads is ahead of constant forgetting, where that is what came out."""
    wins = _wins(rows)
    first = _best(wins, overall) if wins else ""
    waits = any(
        r["estimator"] == first and r.get("false_alarms_per_1000_s") is not None for r in rows
    )
    behind = ranking.REFERENCE not in wins and any(
        r["estimator"] == ranking.REFERENCE for r in rows
    )
    return BECAUSE.format(slow=ranking.REFERENCE, quick=first) if waits and behind else ""


def _fastest(rows: Sequence[Row], overall: Sequence[Row]) -> str:
    faults = list(dict.fromkeys((r["scenario"], r["parameter"]) for r in rows))
    wins = _wins(rows)
    if not wins:
        return "Nobody can be ranked: no setting is as noisy as the reference."
    first = _best(wins, overall)
    equal = [first, *(name for name in wins if name != first and wins[name] == wins[first])]
    each = "each " if len(equal) > 1 else ""
    text = (
        f"{_and(equal)}: {each}ahead, or tied for it, in {wins[first]} of {_count(faults, 'fault')}"
        f"{_tied(rows, first)}."
    )
    gain = _gain(rows, first)
    return text + (f" {gain}" if gain else "")


def _tied(rows: Sequence[Row], first: str) -> str:
    """Return with whom one shares how many of the faults in which it leads."""
    mine = {(r["scenario"], r["parameter"]) for r in rows if r["leads"] and r["estimator"] == first}
    shared = _wins([r for r in rows if (r["scenario"], r["parameter"]) in mine])
    ties = [f"{name} in {n} of {len(mine)}" for name, n in shared.items() if name != first]
    return (
        f"; {first} is tied with {_and(ties)} (these seeds cannot tell them apart)" if ties else ""
    )


def _wins(rows: Sequence[Row]) -> dict[str, int]:
    """Return in how many faults each leads, the most first."""
    wins: dict[str, int] = {}
    for row in rows:
        if row["leads"]:
            wins[row["estimator"]] = wins.get(row["estimator"], 0) + 1
    return dict(sorted(wins.items(), key=lambda item: -item[1]))


def _best(wins: Mapping[str, int], overall: Sequence[Row]) -> str:
    """Return who leads most often; of several, who comes first in the ranking."""
    most = max(wins.values())
    able = [name for name, count in wins.items() if count == most]
    ranked = [row["estimator"] for row in overall if row["estimator"] in able]
    return (ranked or able)[0]


def _gain(rows: Sequence[Row], first: str) -> str:
    """Return how much quicker than the reference one is, over the faults where both are matched."""
    lags = {(r["scenario"], r["estimator"]): r["lag"] for r in rows if r["how"] == MATCHED}
    mine = [(lags.get((s, ranking.REFERENCE)), lag) for (s, e), lag in lags.items() if e == first]
    ratios = sorted(reference / lag for reference, lag in mine if reference and lag)
    if first == ranking.REFERENCE or not ratios:
        return ""
    paper = f"that of {ranking.REFERENCE}, the paper's method"
    return f"The lag of {first} is {_between(ratios)} times shorter than {paper}."


def _distance(rows: Sequence[Row], overall: Sequence[Row]) -> str:
    wins = _wins(rows)
    asked = list(dict.fromkeys([*([_best(wins, overall)] if wins else []), ranking.REFERENCE]))
    told = []
    for name in asked:
        over = sorted(r["over_bound"] for r in rows if r["estimator"] == name and r["over_bound"])
        if over:
            told.append(f"{name} takes {_between(over)} times the lag of the bound")
    if not told:
        return "No bound is defined for these faults."
    below = any(r["over_bound"] and r["over_bound"] < 1 for r in rows if r["leads"])
    return "; ".join(told) + "." + (
        " Below 1 is who finds out that only one parameter has changed; the bound takes all for "
        "unknown." if below else ""
    )  # fmt: skip


def _between(values: Sequence[float]) -> str:
    """Return the range of increasing values in words, with two digits.

    Examples
    --------
    >>> _between([1.234, 5.6]), _between([2.0, 2.01])
    ('1.2 to 5.6', '2')
    """
    low, high = (f"{value:.2g}" for value in (values[0], values[-1]))
    return low if low == high else f"{low} to {high}"


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _count(things: Sequence[Any], name: str) -> str:
    return f"{len(things)} {name}{'s'[: len(things) != 1]}"


def not_compared(swept: Mapping[str, Any], estimators: Iterable[str]) -> list[str]:
    """Return a sentence on those that were run, and are in no row at equal noise.

    Parameters
    ----------
    swept : mapping
        What summary.json has as ``tradeoff``.
    estimators : iterable of str
    """
    unable = set(swept["left_out"])
    there = {row["estimator"] for row in swept["matched"]} | unable | set(ranking.CONTROLS)
    blind = [name for name in estimators if name not in there]
    found = [f"Not compared at equal noise, for none of what changes here is estimated by them: "
             f"{', '.join(blind)}."] if blind else []  # fmt: skip
    if unable:
        names = ", ".join(name for name in swept["left_out"])
        found.append(f"Not compared at equal noise, for some of these runs failed: {names}.")
    return found
