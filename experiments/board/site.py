"""The board as static pages: which entries it takes, who is ahead, a page an entry."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from packaging.version import InvalidVersion, Version

from flexaxis.experiments.board.entry import BoardEntry, EntryError
from flexaxis.experiments.board.ranking import (
    MEASURES,
    Board,
    Own,
    own_of,
    reference_rows,
    standings,
)
from flexaxis.experiments.board.verification import Ask, of_form
from flexaxis.experiments.comparison.matching import NOISIER, QUIETER
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST
from flexaxis.experiments.reporting.page import render
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.storage.files import json_table, make_folder, write_json, write_text

VERIFIED = "verified"
PAGE, DATA, ENTRIES = "index.html", "board.json", "entries"
SIGNS: Mapping[str, Mapping[str, str]] = {"score": AT_LEAST, "lag": AT_MOST, "excess": {}}
FOR_TRYING = "was made with --quick, for trying: `flexaxis board --quick` takes it"
FULL = "is a full entry, and a board with --quick takes those with few seeds"
LARGEST_CODE = 100_000  # characters of a file of code that a page shows


@dataclass(frozen=True)
class Taken:
    """An entry on a board, what its rows come to, and what the board's keeper found of it."""

    entry: BoardEntry
    own: Own
    verdict: Mapping[str, Any] | None = None

    @property
    def state(self) -> str:
        """Whether its code was run again, shut in, by the board's keeper, and what came of it."""
        found = self.verdict
        if found is None or not found.get("ran"):
            return "unverified"
        if found.get("holds") is not True:
            return "rejected"
        if found.get("accepted") is not True:
            return "unverified"
        usual = Ask()
        enough = found.get("sample", 0) >= usual.sample and found.get("hidden", 0) >= usual.hidden
        return VERIFIED if enough else "verified in part"


def collect(
    folders: Sequence[Path],
    board: Board,
    verdicts: Mapping[str, Mapping[str, Any]],
    *,
    quick: bool = False,
    means: Means | None = None,
) -> tuple[list[Taken], dict[str, tuple[str, ...]]]:
    """Return the entries that a board takes, and of the others what is wrong, by folder.

    Parameters
    ----------
    folders : sequence of Path
    board : Board
    verdicts : mapping
        By digest, as from `read_verdicts`.
    quick : bool
        Whether the board is one for trying: it takes entries for trying, and no others.
    means : Means, optional
        With what the reference is run, once for all of them.
    """
    mine = board.quick() if quick else board
    taken: dict[str, Taken] = {}
    left: dict[str, tuple[str, ...]] = {}
    contacts: dict[str, str] = {}
    usual: list[dict[str, Any]] = []
    for folder in folders:
        try:
            entry = _entry(folder, board, verdicts, quick)
            _check_name(entry, contacts, taken)
            usual = usual or reference_rows(mine, means or Means())
            found = Taken(entry, own_of(entry, mine, usual), verdicts.get(entry.digest))
            taken[entry.label] = found
        except EntryError as error:
            left[str(folder)] = error.problems
    return list(taken.values()), left


def _entry(
    folder: Path, board: Board, verdicts: Mapping[str, Mapping[str, Any]], quick: bool
) -> BoardEntry:
    entry, verdict = of_form(folder, board)
    if entry.quick != quick:
        raise EntryError(f"{folder}: {FOR_TRYING if entry.quick else FULL}")
    wrong = [f"{folder}: {c.name}: {c.seen}" for c in verdict.checks if c.holds is False]
    found = verdicts.get(entry.digest) or {}
    if found.get("ran") and found.get("holds") is not True:
        lines = [c for c in found.get("checks", []) if c.get("holds") is False]
        wrong += [f"{folder}: rejected: {c['name']}: {c['seen']}" for c in lines]
    if wrong:
        raise EntryError(*wrong)
    return entry


def _check_name(entry: BoardEntry, contacts: dict[str, str], taken: Mapping[str, Taken]) -> None:
    """Refuse a name that another contact has: a version of his would take the place of it."""
    name, contact = entry.about.name, entry.about.contact
    if (other := contacts.setdefault(name.casefold(), contact)) != contact:
        raise EntryError(
            f"{entry.folder}: the name {name} is that of {other}, and here of {contact}: choose "
            "another, or list the entries of whom it belongs to first"
        )
    if entry.label in taken:
        raise EntryError(f"{entry.folder}: there is an entry {entry.label} already")


def read_verdicts(folder: Path | None) -> dict[str, dict[str, Any]]:
    """Return the verdicts in a folder, by the digest of their entries.

    They are files that `flexaxis verify ENTRY -o FILE` wrote where the board is kept: what lies in
    an entry itself is never taken for one.

    Raises
    ------
    EntryError
        If a file is none.
    """
    found: dict[str, dict[str, Any]] = {}
    for path in sorted(folder.glob("*.json")) if folder else ():
        content = json_table(path, EntryError)
        known = isinstance(content.get("digest"), str) and isinstance(content.get("checks"), list)
        if not known:
            raise EntryError(f"{path}: is no verdict of `flexaxis verify ENTRY -o FILE`")
        found[content["digest"]] = content
    return found


def newest(taken: Sequence[Taken]) -> list[Taken]:
    """Return of every name the newest version."""
    return list({each.entry.about.name: each for each in in_order(taken)}.values())


def in_order(taken: Sequence[Taken]) -> list[Taken]:
    """Return entries by name, and the versions of each in order, as PEP 440 has it."""
    return sorted(taken, key=lambda t: (t.entry.about.name, _version(t.entry.about.version)))


def _version(text: str) -> tuple[bool, Version, str]:
    """Return what versions are ordered by; what is none comes first."""
    try:
        return True, Version(text), text
    except InvalidVersion:
        return False, Version("0"), text


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
    """

    taken: Sequence[Taken]
    left: Mapping[str, Sequence[str]]
    board: Board
    quick: bool
    command: str


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
    return render(
        "board/templates/index.html",
        {
            "shown": shown,
            "seeds": shown.board.typed,
            "tracks": tracks,
            "measures": MEASURES,
            "signs": SIGNS,
            "entries": {t.entry.label: _about(t) for t in last},
            "versions": [_about(t) for t in in_order(shown.taken)],
            "first": _first(tracks, {t.entry.label: t.state for t in last}),
        },
    )


def _first(tracks: Mapping[str, Any], states: Mapping[str, str]) -> dict[str, str]:
    """Return in a sentence who is ahead on each track, and whether anybody has verified it."""
    found = {}
    for track, table in tracks.items():
        ahead = [place for place in table["places"] if place["leads"]]
        names = [f"{label}{f' ({state})' if (state := states[label]) != VERIFIED else ''}"
                 for label in (place["label"] for place in ahead)]  # fmt: skip
        found[track] = names[0] if names else "nobody can be ranked yet"
        if names and ahead[0]["over_bound"]:
            found[track] += f", {ahead[0]['over_bound']:.2g} × bound"
        if names[1:]:
            found[track] += f"; these seeds cannot tell it from {', '.join(names[1:])}"
    return found


def _entry_page(shown: Shown, taken: Taken) -> str:
    entry = taken.entry
    return render(
        "board/templates/entry.html",
        {
            "shown": shown,
            "taken": taken,
            "again": partial(command, shown.board, entry.estimator),
            "at_most": AT_MOST,
            "words": {QUIETER: "quieter at every setting", NOISIER: "noisier at every setting"},
            "code": [_code(path, entry.folder) for path in entry.code],
        },
    )


def command(board: Board, estimator: str, scenario: str, what: str = "run") -> str:
    """Return the line that makes a number again, for whoever chooses to type it."""
    words = ["flexaxis", what, scenario, "--estimator", estimator, "--seeds", board.typed]
    return shlex.join(words)


def _code(path: Path, folder: Path) -> dict[str, str]:
    text = path.read_bytes()[:LARGEST_CODE].decode(errors="replace")
    shown = "".join(c if c.isprintable() or c in "\n\t" else "·" for c in text)
    return {"name": path.relative_to(folder).as_posix(), "text": shown}
