"""The code of an entry: copied into it, so that whoever checks it runs what was scored."""

from __future__ import annotations

import shlex
from pathlib import Path

from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.building.neighbours import code_file, imported_neighbours
from flexaxis.experiments.building.specs import piped
from flexaxis.experiments.running.files import make_folder, writing

CODE = "code"
LARGEST = 2_000_000  # bytes of a file of code: many times what anyone writes by hand


def bring(estimator: str, entry: Path) -> str:
    """Copy what an estimator names into an entry, and return its text as seen from there.

    A file comes with what it imports from its folder; of a program, every word of its command that
    is a file below the present folder. What a registered name or an installed module means is
    installed by whoever checks.

    Raises
    ------
    EntryError
        If a file is too large, or lies where it cannot be copied to.
    """
    if program := piped(estimator):
        kind = estimator.partition(":")[0]
        words = [_brought(word, entry) for word in shlex.split(program[1])]
        return f"{kind}:{shlex.join(words)}"
    if not (name := code_file(estimator)):
        return estimator
    file = Path(name).resolve()
    if not file.is_file():
        return estimator  # said where it is to be built
    for each in [file, *imported_neighbours(file)]:
        _copy(each, entry / CODE / _inside(each, file.parent))
    return f"{CODE}/{file.name}{estimator.removeprefix(name)}"


def _inside(file: Path, folder: Path) -> Path:
    try:
        return file.relative_to(folder)
    except ValueError as error:
        raise EntryError(
            f"{file}: lies outside {folder}, and an entry holds one folder of code: put what the "
            "estimator imports beside it, or make it a package that `install` installs"
        ) from error


def _brought(word: str, entry: Path) -> str:
    """Return a word of a command, copied if it is a file here."""
    path = Path(word)
    if path.is_absolute() or ".." in path.parts or not path.is_file():
        return word
    _copy(path, entry / CODE / path)
    return f"{CODE}/{path.as_posix()}"


def _copy(source: Path, target: Path) -> None:
    content = source.read_bytes()
    if len(content) > LARGEST:
        raise EntryError(f"{source}: {len(content)} bytes; an entry takes files up to {LARGEST}")
    make_folder(target.parent)
    with writing(target):
        target.write_bytes(content)
