"""What is found of an entry, and what its files alone say of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flexaxis.experiments.board.entry import SUMMARY, Entry, read
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.foreign import foreign
from flexaxis.experiments.board.stored import own
from flexaxis.experiments.board.suite import Board, board
from flexaxis.experiments.board.turns import of_one_knob
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.running.verify import differences
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.reading import json_value, read_text


@dataclass(frozen=True)
class Check:
    """One thing that was looked at: whether it holds, None where it does not apply, and what."""

    name: str
    holds: bool | None
    seen: str


@dataclass
class Verdict:
    """What is found of an entry.

    Attributes
    ----------
    label, digest, contact : str
        Of the entry.
    quick : bool
    checks : list of Check
    isolation : dict of str to bool
        What held in the process of its code; empty where nothing was run.
    token : str
        What seeds were drawn from; empty where nothing was run.
    flexaxis : str
        Version that verified.
    """

    label: str
    digest: str
    contact: str
    quick: bool
    checks: list[Check] = field(default_factory=list)
    isolation: dict[str, bool] = field(default_factory=dict)
    token: str = ""
    flexaxis: str = field(default_factory=lambda: version("flexaxis"))

    @property
    def ran(self) -> bool:
        """Whether its code was run."""
        return bool(self.isolation)

    @property
    def holds(self) -> bool:
        """Whether nothing was found against it."""
        return all(check.holds is not False for check in self.checks)

    def as_json(self) -> dict[str, Any]:
        """Return it as it is stored and printed."""
        return asdict(self) | {"ran": self.ran, "holds": self.holds}


def of_form(folder: Path, frozen: Board | None = None) -> tuple[Entry, Verdict]:
    """Return an entry, and what its files say: nothing of it is run.

    Raises
    ------
    EntryError
        If it is not as it was written.
    """
    frozen = frozen or board()
    entry = read(folder)
    found = Verdict(entry.label, entry.digest, entry.about.contact, entry.quick)
    found.checks.append(Check("as it was written", True, f"digest {entry.digest[:16]}"))
    mine = frozen.quick() if entry.quick else frozen
    same = dict(entry.suite).get("hash") == mine.hash
    words = f"{frozen.name}, {len(mine.seeds)} seeds"
    found.checks.append(Check("on the frozen suite", same, words if same else "another suite"))
    texts = of_one_knob(entry, mine)
    found.checks.append(_first("settings of one estimator", texts, entry.estimator))
    words = "each once, of its seeds and scenarios"
    rows = _first("rows of this suite", foreign(entry, mine), words)
    found.checks.append(rows if same else Check("rows of this suite", None, "not looked at"))
    found.checks.append(_pooled(entry, mine) if same else Check("rows", None, "not looked at"))
    return entry, found


def _first(name: str, problems: Iterator[str], good: str) -> Check:
    """Return a check that fails with the first problem, if there is one."""
    try:
        problem = next(problems, None)
    except (FlexaxisError, LookupError, TypeError, ValueError) as error:
        problem = f"are not what rows are: {error!r}"
    return Check(name, problem is None, problem or good)


def _pooled(entry: Entry, frozen: Board) -> Check:
    """Check that all rows are there, and come to what the summary says."""
    name, missing = "rows give the summary", _missing(entry, frozen)
    if missing:
        return Check(name, False, f"neither run nor left out: {', '.join(missing)}")
    try:
        found = json_value(dumps(asdict(own(entry, frozen))), source="", refuse=EntryError)
        text = read_text(entry.folder / SUMMARY, EntryError)
        told = json_value(text, source=SUMMARY, refuse=EntryError)
    except EntryError as error:
        return Check(name, False, str(error))
    wrong = list(_apart(told, found))
    return Check(name, not wrong, wrong[0] if wrong else f"{found['runs']} runs as set")


def _missing(entry: Entry, frozen: Board) -> list[str]:
    known = {*entry.settings, *entry.left_out}
    return [s.name for s in frozen.scenarios if s.name not in known]


def _apart(told: Any, found: Any) -> Iterator[str]:
    if not isinstance(told, dict):
        yield "the summary is no table"
        return
    for key in ("at_excess", "as_set"):
        one, other = told.get(key), found[key]
        if not isinstance(one, list) or len(one) != len(other):
            yield f"{key} has another number of rows"
            continue
        for a, b in zip(one, other, strict=True):
            yield from differences(_flat(a), _flat(b), exact=False, key=key)


def _flat(row: Any) -> Any:
    """Return a row without its lists, which are told apart number by number elsewhere."""
    keep = ("scenario", "parameter", "how", "lag", "score", "excess", "lost", "over_bound")
    return {key: row.get(key) for key in keep} if isinstance(row, dict) else row
