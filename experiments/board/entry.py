"""An entry as files: what it says of itself, and whether it is as it was written.

It holds no number that its keeper computes himself: its own rows, about whom and what it is, and
its code. Nothing of it is run here.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass

from flexaxis.experiments.comparison.mismatch import NUISANCE, track_of
from flexaxis.experiments.storage.files import dumps, write_json
from flexaxis.experiments.studies.knobs import setting
from flexaxis.experiments.studies.sweep import TURNS
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.storage.reading import json_value, read_text, read_toml, shown

TUNING, REPORTING = range(100), range(1000, 5000)
"""Seeds that estimators may be tuned on, and those that are kept for reporting."""
ENTRY, ROWS, CODE = "entry.json", "rows.jsonl", "code"
MOST_FILES, MOST_BYTES = 200, 32_000_000
"""What an entry may hold: a full one has a few files and some ten million bytes."""

_PATH = re.compile(r"(?:[\w.+-]+/){0,6}[\w.+-]+")
_PLAIN = re.compile(r"[A-Za-z0-9_.+-]{1,60}")
_LICENCE = re.compile(r"[A-Za-z0-9.+() -]{2,60}")
_CONTACT = re.compile(r"[^\s@<>]+@[^\s@<>]+\.[^\s@<>]+|https://[^\s<>\"']{4,}")
_SEEDS = re.compile(r"none|[0-9]{1,9}:[0-9]{1,9}(, ?[0-9]{1,9}:[0-9]{1,9})*")

ASKED: Mapping[str, tuple[re.Pattern[str], str]] = {
    "name": (_PLAIN, "letters of ASCII, digits, . + - _ , such as my-tracker"),
    "version": (_PLAIN, "such as 1.0"),
    "licence": (_LICENCE, "an SPDX name, such as MIT or Apache-2.0, or proprietary"),
    "contact": (_CONTACT, "an address of mail, or one that begins with https://"),
    "description": (re.compile(r"(?s).{10,600}"), "a sentence or two, 10 to 600 characters"),
    "install": (re.compile(r".{2,300}"), "the line that installs what it needs, if anything"),
    "tuned_on": (_SEEDS, "the seeds that were looked at while tuning, such as 0:100, or none"),
}
"""What an entry is asked to say of itself, and how it is written."""
NEEDS_NOTHING = "nothing besides flexaxis"
"""What `install` says where it is empty or left out."""


class EntryError(FlexaxisError):
    """An entry cannot be made, read or trusted; one line for each problem.

    Attributes
    ----------
    problems : tuple of str
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


@dataclass(frozen=True, kw_only=True)
class About:
    """What an entry says of itself, as in `ASKED`; all of it is the entrant's text."""

    name: str
    version: str
    licence: str
    contact: str
    description: str
    install: str
    tuned_on: str

    @property
    def label(self) -> str:
        """Name and version; entries of one name are versions of one estimator."""
        return f"{self.name} {self.version}"


def about_from(file: Path | None, given: Mapping[str, Any], usual: Mapping[str, str]) -> About:
    """Return what a file and options say, the options before the file, else what is usual.

    Raises
    ------
    EntryError
        With a line for everything that is missing or wrong.
    """
    table = read_toml(file, EntryError) if file else {}
    unknown = [f"{file}: {k}: unknown.{did_you_mean(k, ASKED)}" for k in table if k not in ASKED]
    options = {key: value for key, value in given.items() if value is not None}
    return checked(dict(usual) | table | options, also=unknown)


def checked(table: Mapping[str, Any], *, also: list[str] | None = None) -> About:
    """Return a table as what an entry says of itself; errors as from `about_from`."""
    if table.get("install") in (None, ""):
        table = {**table, "install": NEEDS_NOTHING}
    problems = [*(also or ()), *(text for key in ASKED if (text := _problem(key, table.get(key))))]
    if problems:
        raise EntryError(*problems)
    return About(**{field.name: table[field.name].strip() for field in fields(About)})


def _problem(key: str, value: Any) -> str:
    pattern, words = ASKED[key]
    how = f'--{key.replace("_", "-")} or {key} = "…" in the file of --about: {words}'
    if value is None:
        return f"{key}: missing; {how}"
    if not isinstance(value, str) or not pattern.fullmatch(value.strip()):
        return f"{key}: {shown(value)} is not what is asked; {how}"
    if any(ord(c) < 32 and c != "\n" for c in value):
        return f"{key}: has characters that control a terminal; {how}"
    if key == "tuned_on" and _reported(value):
        return (
            f"tuned_on: {value} has seeds from {REPORTING[0]} on, which are kept for reporting: an "
            "entry that was tuned on them is not eligible"
        )
    return ""


def _reported(text: str) -> bool:
    """Whether ranges of seeds meet those that are kept for reporting."""
    ranges = [[int(end) for end in each.split(":")] for each in text.split(",") if ":" in each]
    return any(first < REPORTING.stop and last > REPORTING.start for first, last in ranges)


def _turns(turns: list[float]) -> list[float]:
    if not {*turns} <= {*TURNS} or len({*turns}) != len(turns) or 1.0 not in turns:
        raise ValueError("turns of a knob that `flexaxis submit` tries, each once, 1 among them")
    return turns


_Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


def _about(given: Any) -> About:
    return given if isinstance(given, About) else checked(given)


@pydantic_dataclass(
    frozen=True,
    kw_only=True,
    config=ConfigDict(extra="forbid", strict=True, hide_input_in_errors=True),
)
class BoardEntry:
    """An entry that is as it was written: what stands in entry.json, and where that lies.

    Attributes
    ----------
    folder : Path
    form : 2
        Of the file.
    about : About
    estimator : str
        As for `--estimator`, seen from the folder.
    suite : str
        Hash of the board that it was made on.
    quick : bool
        Whether it was made for trying, with few seeds.
    knob : mapping of str to mapping
        Its options at each turn of the knob; empty without one.
    turns : mapping of str to list of float
        By scenario that was run, the turns.
    left_out : mapping of str to str
        Why a scenario was not run.
    environment : mapping of str to str
    command : str
        The line that made it.
    files : mapping of str to str
        The SHA-256 of each file beside entry.json.
    digest : str
        That of all of it.
    """

    folder: Path
    form: Literal[2] = 2
    about: Annotated[About, BeforeValidator(_about)]
    estimator: str
    suite: str
    quick: bool
    knob: dict[str, dict[_Name, float]]
    turns: dict[str, Annotated[list[float], AfterValidator(_turns)]]
    left_out: dict[str, str]
    environment: dict[str, str]
    command: str
    files: Annotated[dict[str, str], Field(max_length=MOST_FILES)] = Field(default_factory=dict)
    digest: str

    @property
    def label(self) -> str:
        """Name and version."""
        return self.about.label

    @property
    def code(self) -> list[Path]:
        """The files of its code, in order."""
        return sorted(path for path in (self.folder / CODE).rglob("*") if path.is_file())

    def settings(self, scenario: Scenario) -> dict[str, float]:
        """Return the settings that were run on a scenario, with the turns of the knob.

        A turn means the same on all scenarios: what is compared at equal noise is one estimator.
        Where nothing is to be traded off there is one, as entered.
        """
        turns = self.turns.get(scenario.name)
        if turns is None:
            return {}
        if not self.knob or track_of(scenario) == NUISANCE:
            return {self.estimator: 1.0}
        return {setting(self.estimator, self.knob[str(turn)]): turn for turn in turns}

    def rows(self) -> list[dict[str, Any]]:
        """Return its rows; EntryError if a line is no table."""
        text = read_text(self.folder / ROWS, EntryError)
        found = [json_value(line, source=ROWS, refuse=EntryError) for line in text.splitlines()]
        if not all(isinstance(row, dict) for row in found):
            raise EntryError(f"{self.folder}: {ROWS}: has lines that are no rows")
        return found


def seal(folder: Path, content: Mapping[str, Any]) -> None:
    """Write entry.json with the digests of all files beside it, and that of the whole."""
    whole = {"form": 2, **content, "files": {n: _checksum(folder / n) for n in _names(folder)}}
    write_json(folder / ENTRY, whole | {"digest": _digest(whole)})


def read(folder: Path) -> BoardEntry:
    """Return an entry if it is as it was written.

    Raises
    ------
    EntryError
        With a line for each file that is missing, more, or changed, and for what is of the wrong
        form.
    """
    text = read_text(folder / ENTRY, EntryError)
    content = json_value(text, source=str(folder / ENTRY), refuse=EntryError)
    entry = formed(folder, content)
    if problems := list(_of_files(folder, content)):
        raise EntryError(*(f"{folder}: {problem}" for problem in problems))
    return entry


def formed(folder: Path, content: Mapping[str, Any]) -> BoardEntry:
    """Return what stands in entry.json as an entry; EntryError if it is of the wrong form."""
    try:
        entry = BoardEntry(**content, folder=folder)
    except (TypeError, ValidationError) as error:
        found = error.errors()[:10] if isinstance(error, ValidationError) else []
        lines = [f"{shown('.'.join(map(str, e['loc'])))}: {e['msg']}" for e in found]
        problems = [f"{folder / ENTRY}: {line}" for line in lines or ["is no table"]]
        raise EntryError(*problems) from error
    turns = {str(turn) for line in entry.turns.values() for turn in line}
    if entry.knob and turns - entry.knob.keys():
        raise EntryError(f"{folder / ENTRY}: knob: lacks turns that were run")
    return entry


def _of_files(folder: Path, content: Mapping[str, Any]) -> Iterator[str]:
    if _digest(content) != content["digest"]:
        yield f"{ENTRY} is not as it was written (its digest is another one)"
    wanted = content.get("files", {})
    strange = [path for path in wanted if not _PATH.fullmatch(path) or ".." in path.split("/")]
    if strange:
        yield f"{shown(strange[0])} is no name of a file in an entry"
        return
    for path, checksum in wanted.items():
        if problem := _of_file(folder, path, checksum):
            yield f"{path}: {problem}"
    for path in sorted({*_names(folder)} - wanted.keys()):
        yield f"{shown(path)} is in the folder, but not among the files of {ENTRY}"
    size = sum(path.stat().st_size for name in wanted if (path := folder / name).is_file())
    if size > MOST_BYTES:
        yield f"{size} bytes; {MOST_BYTES} are allowed"


def _of_file(folder: Path, name: str, checksum: str) -> str:
    path = folder / name
    if path.is_symlink() or not path.resolve().is_relative_to(folder.resolve()):
        return "is a link, which an entry may not hold"
    if not path.is_file():
        return "is missing"
    if path.stat().st_size > MOST_BYTES or _checksum(path) != checksum:
        return "is not as it was written (its checksum is another one)"
    return ""


def _names(folder: Path) -> list[str]:
    """Return all files in an entry but entry.json: what Python has compiled is code as well."""
    every = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    names = (path.relative_to(folder).as_posix() for path in every)
    return sorted(name for name in names if name != ENTRY)


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digest(content: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in content.items() if key != "digest"}
    return hashlib.sha256(dumps(dict(sorted(rest.items()))).encode()).hexdigest()
