"""What the report of a run says first: three questions answered, and the one table that ranks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flexaxis.experiments.comparison import ranking
from flexaxis.experiments.comparison.matching import MATCHED

Row = Mapping[str, Any]
Fault = tuple[str, str]  # scenario and parameter
Rows = dict[str, dict[Fault, Row]]

NAMED = 6  # scenarios not compared that are named; of more it is said how many there are

FASTEST = "Who is fastest at equal noise?"
DISTANCE = "How far from the bound?"
WHY = "Why?"
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


def at_equal_noise(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the table that the report leads with, estimator × fault at equal noise, or None."""
    swept = summary.get("tradeoff")
    if not swept:
        return None
    few = ranking.too_few(swept["matched"])
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


def _by_fault(rows: Iterable[Row], few: str) -> dict[tuple[str, str, str], Row]:
    return {(r["scenario"], r["parameter"], r["estimator"]): _unranked(r, few) for r in rows}


def _unranked(row: Row, few: str) -> Row:
    return {**row, "leads": False} if few else row


def _scope(faults: Sequence[str], scenarios: Iterable[str]) -> str:
    """Return in a sentence which scenarios are compared at equal noise, and which are not."""
    others = [name for name in scenarios if name not in faults]
    only = [name for name in faults if name not in set(scenarios)]
    text = f"Compared at equal noise: {_and(faults)}." if faults else ""
    if only:
        text += f" {_and(only)} {'is' if len(only) == 1 else 'are'} run for that alone."
    if others:
        few = len(others) <= NAMED
        text += f" As set only, further down: {_and(others) if few else f'{len(others)} others'}."
    return text


def answers(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the questions that a newcomer has, each with its answer; none without a sweep."""
    swept = summary.get("tradeoff") or {"matched": [], "overall": []}
    rows = [r for r in swept["matched"] if r["lag"]]
    few = ranking.too_few(rows)
    if few or not rows:
        return [(FASTEST, f"{few}.")] if rows else []
    mine: Rows = {}
    for row in rows:
        mine.setdefault(row["estimator"], {})[row["scenario"], row["parameter"]] = row
    led = {who: {f for f, row in own.items() if row["leads"]} for who, own in mine.items()}
    place = {row["estimator"]: i for i, row in enumerate(swept["overall"])}
    order = sorted(
        (who for who in led if led[who]), key=lambda w: (-len(led[w]), place.get(w, len(place)))
    )
    first = order[0] if order else ranking.REFERENCE
    found = [(FASTEST, _fastest(order, led, mine)), (DISTANCE, _distance(first, mine))]
    own = mine.get(first, {}).values()
    waits = any(row.get("false_alarms_per_1000_s") is not None for row in own)
    if waits and led.get(ranking.REFERENCE) == set():
        found.append((WHY, BECAUSE.format(slow=ranking.REFERENCE, quick=first)))
    return found


def _fastest(order: Sequence[str], led: Mapping[str, set[Fault]], mine: Rows) -> str:
    """Return who leads most often, with whom it is tied, and how much it gains."""
    if not order:
        return "Nobody can be ranked: no setting is as noisy as the reference."
    first, count = order[0], len(led[order[0]])
    equal = [who for who in order if len(led[who]) == count]
    faults = len({fault for own in mine.values() for fault in own})
    text = (
        f"{_and(equal)}: {'each ' * (len(equal) > 1)}ahead, or tied for it, in {count} of {faults} "
        f"fault{'s'[: faults != 1]}"
    )
    shared = {who: len(led[who] & led[first]) for who in order[1:]}
    if ties := [f"{who} in {n} of {count}" for who, n in shared.items() if n]:
        text += f"; {first} is tied with {_and(ties)} (these seeds cannot tell them apart)"
    paper = mine.get(ranking.REFERENCE, {})
    ratios = sorted(
        paper[fault]["lag"] / row["lag"]
        for fault, row in mine[first].items()
        if fault in paper and row["how"] == paper[fault]["how"] == MATCHED
    )
    if first == ranking.REFERENCE or not ratios:
        return f"{text}."
    return (
        f"{text}. The lag of {first} is {_between(ratios)} times shorter than that of "
        f"{ranking.REFERENCE}, the paper's method."
    )


def _distance(first: str, mine: Rows) -> str:
    """Return how far from the bound who leads and the reference are."""
    told = []
    for who in dict.fromkeys([first, ranking.REFERENCE]):
        over = sorted(r["over_bound"] for r in mine.get(who, {}).values() if r["over_bound"])
        told += [f"{who} takes {_between(over)} times the lag of the bound"] if over else []
    if not told:
        return "No bound is defined for these faults."
    leading = [row for own in mine.values() for row in own.values() if row["leads"]]
    below = any(row["over_bound"] and row["over_bound"] < 1 for row in leading)
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
