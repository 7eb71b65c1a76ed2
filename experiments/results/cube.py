"""Results as a labelled cube: each number over scenario, estimator, axes, seed and parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.storage.columns import COLUMNS, as_text, axis_kind, told
from flexaxis.experiments.storage.errors import StudyError

if TYPE_CHECKING:
    from types import ModuleType

    import xarray

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
    _results: Results
    _places: NDArray[np.intp]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each dimension."""
        return tuple(len(values) for values in self.dimensions.values())

    @property
    def rows(self) -> int:
        """Number of rows that lie in it."""
        return len(self._places)

    def values(self, name: str) -> NDArray[np.float64]:
        """Return a variable; what was not run, or is not defined, is NaN."""
        found = np.full(self.shape, np.nan)
        found.reshape(-1)[self._places] = self._results.numbers(name, slice(None))
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
        variables = {name: (names, self.values(name), told(name)) for name in VARIABLES}
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
    coordinates = {
        column: (along, _values(column, [codes[column][1][i] for i in first[column]]))
        for column in further
    }
    at = np.ravel_multi_index(
        [places[column] for column in names.values()], [len(v) for v in dimensions.values()]
    )
    said = {"title": results.study.get("name", results.folder.name), "source": "flexaxis"}
    return Cube(dimensions, coordinates, said, ran, at)


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
