"""An entry as files: what is in it, and whether it is as it was written. Nothing of it is run."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexaxis.experiments.board.about import ASKED, About, checked
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.running.files import dumps, write_json
from flexaxis.sim.reading import json_value, read_text, shown

ENTRY, SUMMARY, RUN = "entry.json", "summary.json", "run"
FORM = 1
MOST_FILES, MOST_BYTES = 200, 64_000_000
"""What an entry may hold: a full one has a few files and some ten million bytes."""

_PATH = re.compile(r"(?:[\w.+-]+/){0,6}[\w.+-]+")
_HASH = re.compile(r"[0-9a-f]{64}")
_KINDS: Mapping[str, type | tuple[type, ...]] = {
    "form": int, "about": dict, "estimator": str, "suite": dict, "quick": bool, "left_out": dict,
    "settings": dict, "environment": dict, "command": str, "files": dict, "digest": str,
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """An entry that is as it was written.

    Attributes
    ----------
    folder : Path
    about : About
    estimator : str
        As for `--estimator`, seen from the folder.
    suite : dict
        ``name, hash, scenarios`` (hash by name), ``seeds``.
    quick : bool
        Whether it was made for trying, with few seeds.
    left_out : dict of str to str
        Why a scenario was not run.
    settings : dict
        By scenario, the settings that were run and the turns of the knob.
    environment : dict of str to str
    command : str
        The line that made it.
    digest : str
        SHA-256 of all of it.
    """

    folder: Path
    about: About
    estimator: str
    suite: Mapping[str, Any]
    quick: bool
    left_out: Mapping[str, str]
    settings: Mapping[str, Mapping[str, float]]
    environment: Mapping[str, str]
    command: str
    digest: str

    @property
    def label(self) -> str:
        """Name and version."""
        return self.about.label

    @property
    def run(self) -> Path:
        """The folder of its rows."""
        return self.folder / RUN

    @property
    def code(self) -> list[Path]:
        """The files of its code, in order."""
        return sorted(path for path in (self.folder / "code").rglob("*") if path.is_file())


def is_entry(folder: Path) -> bool:
    """Whether a folder holds an entry, as far as its names tell."""
    return (folder / ENTRY).is_file()


def seal(folder: Path, content: Mapping[str, Any]) -> str:
    """Write entry.json with the digests of all files beside it; return that of the whole."""
    whole = {"form": FORM, **content, "files": _files(folder)}
    whole["digest"] = _digest(whole)
    write_json(folder / ENTRY, whole)
    return str(whole["digest"])


def read(folder: Path) -> Entry:
    """Return an entry if it is as it was written.

    Raises
    ------
    EntryError
        With a line for each file that is missing, more, or changed, and for what is of the wrong
        form.
    """
    text = read_text(folder / ENTRY, EntryError)
    content = json_value(text, source=str(folder / ENTRY), refuse=EntryError)
    problems = list(_of_form(folder, content))
    if not problems:
        problems = list(_of_files(folder, content))
    if problems:
        raise EntryError(*(f"{folder}: {problem}" for problem in problems))
    about = checked({key: content["about"].get(key) for key in ASKED})
    names = ("estimator", "suite", "quick", "left_out", "settings", "environment", "command")
    own = {name: content[name] for name in names}
    return Entry(folder=folder, about=about, digest=content["digest"], **own)


def _of_form(folder: Path, content: Any) -> Iterator[str]:
    if not isinstance(content, dict):
        yield f"{ENTRY} holds no table"
        return
    if content.get("form") != FORM:
        yield f"{ENTRY} has the form {shown(content.get('form'))}; this reads {FORM}"
        return
    for key, kind in _KINDS.items():
        if not isinstance(content.get(key), kind):
            yield f"{ENTRY}: {key}: missing or not of its kind"
    if not (content.keys() <= _KINDS.keys()):
        yield f"{ENTRY}: unknown keys {', '.join(sorted(map(shown, content.keys() - _KINDS)))}"
    try:
        checked({key: content["about"].get(key) for key in ASKED})
    except EntryError as error:
        yield from error.problems
    except (KeyError, AttributeError):
        pass  # said above
    yield from _of_tables(content)


def _of_tables(content: Mapping[str, Any]) -> Iterator[str]:
    suite = content.get("suite")
    if isinstance(suite, dict):
        seeds, hashes = suite.get("seeds"), suite.get("scenarios")
        if not (isinstance(seeds, list) and all(type(s) is int for s in seeds) and seeds):
            yield f"{ENTRY}: suite.seeds: a list of numbers is needed"
        if not (isinstance(hashes, dict) and all(isinstance(h, str) for h in hashes.values())):
            yield f"{ENTRY}: suite.scenarios: a table of hashes is needed"
    for key in ("left_out", "environment"):
        table = content.get(key)
        if isinstance(table, dict) and not all(isinstance(v, str) for v in table.values()):
            yield f"{ENTRY}: {key}: a table of texts is needed"
    for name, line in (content.get("settings") or {}).items():
        turns = line.values() if isinstance(line, dict) else [None]
        if not all(isinstance(x, int | float) and 0 < x < 1e6 for x in turns):
            yield f"{ENTRY}: settings.{shown(name)}: turns of a knob are numbers above 0"


def _of_files(folder: Path, content: Mapping[str, Any]) -> Iterator[str]:
    if _digest(content) != content["digest"]:
        yield f"{ENTRY} is not as it was written (its digest is another one)"
    wanted = content["files"]
    if len(wanted) > MOST_FILES:
        yield f"{len(wanted)} files; {MOST_FILES} are allowed"
        return
    problems, size = [], 0
    for path, about in wanted.items():
        if not (_PATH.fullmatch(path) and ".." not in path.split("/")):
            problems.append(f"{shown(path)} is no name of a file in an entry")
        elif problem := _of_file(folder, path, about):
            problems.append(f"{path}: {problem}")
        else:
            size += about["bytes"]
    yield from problems
    if size > MOST_BYTES:
        yield f"{size} bytes; {MOST_BYTES} are allowed"
    for path in sorted(set(_names(folder)) - wanted.keys()):
        yield f"{shown(path)} is in the folder, but not among the files of {ENTRY}"


def _of_file(folder: Path, name: str, about: Any) -> str:
    path = folder / name
    if not (isinstance(about, dict) and type(about.get("bytes")) is int):
        return "size and checksum are missing"
    if path.is_symlink() or not path.resolve().is_relative_to(folder.resolve()):
        return "is a link, which an entry may not hold"
    if not path.is_file():
        return "is missing"
    if path.stat().st_size != about["bytes"] or about["bytes"] > MOST_BYTES:
        return f"has {path.stat().st_size} bytes, {about['bytes']} were written"
    if not _HASH.fullmatch(str(about.get("sha256"))) or _checksum(path) != about["sha256"]:
        return "is not as it was written (its checksum is another one)"
    return ""


def _files(folder: Path) -> dict[str, dict[str, Any]]:
    found = {}
    for name in _names(folder):
        path = folder / name
        found[name] = {"sha256": _checksum(path), "bytes": path.stat().st_size}
    return found


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
