"""The rows of a folder column by column: a file beside the journal, made of it when first read.

The journal (*.jsonl) survives whatever happens to the process and is slow to read; the columns are
quick to read and can be made again at any time. They hold as long as the journal is the same: its
files, their sizes and times, the columns and the axes. Where the journal is small the columns stay
in memory, and where nothing can be written beside it in a temporary file.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import count, islice
from pathlib import Path
from typing import Any
from uuid import uuid4

import h5py
import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.results.columns import COLUMNS, NEEDED, axis_kind, columns_of
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.files import OutputError, writing
from flexaxis.experiments.running.names import COLUMNS as FILE
from flexaxis.experiments.running.rows import REMEDY, read, row_files
from flexaxis.experiments.scoring.table import Kind
from flexaxis.sim.hdf5_apart import gone_through
from flexaxis.sim.hdf5_inside import only_inside

PART = 1 << 14  # rows that lie together in the file, and are read from it at a time
READ = 1 << 7  # rows of the journal at a time: so few stay in the cache of the processor
SMALL = 1 << 24  # bytes of journal up to which its columns are no file: they are read in a second
SHARE = 0.25  # of the journal's size: room for the columns, which take some 7 % of it
LARGER = 10  # times as large as the journal that the columns can be in memory
CASE = "case"  # 64 bits, and not a text: as many as there are cases

Index = NDArray[np.signedinteger[Any]]
_STORED: Mapping[str, Any] = {
    "text": np.int32, "number": np.float64, "integer": np.int64, "truth": np.int8
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of a folder.

    Attributes
    ----------
    axes : tuple of str
        Swept keys; each is a column too.
    """

    axes: tuple[str, ...]
    _file: h5py.File = field(repr=False)
    _seen: dict[str, list[Any]] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self._file[CASE].shape[0])

    @property
    def kinds(self) -> dict[str, Kind]:
        """The kind of each column, the axes last."""
        axes = {axis: axis_kind(v for v in self.texts(axis) if v is not None) for axis in self.axes}
        return {**COLUMNS, **axes}

    @cached_property
    def order(self) -> NDArray[np.int32]:
        """The rows in the order of seeds, and of one seed in that of the cases."""
        return np.lexsort((self.raw(CASE), self.raw("seed"))).astype(np.int32)

    def raw(self, column: str, rows: Index | None = None) -> NDArray[Any]:
        """Return a column as it is stored: numbers of texts, −1 for what is not defined.

        Parameters
        ----------
        column : str
        rows : ndarray of int, optional
            Which, in increasing order; all by default.
        """
        stored = self._file[_name(column)]
        if rows is None:
            return np.asarray(stored[:])
        if not rows.size:
            return np.empty(0, stored.dtype)
        return np.asarray(stored[rows[0] : rows[-1] + 1])[rows - rows[0]]

    def texts(self, column: str) -> list[Any]:
        """Return the values of a column of texts, or of an axis, by their number."""
        if column not in self._seen:
            self._seen[column] = [json.loads(t) for t in self._file[_name(column, "of ")].asstr()]
        return self._seen[column]

    def numbers(self, column: str, rows: Index | None = None) -> NDArray[np.float64]:
        """Return a column of numbers or truths (n,); NaN where it is not defined."""
        found = self.raw(column, rows)
        if self.coded(column):
            values = np.array([*self.texts(column), None], float)
            return np.asarray(values[found])
        if found.dtype == np.float64:
            return found
        return np.where(found < 0, np.nan, found)

    def values(self, column: str, rows: Index | None = None) -> list[Any]:
        """Return a column as Python values; None where it is not defined."""
        found = self.raw(column, rows)
        if column == CASE:
            return [f"{case:016x}" for case in found.tolist()]
        if self.coded(column):
            texts = [*self.texts(column), None]
            return [texts[i] for i in found.tolist()]
        if found.dtype == np.float64:
            return [None if math.isnan(v) else v for v in found.tolist()]
        if found.dtype == np.int8:
            return [None if v < 0 else v > 0 for v in found.tolist()]
        return [None if v < 0 else v for v in found.tolist()]

    def among(self, column: str, values: Sequence[Any]) -> NDArray[np.bool_]:
        """Return in which rows (n,) a column has one of some values, None among them."""
        if self.coded(column):
            codes = [code for code, value in enumerate(self.texts(column)) if value in values]
            return np.isin(self.raw(column), [*codes, -1] if None in values else codes)
        if column == CASE:
            return np.isin(self.raw(CASE), np.array([int(v, 16) for v in values], np.uint64))
        numbers = self.numbers(column)
        found = np.isin(numbers, [float(v) for v in values if v is not None])
        return found | np.isnan(numbers) if None in values else found

    def coded(self, column: str) -> bool:
        """Whether a column is stored as numbers of texts."""
        return column in self.axes or (COLUMNS[column] == "text" and column != CASE)


def open_table(folder: Path, axes: Sequence[str]) -> Table:
    """Return the columns of the rows in a folder; make them where the journal is newer.

    Parameters
    ----------
    folder : Path
    axes : sequence of str
        Swept keys.

    Raises
    ------
    StudyError
        If something else than rows stands in the journal.
    OutputError
        If the columns cannot be written.
    """
    journal = row_files(folder)
    stats = [(path.name, path.stat()) for path in journal]
    valid = json.dumps([[(n, s.st_size, s.st_mtime_ns) for n, s in stats], list(axes), [*COLUMNS]])
    if sum(s.st_size for _, s in stats) <= SMALL:
        memory = h5py.File(f"{FILE} {uuid4()}", "w", driver="core", backing_store=False)
        return _filled(memory, journal, axes)
    try:
        rows = sum(s.st_size for _, s in stats)
        gone_through(folder / FILE, OSError, most=LARGER * rows)
        there = h5py.File(folder / FILE, "r", locking=False)
        only_inside(there, OSError)
        if there.attrs.get("valid") == valid:
            return Table(tuple(axes), there)
        there.close()
    except OSError:  # none yet, or damaged
        pass
    return _written(folder, journal, axes, valid)


def _written(folder: Path, journal: Sequence[Path], axes: Sequence[str], valid: str) -> Table:
    needed = SHARE * sum(path.stat().st_size for path in journal)
    kept = os.access(folder, os.W_OK) and shutil.disk_usage(folder).free > needed
    if not kept and shutil.disk_usage(tempfile.gettempdir()).free < needed:
        raise OutputError(
            f"{folder}: its rows are read through a file of columns, and there is no room for its "
            f"{needed / 1e6:.0f} MB, neither there nor in {tempfile.gettempdir()}: make room"
        )
    part = (folder if kept else Path(tempfile.gettempdir())) / f"{FILE}.{os.getpid()}.part"
    try:
        with writing(part), h5py.File(part, "w", libver="latest", locking=False) as file:
            _filled(file, journal, axes)
            file.attrs["valid"] = valid
        if kept:
            os.replace(part, folder / FILE)
        return Table(tuple(axes), h5py.File(folder / FILE if kept else part, "r", locking=False))
    finally:
        part.unlink(missing_ok=True)  # what is open stays readable


def _filled(file: h5py.File, journal: Sequence[Path], axes: Sequence[str]) -> Table:
    coded = [*axes, *(name for name, kind in COLUMNS.items() if kind == "text" and name != CASE)]
    types = {name: _STORED[kind] for name, kind in COLUMNS.items()} | {CASE: np.uint64}
    types |= dict.fromkeys(coded, np.int32)
    on_disk = {"compression": "lzf", "shuffle": True} if file.driver != "core" else {}
    for name, stored in types.items():
        file.create_dataset(_name(name), (0,), stored, maxshape=(None,), chunks=(PART,), **on_disk)
    numbers: dict[str, dict[Any, int]] = {name: defaultdict(count().__next__) for name in coded}
    for each in numbers.values():
        each[None] = -1

    def taken(name: str, given: list[Any]) -> NDArray[Any]:
        try:
            return _stored(name, given, types[name], numbers.get(name))
        except (OverflowError, TypeError, ValueError) as error:
            raise _misshapen(journal, f"{name}: {error}") from error

    parts = (
        {name: taken(name, given) for name, given in part.items()} for part in _parts(journal, axes)
    )
    while some := list(islice(parts, PART // READ)):
        for name in types:
            _append(file[_name(name)], np.concatenate([part[name] for part in some]))
    _check_once(journal, np.asarray(file[CASE][:]), np.asarray(file["parameter"][:]))
    for name, each in numbers.items():
        texts = [text for text in each if text is not None]
        if name not in axes:  # as JSON, as those are: no character is lost
            texts = [json.dumps(text) for text in texts]
        file.create_dataset(_name(name, "of "), data=texts, dtype=h5py.string_dtype())
    return Table(tuple(axes), file)


def _check_once(
    journal: Sequence[Path], cases: NDArray[np.uint64], parameters: NDArray[Any]
) -> None:
    """Refuse a case that is there twice, as in files put together by hand: it would count twice."""
    begins = np.diff(cases, prepend=~cases[:1]) != 0
    first = parameters[begins][np.cumsum(begins) - 1]
    begins |= parameters == first  # right after itself, too
    known, times = np.unique(cases[begins], return_counts=True)
    if known.size and times.max() > 1:
        raise StudyError(
            f"{', '.join(map(str, journal))}: the rows of case {known[times.argmax()]:016x} are "
            f"there {times.max()} times. Remove all but one; `flexaxis merge` puts shares together"
        )


def _parts(journal: Sequence[Path], axes: Sequence[str]) -> Iterator[dict[str, list[Any]]]:
    rows = (row for path in journal for row in read(path))
    while part := list(islice(rows, READ)):
        try:
            yield columns_of(part, axes)
        except (AttributeError, TypeError, ValueError) as error:  # a text where a table should be
            raise _misshapen(journal, error) from error


def _misshapen(journal: Sequence[Path], reason: object) -> StudyError:
    names = ", ".join(map(str, journal))
    return StudyError(f"{names}: a row is not as flexaxis writes them: {reason}. {REMEDY}")


def _append(column: h5py.Dataset, values: NDArray[Any]) -> None:
    there = column.shape[0]
    column.resize((there + len(values),))
    column[there:] = values


def _stored(
    name: str, given: list[Any], stored: Any, numbers: Mapping[Any, int] | None
) -> NDArray[Any]:
    """Return a part of a column as it is stored; `numbers` gives the next one to a new text."""
    if name in NEEDED and None in given:
        raise ValueError("is missing")
    if name == "seed" and not all(seed >= 0 for seed in given):
        raise ValueError(f"is {min(given):g}: seeds are 0, 1, 2, …")
    if name == CASE:
        return np.array([int(case, 16) for case in given], stored)
    if numbers is not None:
        if name not in COLUMNS:  # the values of an axis may be anything
            given = [v if v is None else _json(v) for v in given]
        elif not all(value is None or isinstance(value, str) for value in given):
            raise TypeError("is to be a text")
        return np.array([numbers[value] for value in given], stored)
    if stored is np.float64:
        return np.array(given, stored)
    return np.array([-1 if value is None else value for value in given], stored)


def _json(value: Any) -> str:
    return json.dumps(value) if isinstance(value, list | dict) else _short(value)


_short = lru_cache(1 << 10, typed=True)(json.dumps)  # typed: 1 is not true


def _name(column: str, prefix: str = "") -> str:
    return prefix + column.replace("/", "|")  # a slash would be a group
