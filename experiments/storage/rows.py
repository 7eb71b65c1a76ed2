"""Rows as text, a JSON object a line: what an entry of a board holds, and folders of 0.1 did."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from flexaxis.experiments.storage.files import StudyError, dumps, new_file
from flexaxis.sim.reading import json_value

_NAME = re.compile(r"(?:scores|rows)(?:-\d+-of-\d+)?\.jsonl")  # called rows once


def row_files(folder: Path) -> list[Path]:
    """Return the files of rows as text in a folder."""
    return sorted(path for path in folder.glob("*.jsonl") if _NAME.fullmatch(path.name))


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of all complete cases of a file; the last may have been cut short by a kill.

    Raises
    ------
    StudyError
        If something else than rows stands in it.
    """
    for _, case in groupby(_lines(path), lambda row: row["case"]):
        rows = list(case)
        if len(rows) % (rows[0].get("rows") or 1) == 0:
            yield from rows


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n"):
                return
            row = json_value(line, source=f"{path}, line {number}", refuse=StudyError)
            if not isinstance(row, dict) or not isinstance(row.get("case"), str):
                raise StudyError(f"{path}, line {number}: this is no row of a study")
            yield row


def write(path: Path, rows: Iterable[dict[str, Any]]) -> int:
    """Write rows to a file, whole or not at all; return how many.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    count = 0
    with new_file(path) as part, part.open("w", encoding="utf-8") as file:
        for row in rows:
            file.write(dumps(row) + "\n")
            count += 1
    return count
