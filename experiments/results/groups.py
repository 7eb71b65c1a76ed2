"""Rows that agree in some columns, as one: put in order, and pooled column by column.

The order of the groups is that of their values, and within a group that of seeds and cases: neither
depends on the order in which rows came. A column is read when it is asked for, so that a few of
them are in memory and not the table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.results.columnar import CASE, Index, Table
from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.intervals import rate_interval
from flexaxis.experiments.scoring.theta import physical
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import Scenario

Bins = Mapping[str, Sequence[float]]
Array = NDArray[np.float64]
ScenarioOf = Callable[[int], Scenario | None]

HELD = 8  # columns in memory at a time: as many as a score is pooled from
MANY = 1 << 22  # numbers that groups might have, above which those that are there are counted anew
APART = ("parameter", "changed")  # what is told apart within a case


@dataclass(frozen=True, eq=False)
class Groups:
    """The rows of each group.

    Attributes
    ----------
    keys : list of dict
        What the rows of each group have in common.
    rows : ndarray of int
        Rows of the table, group by group.
    ends : ndarray of int
        Where in them each group ends.
    """

    keys: list[dict[str, Any]]
    rows: Index
    ends: NDArray[np.intp]
    _table: Table = field(repr=False)
    _held: dict[str, Array] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """Return the number of groups."""
        return len(self.keys)

    def first(self, number: int) -> Groups:
        """Return only so many of them."""
        ends = self.ends[:number]
        return Groups(self.keys[:number], self.rows[: ends[-1]] if ends.size else self.rows[:0],
                      ends, self._table)  # fmt: skip

    def span(self, group: int) -> slice:
        """Return where the rows of a group are."""
        return slice(int(self.ends[group - 1]) if group else 0, int(self.ends[group]))

    def columns(self, group: int) -> Mapping[str, Array]:
        """Return the columns of a group, each read when it is asked for."""
        return _Columns(self, self.span(group))

    def column(self, name: str) -> Array:
        """Return a column of numbers over all rows, group by group."""
        if name not in self._held:
            while len(self._held) >= HELD:
                del self._held[next(iter(self._held))]
            found = self._points() if name == "point" else self._table.numbers(name)
            self._held[name] = found[self.rows]
        return self._held[name]

    def _points(self) -> Array:
        """Return a number for each row of the table: points are scenarios with estimators."""
        scenario, estimator = (self._table.raw(column) for column in ("hash", "estimator"))
        return scenario.astype(float) * (int(estimator.max(initial=0)) + 1) + estimator

    def pooled(self, scores: Sequence[str], scenario: ScenarioOf) -> list[dict[str, Any]]:
        """Return a pooled row a group: its key, how many runs and seeds it has, and the scores.

        Parameters
        ----------
        scores : sequence of str
            Which to pool.
        scenario : callable
            Gives the scenario of a row of the table, which the excess error needs.
        """
        spans = [self.span(group) for group in range(len(self))]
        found = [
            key | {"runs": s.stop - s.start, "seeds": len(np.unique(self.column("seed")[s]))}
            for key, s in zip(self.keys, spans, strict=True)
        ]
        for name in dict.fromkeys(("failed", *scores)):  # one at a time: so a column is read once
            each = self._excess(scenario) if name == "excess" else self._each(name)
            found = [row | pooled for row, pooled in zip(found, each, strict=True)]
        found = [row | pooling.cost(self.columns(group)) for group, row in enumerate(found)]
        return [row | _alarms(self.columns(group), row) for group, row in enumerate(found)]

    def _each(self, score: str) -> Iterator[dict[str, Any]]:
        return (pooling.pool_columns(self.columns(i), [score]) for i in range(len(self)))

    def _excess(self, scenario: ScenarioOf) -> list[dict[str, Any]]:
        """Return the excess error of each group, the same for all parameters of its cases.

        It is that of one scenario; where a group has rows of several it is not defined.
        """
        hashes, cases = self._table.raw("hash")[self.rows], self._table.raw(CASE)[self.rows]
        alike: dict[str, list[int]] = {}
        for group, key in enumerate(self.keys):
            rest = {name: value for name, value in key.items() if name not in APART}
            alike.setdefault(repr(rest), []).append(group)
        found: list[dict[str, Any]] = [{"excess": None, "excess_interval": None}] * len(self)
        for groups in alike.values():
            first = self.span(groups[0])
            of = scenario(int(self.rows[first.start]))
            if of is None or np.any(hashes[first] != hashes[first.start]):
                continue
            by_name = {self.keys[g]["parameter"]: g for g in groups}
            # What is estimated besides has no row of a case that failed.
            asked = {name: g for name, g in by_name.items() if name in of.identify} or by_name
            first = self.span(next(iter(asked.values())))
            if all(np.array_equal(cases[self.span(g)], cases[first]) for g in asked.values()):
                shared = pooling.excess({n: self.columns(g) for n, g in asked.items()}, of)
                for group in groups:
                    found[group] = shared
        return found


class _Columns(Mapping[str, Array]):
    """The columns of some rows of groups that follow each other."""

    def __init__(self, groups: Groups, span: slice) -> None:
        self._groups, self._span = groups, span

    def __getitem__(self, name: str) -> Array:
        return self._groups.column(name)[self._span]

    def __iter__(self) -> Iterator[str]:
        return iter(pooling.NUMBERS)

    def __len__(self) -> int:
        return len(pooling.NUMBERS)


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
    table: Table,
    by: Sequence[str],
    *,
    chosen: NDArray[np.bool_],
    bins: Bins | None = None,
    order: Mapping[str, Sequence[Any]] | None = None,
) -> Groups:
    """Return the rows that agree in some columns, group by group.

    Parameters
    ----------
    table : Table
    by : sequence of str
        Columns to tell apart.
    chosen : ndarray (n,) of bool
        Rows to take.
    bins : mapping of str to sequence of float, optional
        Edges between which the values of a column count as one, the middle of the two.
    order : mapping of str to sequence, optional
        Values of a column in the order that groups are to have.
    """
    rows: NDArray[np.int32] = table.order[chosen[table.order]]
    numbers, count = np.zeros(len(rows), np.int64), 1
    for name in by:
        places, size = ranks(
            table, name, rows, edges=(bins or {}).get(name), order=(order or {}).get(name, ())
        )
        numbers, count = numbers * size + places, count * size
        if count > MANY:
            there, numbers = np.unique(numbers, return_inverse=True)
            count = len(there)
    sizes = np.bincount(numbers, minlength=1)
    small = numbers.astype(np.uint16) if count <= 1 << 16 else numbers.astype(np.int32)
    rows = rows[np.argsort(small, kind="stable")]
    ends = np.cumsum(sizes[sizes > 0])
    firsts = rows[np.concatenate([[0], ends[:-1]])] if ends.size else rows[:0]
    values = [_at(table, name, firsts, (bins or {}).get(name)) for name in by]
    keys = [dict(zip(by, each, strict=True)) for each in zip(*values, strict=True)]
    return Groups(keys if by else [{}] * len(ends), rows, ends, table)


def ranks(
    table: Table,
    name: str,
    rows: Index,
    *,
    edges: Sequence[float] | None = None,
    order: Sequence[Any] = (),
) -> tuple[NDArray[np.int64], int]:
    """Return the place of the value of each row among those of a column, and how many there are.

    Numbers and parameters are in their order, other texts in that of the alphabet, unless another
    `order` is given; what is not defined comes first.
    """
    if not table.coded(name):
        there, places = np.unique(table.raw(name)[rows], return_inverse=True)
        return places, max(1, len(there))
    texts = [_middle(value, edges) for value in table.texts(name)]
    values = {repr(value): value for value in texts}
    ordered = sorted(values, key=lambda text: _place(name, values[text], order))
    number = {text: i for i, text in enumerate(ordered, 1)}
    lookup = np.array([*(number[repr(value)] for value in texts), 0])  # the last: not defined
    return lookup[table.raw(name)[rows]], len(ordered) + 1


def _place(name: str, value: Any, order: Sequence[Any]) -> tuple[int, float, str]:
    """Return what sorts the values of a column."""
    if value in order:
        return 0, order.index(value), ""
    if name == "parameter" and physical(value)[0] in PARAMETER_NAMES:
        return 1, PARAMETER_NAMES.index(physical(value)[0]), value
    number = isinstance(value, int | float)
    return 2, value if number else 0.0, str(value)


def _at(table: Table, name: str, rows: Index, edges: Sequence[float] | None) -> list[Any]:
    """Return the values of a column in some rows, in any order."""
    order = np.argsort(rows, kind="stable")
    found: list[Any] = [None] * len(rows)
    for place, value in zip(order, table.values(name, rows[order]), strict=True):
        found[place] = _middle(value, edges)
    return found


def _middle(value: Any, edges: Sequence[float] | None) -> Any:
    """Return the middle of the two edges between which a value lies."""
    if value is None or edges is None:
        return value
    place = min(max(int(np.searchsorted(edges, value, side="right")), 1), len(edges) - 1)
    return float((edges[place - 1] + edges[place]) / 2)
