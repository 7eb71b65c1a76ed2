"""The rows of a study as one table: CSV, Parquet or NetCDF, a part at a time."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.running.columns import COLUMNS, Kind, as_text, axis_kind
from flexaxis.experiments.running.files import writing
from flexaxis.experiments.running.results import Results, needed

PART = 10_000  # rows in memory at a time
Line = dict[str, Any]


def export_csv(results: Results, target: Path) -> int:
    """Write a CSV file with a header; what is not defined is empty. Return the number of rows.

    Raises
    ------
    OutputError
        If it cannot be written; then nothing is left of it.
    """
    kinds, count = _kinds(results), 0
    with writing(target), _part(target).open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(kinds))
        table.writeheader()
        for lines in _parts(results, kinds):
            table.writerows(lines)
            count += len(lines)
    return _finish(target, count)


def export_parquet(results: Results, target: Path) -> int:
    """Write a Parquet file, compressed; return the number of rows.

    Raises
    ------
    OutputError
        If it cannot be written.
    StudyError
        If pyarrow is not installed.
    """
    pa = needed("pyarrow")
    parquet = needed("pyarrow.parquet")
    kinds, count = _kinds(results), 0
    types = {
        "text": pa.string(),
        "number": pa.float64(),
        "integer": pa.int64(),
        "truth": pa.bool_(),
    }
    schema = pa.schema([(name, types[kind]) for name, kind in kinds.items()])
    with writing(target), parquet.ParquetWriter(_part(target), schema, compression="zstd") as file:
        for lines in _parts(results, kinds):
            file.write_table(pa.Table.from_pylist(lines, schema=schema))
            count += len(lines)
    return _finish(target, count)


def export_netcdf(results: Results, target: Path) -> int:
    """Write a NetCDF-4 file: a variable a column, over the dimension `row`; return their number.

    Numbers that are not defined are NaN, texts are empty, truths are 1, 0 or −1 for not defined.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    import h5netcdf
    import h5py

    kinds, count = _kinds(results), 0
    total = sum(1 for _ in results.rows())
    types = {"text": h5py.string_dtype(), "number": float, "integer": np.int64, "truth": np.int8}
    with writing(target), h5netcdf.File(_part(target), "w") as file:
        file.dimensions = {"row": total}
        for name, kind in kinds.items():
            # A slash would be a group to NetCDF.
            file.create_variable(name.replace("/", "|"), ("row",), types[kind])
        for lines in _parts(results, kinds):
            for name, kind in kinds.items():
                column = np.array([_plain(line[name], kind) for line in lines],
                                  object if kind == "text" else types[kind])  # fmt: skip
                file[name.replace("/", "|")][count : count + len(lines)] = column
            count += len(lines)
    return _finish(target, count)


def _kinds(results: Results) -> Mapping[str, Kind]:
    """Return the kind of each column, the axes among them."""
    return {**COLUMNS, **{axis: axis_kind(seen) for axis, seen in results.values().items()}}


def _parts(results: Results, kinds: Mapping[str, Kind]) -> Iterator[list[Line]]:
    """Yield lists of lines in which every value is of the kind of its column."""
    lines = results.lines()
    while part := list(islice(lines, PART)):
        for line in part:
            for axis in results.axes:
                value = line[axis]
                if kinds[axis] == "text":
                    line[axis] = as_text(value)
                else:
                    line[axis] = None if value is None else float(value)
        yield part


def _plain(value: Any, kind: Kind) -> Any:
    if value is not None:
        return value
    return {"text": "", "number": np.nan, "integer": -1, "truth": -1}[kind]


def _part(target: Path) -> Path:
    return target.with_name(f".{target.name}.part")


def _finish(target: Path, count: int) -> int:
    with writing(target):
        os.replace(_part(target), target)
    return count
