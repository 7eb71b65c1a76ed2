"""Files of rows: appended to, a case at once or not at all; read without trusting the last line.

A line is a JSON object that begins with the identity of its case. All rows of a case follow each
other, and each says how many they are, so that a case that a kill has cut short is recognised.
"""

from __future__ import annotations

import os
import re
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.files import writing
from flexaxis.sim.reading import json_value

START = b'{"case": "'
ID = slice(len(START), len(START) + 16)
REMEDY = "Remove it from the file; with --resume its case is run again"
SYNC_EVERY = 5.0  # s: what a power failure may cost; a kill costs nothing


@dataclass(frozen=True)
class Scan:
    """What is in a file of rows.

    Attributes
    ----------
    cases : ndarray of uint64
        Identities of the complete cases, in the order of the file.
    size : int
        Bytes up to the end of the last complete case.
    """

    cases: NDArray[np.uint64]
    size: int


class Block(NamedTuple):
    """The lines of a complete case, and where in the file they end [bytes]."""

    case: int
    lines: list[bytes]
    end: int


def blocks(path: Path) -> Iterator[Block]:
    """Yield the complete cases.

    Raises
    ------
    StudyError
        If something else than rows stands before the last case.
    """
    block: list[bytes] = []
    end = 0
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n"):
                break  # cut short by a kill, or being written just now
            if not (line.startswith(START) and line.endswith(b"}\n")):
                raise StudyError(f"{path}, line {number}: this is no row of a study. {REMEDY}")
            if block and line[ID] != block[0][ID]:
                yield from _complete(path, block, end)
                block = []
            block.append(line)
            end += len(line)
    if block:
        yield from _complete(path, block, end)


def _complete(path: Path, block: list[bytes], end: int) -> Iterator[Block]:
    """Yield what is complete of lines of one case; more than once where files were put together."""
    count = _COUNT.search(block[0])
    parts = [block] if count and int(count[1]) == len(block) else _parts(block)
    stop = end - sum(map(len, block))
    for part in parts:
        stop += sum(map(len, part))
        count = _COUNT.search(part[0])
        if count and int(count[1]) != len(part):
            continue
        try:
            case = int(part[0][ID], 16)
        except ValueError as error:
            raise _damaged(path, part[0], error) from error
        yield Block(case, part, stop)


def _parts(block: list[bytes]) -> list[list[bytes]]:
    """Return the lines of a case apart where they begin anew, with the same parameter or alone."""
    found: list[list[bytes]] = []
    first = _PARAMETER.search(block[0])
    for line in block:
        again, count = _PARAMETER.search(line), _COUNT.search(line)
        alone = count and int(count[1]) == 1
        if not found or alone or (first and again and again[1] == first[1]):
            found.append([])
        found[-1].append(line)
    return found


def scan(path: Path) -> Scan:
    """Return the complete cases of a file, and where they end."""
    cases, size = array("Q"), 0
    for block in blocks(path):
        cases.append(block.case)
        size = block.end
    return Scan(np.frombuffer(cases, np.uint64) if cases else np.empty(0, np.uint64), size)


def row_files(folder: Path) -> list[Path]:
    """Return the files of rows in a folder."""
    return sorted(path for path in folder.glob("*.jsonl") if _NAME.fullmatch(path.name))


def share_of(path: Path) -> int | None:
    """Return of how many shares a file of rows is one, None if it is of no share."""
    found = _NAME.fullmatch(path.name)
    return int(found[2]) if found and found[2] else None


_COUNT = re.compile(rb'"rows": (\d+)')  # in the first row of a case
_PARAMETER = re.compile(rb'"parameter": ("(?:[^"\\]|\\.)*"|null)')
# Files were called rows before runs and studies had the same.
_NAME = re.compile(r"(?:scores|rows)(?:-(\d+)-of-(\d+))?\.jsonl")


def done(folder: Path) -> NDArray[np.uint64]:
    """Return the complete cases of all files in a folder, sorted: eight bytes each."""
    found = [scan(path).cases for path in row_files(folder)]
    return np.unique(np.concatenate(found)) if found else np.empty(0, np.uint64)


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of all complete cases of a file.

    Raises
    ------
    StudyError
        If something else than rows stands in it.
    """
    for block in blocks(path):
        yield from parsed(path, block)


def parsed(path: Path, block: Block) -> Iterator[dict[str, Any]]:
    """Yield the rows of a case of a file; errors as from `read`."""
    for line in block.lines:
        try:
            row = json_value(line, source="it", refuse=ValueError)
            if not isinstance(row, dict):
                raise ValueError("it is no table")
        except ValueError as error:
            raise _damaged(path, line, error) from error
        yield row


def _damaged(path: Path, line: bytes, error: ValueError) -> StudyError:
    start = line[:60].decode(errors="replace")
    return StudyError(f"{path}: the row that begins with {start!r} is damaged: {error}. {REMEDY}")


class RowFile:
    """Append cases to a file; on opening it, a case that was cut short is removed.

    A context manager. One process at a time: the lock on the folder sees to that.

    Parameters
    ----------
    path : Path
        Made if it is missing.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._synced = time.monotonic()
        with writing(path):
            path.touch()
            size = scan(path).size
            if size < path.stat().st_size:
                os.truncate(path, size)
            self._file = path.open("ab", buffering=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        with self._file, writing(self.path):
            os.fsync(self._file.fileno())

    def append(self, lines: bytes) -> None:
        """Append the rows of complete cases.

        Raises
        ------
        OutputError
            If they do not fit: then none of them is there.
        """
        before = os.fstat(self._file.fileno()).st_size
        left = memoryview(lines)
        with writing(self.path):
            try:
                while left:
                    left = left[self._file.write(left) :]
                if time.monotonic() - self._synced > SYNC_EVERY:
                    os.fsync(self._file.fileno())
                    self._synced = time.monotonic()
            except BaseException:  # Ctrl-C too
                self._file.truncate(before)
                raise
