"""Rows that agree in some columns, as one: put in order, and pooled column by column.

The order of the groups is that of their values, and within a group that of seeds and cases: neither
depends on the order in which rows came. A column is read when it is asked for, so that a few of
them are in memory and not the table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.scoring import summary
from flexaxis.experiments.scoring.intervals import rate_interval
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.storage.schema import CASE
from flexaxis.sim.parameters import PARAMETER_UNITS

if TYPE_CHECKING:
    from flexaxis.experiments.results.results import Results

Bins = Mapping[str, Sequence[float]]
Array = NDArray[np.float64]
Index = NDArray[np.intp]

APART = ("parameter", "changed")  # what is told apart within a case


@dataclass(frozen=True, eq=False)
class Groups:
    """The rows of each group.

    Attributes
    ----------
    keys : list of dict
        What the rows of each group have in common.
    rows : list of ndarray of int
        The rows of each, among those of the results.
    """

    keys: list[dict[str, Any]]
    rows: list[Index]
    _results: Results = field(repr=False)

    def __len__(self) -> int:
        """Return the number of groups."""
        return len(self.keys)

    def first(self, number: int) -> Groups:
        """Return only so many of them."""
        return Groups(self.keys[:number], self.rows[:number], self._results)

    def columns(self, group: int) -> Mapping[str, Array]:
        """Return the columns of a group, each read when it is asked for."""
        return _Columns(self._results, self.rows[group])

    def pooled(self, scores: Sequence[str]) -> list[dict[str, Any]]:
        """Return a pooled row a group: its key, how many runs and seeds it has, and the scores.

        Parameters
        ----------
        scores : sequence of str
            Which to pool.
        """
        every = [self.columns(group) for group in range(len(self))]
        found = [
            key | {"runs": len(each["seed"]), "seeds": len(np.unique(each["seed"]))}
            for key, each in zip(self.keys, every, strict=True)
        ]
        for name in dict.fromkeys(("failed", *scores)):  # one at a time: so a column is read once
            parts = (
                self._excess()
                if name == "excess"
                else (summary.pool_columns(each, [name]) for each in every)
            )
            found = [row | part for row, part in zip(found, parts, strict=True)]
        return [
            row | summary.cost(each) | _alarms(each, row)
            for row, each in zip(found, every, strict=True)
        ]

    def _excess(self) -> list[dict[str, Any]]:
        """Return the excess error of each group, the same for all parameters of its cases.

        It is that of one scenario; where a group has rows of several it is not defined.
        """
        hashes, cases = (self._results.column(name) for name in ("hash", CASE))
        alike: dict[str, list[int]] = {}
        for group, key in enumerate(self.keys):
            rest = {name: value for name, value in key.items() if name not in APART}
            alike.setdefault(repr(rest), []).append(group)
        found: list[dict[str, Any]] = [{"excess": None, "excess_interval": None}] * len(self)
        for groups in alike.values():
            first = self.rows[groups[0]]
            of = self._results.scenario(int(first[0]))
            if of is None or np.any(hashes[first] != hashes[first[0]]):
                continue
            by_name = {self.keys[g]["parameter"]: g for g in groups}
            # What is estimated besides has no row of a case that failed.
            asked = {name: g for name, g in by_name.items() if name in of.identify} or by_name
            each = [cases[self.rows[g]] for g in asked.values()]
            if all(np.array_equal(mine, each[0]) for mine in each):
                shared = summary.excess({n: self.columns(g) for n, g in asked.items()}, of)
                for group in groups:
                    found[group] = shared
        return found


class _Columns(Mapping[str, Array]):
    """The columns of some rows, each read when it is asked for."""

    def __init__(self, results: Results, rows: Index) -> None:
        self._results, self._rows = results, rows

    def __getitem__(self, name: str) -> Array:
        if name == "point":  # points are scenarios with estimators
            scenario, estimator = (self._results.at(n, self._rows) for n in ("hash", "estimator"))
            return scenario.astype(float) * (max(self._results.source.texts) + 1) + estimator
        return self._results.numbers(name, self._rows)

    def __iter__(self) -> Iterator[str]:
        return iter(summary.NUMBERS)

    def __len__(self) -> int:
        return len(summary.NUMBERS)


def _alarms(columns: Mapping[str, Array], pooled: Mapping[str, Any]) -> dict[str, Any]:
    """Return how long the axis moved, and how many false alarms an hour without a fault has."""
    hours = float(np.nansum(columns["seconds"]) / 3600)
    found = {"false_alarms_per_hour": None, "false_alarms_per_hour_interval": None, "hours": hours}
    # Rows that were made before it was kept have all of the time.
    calm = float(np.nansum(columns["detection.calm"])) / 3600 or hours
    if not pooled.get("detection") or not calm:
        return found
    counts = np.nan_to_num(columns["detection.false_alarms"])
    within = rate_interval(counts, calm, columns["seed"])
    return found | {
        "false_alarms_per_hour": float(counts.sum()) / calm,
        "false_alarms_per_hour_interval": within,
    }


def grouped(
    results: Results, by: Sequence[str], *, bins: Bins | None = None, cases: bool = False
) -> Groups:
    """Return the rows that agree in some columns, group by group.

    Parameters
    ----------
    results : Results
    by : sequence of str
        Columns to tell apart.
    bins : mapping of str to sequence of float, optional
        Edges between which the values of a column count as one, the middle of the two.
    cases : bool
        Whether to take one row of each case.
    """
    codes = {name: results.codes(name, (bins or {}).get(name)) for name in by}
    table = pd.DataFrame({i: found for i, (found, _) in enumerate(codes.values())})
    table = table.assign(case=results.column(CASE), seed=results.column("seed"))
    if cases:  # whose rows follow each other
        table = table[table["case"] != table["case"].shift(fill_value=0)]
    table = table.sort_values(["seed", "case"], kind="stable")
    parts = [*table.groupby([*range(len(by))])] if by else [((), table)] * bool(len(table))
    keys = [
        {name: codes[name][1][i] for name, i in zip(by, place, strict=True)} for place, _ in parts
    ]
    return Groups(keys, [part.index.to_numpy() for _, part in parts], results)


def place_of(name: str, value: Any, order: Sequence[Any]) -> tuple[int, float, str]:
    """Return what sorts the values of a column, of which some have an `order`."""
    if value is None:
        return -1, 0.0, ""
    if value in order:
        return 0, order.index(value), ""
    if name == "parameter" and physical(value)[0] in PARAMETER_UNITS:
        return 1, [*PARAMETER_UNITS].index(physical(value)[0]), value
    number = isinstance(value, int | float)
    return 2, value if number else 0.0, str(value)


def middle(value: Any, edges: Sequence[float] | None) -> Any:
    """Return the middle of the two edges between which a value lies."""
    if value is None or edges is None:
        return value
    place = min(max(int(np.searchsorted(edges, value, side="right")), 1), len(edges) - 1)
    return float((edges[place - 1] + edges[place]) / 2)
