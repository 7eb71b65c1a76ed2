"""Results as files for other programs: a flat table as CSV or Parquet, a labelled cube: NetCDF."""

from __future__ import annotations

import csv
from pathlib import Path

from flexaxis.experiments.results.cube import VARIABLES, cube_of
from flexaxis.experiments.results.results import Results, Rows, frame
from flexaxis.experiments.storage.columns import as_text, nested, told
from flexaxis.experiments.storage.errors import needed
from flexaxis.experiments.storage.files import new_file, writing
from flexaxis.experiments.storage.rows import write
from flexaxis.experiments.storage.schema import STORED
from flexaxis.sim.netcdf import add, new_netcdf


def export_csv(results: Results, target: Path) -> int:
    """Write a CSV file with a header; what is not defined is empty. Return the number of rows.

    Raises
    ------
    OutputError
        If it cannot be written; then nothing is left of it.
    """
    kinds, count = results.kinds, 0
    with new_file(target) as part, part.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(kinds)
        for some in results.parts():
            columns = [
                [_cell(as_text(v)) for v in some[name]] if kind == "text" else some[name]
                for name, kind in kinds.items()
            ]
            lines.writerows(zip(*columns, strict=True))
            count += len(columns[0])
    return count


def _cell(text: str | None) -> str | None:
    """Return a text that is no formula to a spreadsheet; no name of ours begins so."""
    return f"'{text}" if text and text[0] in "=+-@\t\r" else text


def export_jsonl(results: Results, target: Path) -> int:
    """Write strict JSON, a row a line in the form of flexaxis 0.1; return the number of rows.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    return write(target, map(nested, Rows(results, STORED)))


def export_parquet(results: Results, target: Path) -> int:
    """Write a Parquet file, compressed; return the number of rows.

    Raises
    ------
    OutputError
        If it cannot be written.
    StudyError
        If pyarrow is not installed.
    """
    pa, parquet = needed("pyarrow"), needed("pyarrow.parquet")
    kinds, count = results.kinds, 0
    types = {
        "text": pa.string(),
        "number": pa.float64(),
        "integer": pa.int64(),
        "truth": pa.bool_(),
    }
    fields = [
        pa.field(name, types[kind], metadata=told(name) if kind == "number" else None)
        for name, kind in kinds.items()
    ]
    schema = pa.schema(fields)
    with (
        new_file(target) as part,
        parquet.ParquetWriter(part, schema, compression="zstd") as file,
    ):
        for some in results.parts():
            table = pa.Table.from_pandas(frame(some, kinds), schema, preserve_index=False)
            file.write_table(table)
            count += len(table)
    return count


def export_netcdf(results: Results, target: Path) -> int:
    """Write a NetCDF-4 file, the cube of `Results.to_xarray`; return the number of rows in it.

    A variable at a time is in memory. What was not run, or is not defined, is NaN; a truth is 1
    or 0.

    Raises
    ------
    OutputError
        If it cannot be written.
    StudyError
        If there is nothing to write, or xarray is not installed.
    """
    cube = cube_of(results)
    dimensions = [*map(_name, cube.dimensions)]
    beside = " ".join(_name(name) for name in cube.frame.coords if name not in cube.dimensions)
    with writing(target), new_netcdf(target) as file:
        file.attrs.update(cube.frame.attrs)
        for name, values in cube.frame.coords.items():
            add(file, _name(name), [*map(_name, values.dims)], values.values, **values.attrs)
        for name in VARIABLES:
            add(file, _name(name), dimensions, cube.values(name), compress=True)
            file[_name(name)].attrs.update(told(name) | ({"coordinates": beside} if beside else {}))
    return cube.rows


def _name(column: object) -> str:
    return str(column).replace("/", "|")  # a slash would be a group to NetCDF
