"""Which entries a board takes: those that are as they were written; the others are told."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.stored import Own, own
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.board.verdict import of_form
from flexaxis.experiments.running.sealed import read_sealed

VERIFIED = "verified"


@dataclass(frozen=True)
class Taken:
    """An entry on a board.

    Attributes
    ----------
    entry : Entry
    own : Own
        What its rows come to.
    verdict : mapping or None
        What the board's keeper found, None if nobody has verified it.
    """

    entry: Entry
    own: Own
    verdict: Mapping[str, Any] | None

    @property
    def state(self) -> str:
        """Whether its code was run again by the board's keeper, and what came of it."""
        if self.verdict is None or not self.verdict.get("ran"):
            return "unverified"
        return VERIFIED if self.verdict.get("holds") is True else "rejected"


def collect(
    folders: Sequence[Path],
    board: Board,
    verdicts: Mapping[str, Mapping[str, Any]],
    *,
    quick: bool = False,
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
    """
    taken: dict[str, Taken] = {}
    left: dict[str, tuple[str, ...]] = {}
    contacts: dict[str, str] = {}
    for folder in folders:
        try:
            found = _taken(folder, board, verdicts, quick)
            _check_name(found, contacts)
            if found.entry.label in taken:
                raise EntryError(f"{folder}: there is an entry {found.entry.label} already")
            taken[found.entry.label] = found
        except EntryError as error:
            left[str(folder)] = error.problems
    return list(taken.values()), left


def _check_name(found: Taken, contacts: dict[str, str]) -> None:
    """Refuse a name that another contact has: a version of his would take the place of it.

    Raises
    ------
    EntryError
    """
    name, contact = found.entry.about.name.casefold(), found.entry.about.contact
    if (other := contacts.setdefault(name, contact)) != contact:
        raise EntryError(
            f"{found.entry.folder}: the name {found.entry.about.name} is that of {other}, and here "
            f"of {contact}: choose another, or list the entries of whom it belongs to first"
        )


FOR_TRYING = "was made with --quick, for trying: `flexaxis board --quick` takes it"
NOT_FOR_TRYING = "is a full entry, and a board with --quick takes those with few seeds"


def _taken(
    folder: Path, board: Board, verdicts: Mapping[str, Mapping[str, Any]], quick: bool
) -> Taken:
    entry, verdict = of_form(folder, board)
    if entry.quick != quick:
        raise EntryError(f"{folder}: {FOR_TRYING if entry.quick else NOT_FOR_TRYING}")
    wrong = [f"{folder}: {c.name}: {c.seen}" for c in verdict.checks if c.holds is False]
    if wrong:
        raise EntryError(*wrong)
    found = Taken(entry, own(entry, board.quick() if quick else board), verdicts.get(entry.digest))
    if found.state == "rejected":
        lines = [c for c in (found.verdict or {}).get("checks", []) if c.get("holds") is False]
        raise EntryError(*(f"{folder}: rejected: {c['name']}: {c['seen']}" for c in lines))
    return found


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
        content = read_sealed(path, EntryError)
        if not isinstance(content.get("digest"), str) or not isinstance(
            content.get("checks"), list
        ):
            raise EntryError(f"{path}: is no verdict of `flexaxis verify ENTRY -o FILE`")
        found[content["digest"]] = content
    return found


def newest(taken: Sequence[Taken]) -> list[Taken]:
    """Return of every name the newest version."""
    last: dict[str, Taken] = {}
    for each in in_order(taken):
        last[each.entry.about.name] = each
    return list(last.values())


def in_order(taken: Sequence[Taken]) -> list[Taken]:
    """Return entries by name, and the versions of each in order: 1.9 before 1.10."""
    return sorted(taken, key=lambda t: (t.entry.about.name, _version(t.entry.about.version)))


def _version(text: str) -> tuple[list[int], list[tuple[int, int, str]]]:
    """Return what versions are ordered by, as PEP 440 does: 1.0.dev1, 1.0rc1, 1.0, 1.0.post1."""
    parts = re.findall(r"[0-9]+|[+]|[A-Za-z]+", text.lower().removeprefix("v"))
    release = []
    while parts and parts[0].isdigit():
        release.append(int(parts.pop(0)))
    while release and not release[-1]:
        release.pop()  # 1.0 is 1
    rest = [(3, int(p), "") if p.isdigit() else (_WORDS.get(p, -1), 0, p) for p in parts]
    return release, [*rest, (0, 0, "")]


_WORDS = {"dev": -2, "post": 1, "rev": 1, "r": 1, "+": 2}
"""What comes after a release, or first of all before it; any other word comes before it."""
