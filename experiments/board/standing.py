"""Who is ahead on a board, track by track: at equal excess error, on common seeds, with ties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.board.stored import Own
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.matching import MATCHED, QUIETER
from flexaxis.experiments.scoring.ranking import leaders, overall
from flexaxis.experiments.scoring.tracks import NUISANCE, TRACKS, UNKNOWN, track_of

Row = Mapping[str, Any]
Place = dict[str, Any]

WINDOW = 5.0  # s: the lag of whoever does nothing, for that is the window in which it is taken
MEASURES: Mapping[str, str] = {
    "score": "mean score at equal excess error",
    "lag": "geometric mean lag at equal excess error [s]",
    "excess": "geometric mean excess error, as entered",
}
"""By what the entries of a track are ranked: where a bound is defined, by the score."""


def standings(entries: Mapping[str, Own], board: Board) -> dict[str, dict[str, Any]]:
    """Return the places on every track, the best first.

    Parameters
    ----------
    entries : mapping of str to Own
        By label; all on the seeds of the board.
    board : Board

    Returns
    -------
    dict
        By track ``measure, words, scenarios, places``; of a place ``label, value, interval, how,
        over_bound, faults, of, false_alarms, leads``.
    """
    found: dict[str, dict[str, Any]] = {}
    for track, words in TRACKS.items():
        names = [s.name for s in board.scenarios if track_of(s) == track]
        if not names:
            continue
        if track == NUISANCE:
            measure, places = "excess", _calm(entries, names)
        elif track == UNKNOWN:
            measure, places = "lag", _by_lag(entries, names, len(board.seeds))
        else:
            measure, places = "score", _by_score(entries, names)
        found[track] = {"measure": measure, "words": words, "scenarios": names, "places": places}
    return found


def _rows(entries: Mapping[str, Own], names: Sequence[str]) -> list[dict[str, Any]]:
    """Return the rows at equal excess of some scenarios, by label."""
    return [
        dict(row) | {"estimator": label}
        for label, own in entries.items()
        for row in own.at_excess
        if row["scenario"] in names
    ]


def _by_score(entries: Mapping[str, Own], names: Sequence[str]) -> list[Place]:
    rows = _rows(entries, names)
    places = [
        _place(entry["estimator"], rows)
        | {
            "value": entry["score"],
            "interval": entry["score_interval"],
            "how": entry["how"],
            "of": entry["faults"],
            "leads": entry["leads"],
        }
        for entry in overall(rows)
    ]
    return _with_rest(places, entries)


def _by_lag(entries: Mapping[str, Own], names: Sequence[str], seeds: int) -> list[Place]:
    """Return the places by lag; whoever has none at a fault has that of doing nothing."""
    rows = _rows(entries, names)
    faults = list(dict.fromkeys((row["scenario"], row["parameter"]) for row in rows))
    values, places = {}, []
    for label in dict.fromkeys(row["estimator"] for row in rows):
        mine = {(r["scenario"], r["parameter"]): r for r in rows if r["estimator"] == label}
        each = [mine[f]["values"]["lag"] if f in mine else None for f in faults]
        total = np.mean([v or np.full(seeds, np.log(WINDOW)) for v in each], axis=0)
        how = {row["how"] for row in mine.values()} - {MATCHED}
        within = mean_interval(total)
        values[label] = total.tolist()
        places.append(
            _place(label, rows)
            | {
                "value": float(np.exp(total.mean())),
                "interval": within and [float(np.exp(end)) for end in within],
                "how": MATCHED if not how else how.pop() if len(how) == 1 else "mixed",
                "of": len(faults),
            }
        )
    places.sort(key=lambda place: float(place["value"]))
    able = _able(places)
    ahead = leaders({label: values[label] for label in able})
    return _with_rest([p | {"leads": p["label"] in ahead} for p in places], entries)


def _able(places: Sequence[Place]) -> list[str]:
    """Return who can be ranked: at equal noise, or quieter and quicker than all of these."""
    matched = [place for place in places if place["how"] == MATCHED]
    best = min((place["value"] for place in matched), default=np.inf)
    quieter = [p for p in places if p["how"] == QUIETER and p["value"] < best]
    return [place["label"] for place in [*matched, *quieter]]


def _calm(entries: Mapping[str, Own], names: Sequence[str]) -> list[Place]:
    """Return the places on the nuisance track: by the error, alarms beside it."""
    places: list[Place] = []
    values: dict[str, list[float]] = {}
    for label, own in entries.items():
        mine = {row["scenario"]: row for row in own.as_set if row["scenario"] in names}
        if mine.keys() != {*names}:
            continue  # among the rest
        total = np.mean([row["values"]["excess"] for row in mine.values()], axis=0)
        rates = [row["false_alarms_per_1000_s"] for row in mine.values()]
        within = mean_interval(total)
        values[label] = total.tolist()
        places.append(
            {
                "label": label,
                "value": float(np.exp(total.mean())),
                "interval": within and [float(np.exp(end)) for end in within],
                "how": MATCHED,
                "over_bound": None,
                "faults": len(mine),
                "of": len(names),
                "false_alarms": None if None in rates else float(np.mean(rates)),
            }
        )
    places.sort(key=lambda place: float(place["value"]))
    ahead = leaders(values)
    return _with_rest([p | {"leads": p["label"] in ahead} for p in places], entries)


def _place(label: str, rows: Sequence[Row]) -> Place:
    """Return what is said of an entry on a track besides its rank."""
    mine = [row for row in rows if row["estimator"] == label and row["lag"] is not None]
    over = [row["over_bound"] for row in mine if row["over_bound"]]
    rates = [row["false_alarms_per_1000_s"] for row in mine]
    told = [rate for rate in rates if rate is not None]
    return {
        "label": label,
        "over_bound": float(np.exp(np.mean(np.log(over)))) if over else None,
        "faults": len(mine),
        "false_alarms": float(np.mean(told)) if told else None,
    }


def _with_rest(places: list[Place], entries: Mapping[str, Own]) -> list[Place]:
    """Return the places, and below them those who have none."""
    there = {place["label"] for place in places}
    empty: Place = {
        "value": None, "interval": None, "how": "none", "over_bound": None, "faults": 0,
        "of": max((place["of"] for place in places), default=0), "false_alarms": None,
        "leads": False,
    }  # fmt: skip
    return [*places, *({"label": label} | empty for label in entries if label not in there)]
