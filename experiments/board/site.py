"""The board as static pages: one of who is ahead, one an entry; no network, nothing executed."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.board.collection import VERIFIED, Taken, in_order, newest
from flexaxis.experiments.board.ranking import MEASURES, standings
from flexaxis.experiments.board.real_logs import LogScore
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.page import charted, render
from flexaxis.experiments.scoring.matching import NOISIER, QUIETER
from flexaxis.experiments.scoring.ranking import AT_LEAST, AT_MOST
from flexaxis.experiments.storage.files import make_folder, write_json, write_text

PAGE, DATA, ENTRIES = "index.html", "board.json", "entries"
SIGNS: Mapping[str, Mapping[str, str]] = {"score": AT_LEAST, "lag": AT_MOST, "excess": {}}
LARGEST_CODE = 100_000  # characters of a file of code that a page shows


@dataclass(frozen=True)
class Shown:
    """What a board shows.

    Attributes
    ----------
    taken : sequence of Taken
    left : mapping of str to sequence of str
        What is wrong with the entries that were not taken.
    board : Board
    quick : bool
        Whether it is one for trying.
    command : str
    logs : sequence of LogScore
        What the keeper's logs of real axes give.
    """

    taken: Sequence[Taken]
    left: Mapping[str, Sequence[str]]
    board: Board
    quick: bool
    command: str
    logs: Sequence[LogScore] = ()


def write_site(shown: Shown, folder: Path) -> dict[str, Any]:
    """Write all pages and board.json, and return what the latter holds.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    make_folder(folder / ENTRIES)
    last = newest(shown.taken)
    tracks = standings({t.entry.label: t.own for t in last}, shown.board)
    found = {
        "suite": {"name": shown.board.name, "seeds": list(shown.board.seeds)},
        "quick": shown.quick,
        "tracks": tracks,
        "entries": [_about(each) for each in in_order(shown.taken)],
        "logs": [score.as_json() for score in shown.logs],
        "left_out": {name: list(problems) for name, problems in shown.left.items()},
    }
    write_text(folder / PAGE, _index(shown, last, tracks))
    for each in shown.taken:
        write_text(folder / _place(each), _entry_page(shown, each))
    write_json(folder / DATA, found)
    return found


def _about(taken: Taken) -> dict[str, Any]:
    entry = taken.entry
    return {
        "label": entry.label,
        "name": entry.about.name,
        "version": entry.about.version,
        "estimator": entry.estimator,
        "state": taken.state,
        "digest": entry.digest,
        "licence": entry.about.licence,
        "page": _place(taken),
        "lost": taken.own.lost,
        "runs": taken.own.runs,
    }


def _place(taken: Taken) -> str:
    """Return the page of an entry; the digest keeps apart "a-b 1" and "a b-1"."""
    return f"{ENTRIES}/{taken.entry.label.replace(' ', '-')}-{taken.entry.digest[:8]}.html"


def _index(shown: Shown, last: Sequence[Taken], tracks: Mapping[str, Any]) -> str:
    charts = charted(_history(shown))
    return render(
        "board/templates/index.html",
        {
            "shown": shown,
            "seeds": seeds_of(shown.board),
            "tracks": tracks,
            "measures": MEASURES,
            "signs": SIGNS,
            "entries": {t.entry.label: _about(t) for t in last},
            "versions": [_about(t) for t in in_order(shown.taken)],
            "charts": charts,
            "first": _first(tracks, {t.entry.label: t.state for t in last}),
        },
    )


def _first(tracks: Mapping[str, Any], states: Mapping[str, str]) -> dict[str, str]:
    """Return in a sentence who is ahead on each track, and whether anybody has verified it."""

    def named(label: str) -> str:
        return label if states[label] == VERIFIED else f"{label} ({states[label]})"

    found = {}
    for track, table in tracks.items():
        ahead = [place["label"] for place in table["places"] if place["leads"]]
        if not ahead:
            found[track] = "nobody can be ranked yet"
            continue
        first = next(p for p in table["places"] if p["label"] == ahead[0])
        text = named(ahead[0])
        if first["over_bound"]:
            text += f", {first['over_bound']:.2g} × bound"
        if ahead[1:]:
            text += f"; these seeds cannot tell it from {', '.join(map(named, ahead[1:]))}"
        found[track] = text
    return found


def _history(shown: Shown) -> Iterator[Chart]:
    """Yield for each track how the versions of a name went, where any has several."""
    names: dict[str, list[str]] = {}
    for each in in_order(shown.taken):
        names.setdefault(each.entry.about.name, []).append(each.entry.label)
    if all(len(labels) < 2 for labels in names.values()):
        return
    everyone = standings({t.entry.label: t.own for t in shown.taken}, shown.board)
    for track, table in everyone.items():
        places = {place["label"]: place for place in table["places"]}
        lines = [line for name, labels in names.items() if (line := _line(name, labels, places))]
        yield Chart(
            title=f"{track}: versions",
            words="The versions of each name in their order, first to newest, with 95 % intervals: "
            + MEASURES[table["measure"]]
            + ". Who cannot be made as noisy as the reference is drawn at its nearest setting.",
            x="version, in order",
            panels=[Panel(y=table["measure"], lines=lines, y_log=table["measure"] != "score")],
        )  # fmt: skip


def _line(name: str, labels: Sequence[str], places: Mapping[str, Any]) -> Line | None:
    values = [places[label]["value"] for label in labels]
    ends = [places[label]["interval"] or [None, None] for label in labels]
    y, low, high = (
        np.array([np.nan if value is None else value for value in each], float)
        for each in (values, [e[0] for e in ends], [e[1] for e in ends])
    )
    if np.isnan(y).all():
        return None
    return Line(
        who=name, x=np.arange(1.0, len(y) + 1), y=y, kind="both",
        low=np.where(np.isnan(low), y, low), high=np.where(np.isnan(high), y, high),
    )  # fmt: skip


def _entry_page(shown: Shown, taken: Taken) -> str:
    entry = taken.entry
    return render(
        "board/templates/entry.html",
        {
            "shown": shown,
            "taken": taken,
            "entry": entry,
            "about": entry.about,
            "lines": {
                row["scenario"]: command(shown.board, entry.estimator, row["scenario"])
                for row in [*taken.own.at_excess, *taken.own.as_set]
            },
            "equal": {
                row["scenario"]: command(shown.board, entry.estimator, row["scenario"], "tradeoff")
                for row in taken.own.at_excess
            },
            "at_most": AT_MOST,
            "words": {QUIETER: "quieter at every setting", NOISIER: "noisier at every setting"},
            "code": [_code(path, entry.folder) for path in entry.code],
            "inside": bool(entry.code),
        },
    )


def command(board: Board, estimator: str, scenario: str, what: str = "run") -> str:
    """Return the line that makes a number again, for whoever chooses to type it."""
    words = ["flexaxis", what, scenario, "--estimator", estimator, "--seeds", seeds_of(board)]
    return shlex.join(words)


def seeds_of(board: Board) -> str:
    """Return seeds as they are typed."""
    return f"{board.seeds[0]}:{board.seeds[-1] + 1}"


def _code(path: Path, folder: Path) -> dict[str, str]:
    text = path.read_bytes()[:LARGEST_CODE].decode(errors="replace")
    shown = "".join(c if c.isprintable() or c in "\n\t" else "·" for c in text)
    return {"name": path.relative_to(folder).as_posix(), "text": shown}
