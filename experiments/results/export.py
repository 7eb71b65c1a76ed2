"""Results for others: a flat table as CSV or Parquet, a labelled cube as xarray."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.scoring.score_definition import Kind
from flexaxis.experiments.storage.files import StudyError, needed, new_file
from flexaxis.experiments.storage.schema import COLUMNS, as_text, axis_kind, told

if TYPE_CHECKING:
    import xarray

    from flexaxis.experiments.results.results import Results

_TYPES = {"text": object, "truth": "boolean", "integer": "Int64", "number": float}
MEANING = {
    "scenario": "scenario before the sweep",
    "estimator": "text that builds the estimator, swept options included",
    "method": "estimator as it stands in the study",
    "point": "number of the point of the design",
    "seed": "seed of the record",
    "parameter": "estimated parameter",
}
VARIABLES = {name: kind for name, kind in COLUMNS.items() if kind in {"number", "truth"}}
"""What is in it, with its kind: the columns of numbers, and of truths."""


class Cube(NamedTuple):
    """Where each row lies.

    Attributes
    ----------
    frame : xarray.Dataset
        The coordinates, and what is said of the whole; no variables yet.
    dimensions : tuple of str
        Of each variable.
    values : callable
        Gives a variable; what was not run, or is not defined, is NaN.
    rows : int
        That lie in it.
    """

    frame: xarray.Dataset
    dimensions: tuple[str, ...]
    values: Callable[[str], NDArray[np.float64]]
    rows: int

    def to_xarray(self) -> xarray.Dataset:
        """Return it with all variables."""
        return self.frame.assign(
            {name: (self.dimensions, self.values(name), told(name)) for name in VARIABLES}
        )


def cube_of(results: Results) -> Cube:
    """Return the selected results of what could be run as a cube.

    The dimensions are scenario (before the sweep), estimator, the swept keys of the scenario, seed
    and parameter; swept options of estimators, and the estimator as it stands in the study
    (`method`), are coordinates on `estimator`. Where the points are not a product (design list or
    sobol) there is one dimension `point` instead of estimators with their options and of the axes,
    and the values of all axes are coordinates on it; then `method` is a dimension.

    Raises
    ------
    StudyError
        If nothing could be run, or xarray is not installed.
    """
    ran, axes = results.ran(), results.axes
    if not len(ran):
        raise StudyError(f"{results.folder} holds no rows of a case that could be run")
    options = [a for a in axes if is_option(a, tuple(results.study.get("estimators", ())))]
    inner = [axis for axis in axes if axis not in options]
    codes = {name: ran.codes(name) for name in ("base", "estimator", "method", "seed",
                                                "parameter", *axes)}  # fmt: skip
    places = pd.DataFrame({name: found for name, (found, _) in codes.items()})
    if _is_product(results, places[["estimator", *inner]]):
        names = {"scenario": "base", "estimator": "estimator"} | {axis: axis for axis in inner}
        further, along = [*options, "method"], "estimator"
    else:
        places["point"] = places.groupby(list(axes)).ngroup()
        names = {"scenario": "base", "method": "method", "point": "point"}
        further, along = list(axes), "point"
    names |= {"seed": "seed", "parameter": "parameter"}
    numbers = range(places["point"].max() + 1) if along == "point" else ()
    dimensions = {
        name: np.array(numbers) if column == "point" else _values(column, codes[column][1])
        for name, column in names.items()
    }
    first = places.groupby(along).first()  # a row of each value of the dimension
    coordinates: dict[str, Any] = {name: (name, values) for name, values in dimensions.items()}
    coordinates |= {
        column: (along, _values(column, [codes[column][1][i] for i in first[column]]))
        for column in further
    }
    said = {"title": results.study.get("name", results.folder.name), "source": "flexaxis"}
    frame = needed("xarray").Dataset(coords=coordinates, attrs=said)
    for name in coordinates:
        frame[name].attrs["long_name"] = MEANING.get(name, name)
    shape = [len(values) for values in dimensions.values()]
    at = np.ravel_multi_index([places[column] for column in names.values()], shape)

    def values(name: str) -> NDArray[np.float64]:
        found = np.full(shape, np.nan)
        found.reshape(-1)[at] = ran.numbers(name, slice(None))
        return found

    return Cube(frame, tuple(dimensions), values, len(at))


def _is_product(results: Results, places: pd.DataFrame) -> bool:
    """Whether the points fill the space of their axes, or will when the study is finished."""
    sizes, there = places.nunique(), len(places.drop_duplicates())
    found = [len(values) for values in results.values().values()]
    points = results.study.get("points", 1)
    return math.prod(sizes) == there or math.prod(map(max, found, [1] * len(found))) <= points


def _values(column: str, values: Sequence[Any]) -> NDArray[Any]:
    """Return values of a column or an axis as an array: numbers, or texts."""
    kind = COLUMNS.get(column) or axis_kind(value for value in values if value is not None)
    if kind == "text":
        return np.array([as_text(value) or "" for value in values], object)
    return np.array(values, int if kind == "integer" else float)


def frame(part: Mapping[str, list[Any]], kinds: Mapping[str, Kind]) -> pd.DataFrame:
    """Return columns of Python values as those of pandas."""
    found = {}
    for name, kind in kinds.items():
        values = part.get(name, [])
        texts = [as_text(value) for value in values] if kind == "text" else values
        found[name] = pd.array(texts, dtype=_TYPES[kind])  # type: ignore[call-overload]
    return pd.DataFrame(found)


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
                [as_text(v) for v in some[name]] if kind == "text" else some[name]
                for name, kind in kinds.items()
            ]
            lines.writerows(zip(*columns, strict=True))
            count += len(columns[0])
    return count


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
