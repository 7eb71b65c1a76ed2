"""Which entries a board takes: those that are as they were written; the others are told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from packaging.version import InvalidVersion, Version

from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.ranking import Own, own_of, reference_rows
from flexaxis.experiments.board.suite import Board, EntryError
from flexaxis.experiments.board.verification import Ask, of_form
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.storage.files import json_table

VERIFIED = "verified"


@dataclass(frozen=True)
class Taken:
    """An entry on a board, what its rows come to, and what the board's keeper found of it."""

    entry: Entry
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
) -> Entry:
    entry, verdict = of_form(folder, board)
    if entry.quick != quick:
        for_trying = "was made with --quick, for trying: `flexaxis board --quick` takes it"
        full = "is a full entry, and a board with --quick takes those with few seeds"
        raise EntryError(f"{folder}: {for_trying if entry.quick else full}")
    wrong = [f"{folder}: {c.name}: {c.seen}" for c in verdict.checks if c.holds is False]
    found = verdicts.get(entry.digest) or {}
    if found.get("ran") and found.get("holds") is not True:
        lines = [c for c in found.get("checks", []) if c.get("holds") is False]
        wrong += [f"{folder}: rejected: {c['name']}: {c['seen']}" for c in lines]
    if wrong:
        raise EntryError(*wrong)
    return entry


def _check_name(entry: Entry, contacts: dict[str, str], taken: Mapping[str, Taken]) -> None:
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
