"""Results as a labelled cube: each number over scenario, estimator, axes, seed and parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.results.columnar import Index, Table
from flexaxis.experiments.results.groups import ranks
from flexaxis.experiments.running.axes import is_option
from flexaxis.experiments.running.columns import as_text, told
from flexaxis.experiments.running.errors import StudyError

if TYPE_CHECKING:
    from types import ModuleType

    import xarray

    from flexaxis.experiments.results.results import Results

MEANING = {
    "scenario": "scenario before the sweep",
    "estimator": "text that builds the estimator, swept options included",
    "method": "estimator as it stands in the study",
    "point": "number of the point of the design",
    "seed": "seed of the record",
    "parameter": "estimated parameter",
}


@dataclass(frozen=True, eq=False)
class Cube:
    """Where each row lies.

    Attributes
    ----------
    dimensions : mapping of str to ndarray
        Values along each, in order.
    along : mapping of str to (str, ndarray)
        Further coordinates: the dimension on which each lies, and its values there.
    attributes : mapping
        What is said of the whole.
    """

    dimensions: Mapping[str, NDArray[Any]]
    along: Mapping[str, tuple[str, NDArray[Any]]]
    attributes: Mapping[str, Any]
    _table: Table
    _rows: Index
    _places: Index

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each dimension."""
        return tuple(len(values) for values in self.dimensions.values())

    @property
    def rows(self) -> int:
        """Number of rows that lie in it."""
        return len(self._rows)

    @property
    def variables(self) -> dict[str, str]:
        """Names of the variables with their kinds: the columns of numbers, and of truths."""
        return {
            name: kind
            for name, kind in self._table.kinds.items()
            if kind in {"number", "truth"} and name not in self._table.axes
        }

    def values(self, name: str) -> NDArray[np.float64]:
        """Return a variable; what was not run, or is not defined, is NaN."""
        found = np.full(self.shape, np.nan)
        found.reshape(-1)[self._places] = self._table.numbers(name, self._rows)
        return found

    def coordinates(self) -> Iterator[tuple[str, str, NDArray[Any], dict[str, str]]]:
        """Yield each coordinate: its name, its dimension, its values, and what is said of it."""
        for name, values in self.dimensions.items():
            yield name, name, values, {"long_name": MEANING.get(name, name)}
        for name, (dimension, values) in self.along.items():
            yield name, dimension, values, {"long_name": MEANING.get(name, name)}

    def to_xarray(self, xr: ModuleType) -> xarray.Dataset:
        """Return it as a Dataset; `xr` is xarray."""
        names = tuple(self.dimensions)
        coordinates = {n: (d, values, said) for n, d, values, said in self.coordinates()}
        variables = {name: (names, self.values(name), told(name)) for name in self.variables}
        return xr.Dataset(variables, coordinates, dict(self.attributes))


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
        If nothing could be run.
    """
    table, axes = results.table, results.axes
    rows = np.flatnonzero(results.ran())
    if not rows.size:
        raise StudyError(f"{results.folder} holds no rows of a case that could be run")
    options = [a for a in axes if is_option(a, tuple(results.study.get("estimators", ())))]
    inner = [axis for axis in axes if axis not in options]
    if _is_product(results, rows, inner):
        names = {"scenario": "base", "estimator": "estimator"} | {axis: axis for axis in inner}
        told_along, along = [*options, "method"], "estimator"
    else:
        names = {"scenario": "base", "method": "method", "point": "point"}
        told_along, along = list(axes), "point"
    names |= {"seed": "seed", "parameter": "parameter"}
    places, dimensions, firsts = np.zeros(len(rows), np.intp), {}, {}
    for name, column in names.items():
        numbers, first = _numbered(table, axes if column == "point" else [column], rows)
        places = places * len(first) + numbers
        firsts[name] = rows[first]
        dimensions[name] = (
            np.arange(len(first)) if column == "point" else _column(table, column, rows[first])
        )
    coordinates = {column: (along, _column(table, column, firsts[along])) for column in told_along}
    said = {"title": results.study.get("name", results.folder.name), "source": "flexaxis"}
    return Cube(dimensions, coordinates, said, table, rows, places)


def _is_product(results: Results, rows: Index, inner: Sequence[str]) -> bool:
    """Whether the points fill the space of their axes, or will when the study is finished."""
    table = results.table
    sizes = [len(_numbered(table, [column], rows)[1]) for column in ("estimator", *inner)]
    there = len(_numbered(table, ["estimator", *inner], rows)[1])
    found = [len(values) for values in results.values().values()]
    points = results.study.get("points", 1)
    return math.prod(sizes) == there or math.prod(map(max, found, [1] * len(found))) <= points


def _numbered(table: Table, columns: Sequence[str], rows: Index) -> tuple[Index, Index]:
    """Return the number of what each row has in some columns, in order, and a row of each."""
    numbers = np.zeros(len(rows), np.int64)
    for column in columns:
        places, size = ranks(table, column, rows)
        _, numbers = np.unique(numbers * size + places, return_inverse=True)
    _, firsts = np.unique(numbers, return_index=True)
    return numbers, firsts


def _column(table: Table, column: str, rows: Index) -> NDArray[Any]:
    """Return a column in some rows, in any order, as an array: numbers, or texts."""
    order = np.argsort(rows)
    values: list[Any] = [None] * len(rows)
    for place, value in zip(order, table.values(column, rows[order]), strict=True):
        values[place] = value
    kind = table.kinds[column]
    if kind == "text":
        return np.array([as_text(value) or "" for value in values], object)
    if kind == "integer":
        return np.array(values)
    return np.array(values, float)
