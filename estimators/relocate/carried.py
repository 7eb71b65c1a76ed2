"""
A filter that carries along some of the parameters, in records and a compiled loop of their own.

How the output depends on a parameter matters only while that is estimated. Between two alarms that
is what is tracked, and what the data of a real axis have asked for; all other parameters are
numbers, and laws that do nothing are left out. A suspect needs no past: what has just changed had
no influence before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.records import Record, aligned, joined, on_lanes, record
from flexaxis.estimators.relocate.choices import Choice
from flexaxis.estimators.relocate.held import held, rows_with
from flexaxis.estimators.relocate.rows import OF_ALL, OF_SAMPLE, words_of
from flexaxis.estimators.relocate.suspects import LAW_BOX
from flexaxis.estimators.relocate.taking import remembering_loop
from flexaxis.estimators.sampling.pattern import split
from flexaxis.estimators.sampling.plan import law_plan

Array = NDArray[np.float64]
Places = NDArray[np.int64]

AXES: Mapping[str, int] = {
    "inflation": 2, "drift": 2, "regularization": 1, "lower": 1, "upper": 1, "floor": 1, "early": 1,
    "P": 2, "claim": 2, "granted": 1, "psi": 1, "gain": 1, "moved": 1, "spread": 1,
}  # fmt: skip
"""How many axes of a field are the parameters."""


class Column(NamedTuple):
    """Which numbers of a row a field is, their kind, and the shape of the field."""

    words: slice
    kind: np.dtype
    shape: tuple[int, ...]


class Carried:
    """
    A filter that carries some of the parameters.

    Parameters
    ----------
    choice : Choice
    design : Design
        Of all parameters.
    tuning, state : (1,) records
        Of all parameters: what the loop needs besides
        `flexaxis.estimators.recursion.records.on_lanes`.

    Attributes
    ----------
    places : (q,) int array
        Of the parameters that are carried.
    samples, size : int
        Numbers in a row of the ring, those of the sample and all.
    loop : callable
        As from `flexaxis.estimators.relocate.taking.remembering_loop`.
    """

    def __init__(self, choice: Choice, design: Design, tuning: Record, state: Record) -> None:
        self.places, self._laws, self._absent = choice
        self._design, self._rows = design, rows_with(design.model, self._laws)
        self._others = np.delete(np.arange(len(design.theta0)), self.places)
        self._tuning = _of_places(tuning, self.places)
        self._tuning["phase"] = _phase(tuning["phase"][0], self.places)
        self._state = _of_places(state, self.places)
        # the same parts of a sample whatever is carried, as their error is not negligible
        box = design.lower, design.upper
        self._series = law_plan(design.model, *box, design.period) if self._laws else None
        self._made: tuple[bytes, Record, Record] | None = None
        self._columns = _columns(self.records(design.theta0)[1])
        self.samples = self._columns[OF_SAMPLE[-1]].words.stop
        self.size = self._columns[OF_ALL[-1]].words.stop
        mine, every = self.places, slice(None)
        square = every, mine[:, None], mine
        lanes = every, self._rows[:, None], np.r_[0, 1 + mine]
        few = {"theta": (every, mine), "psi": (every, mine)}
        self._where = few | {"P": square, "claim": square, "X": lanes}
        self.loop = remembering_loop(split(self._held(design.theta0).model)[0], self.size)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # what it keeps is replaced and never changed, so that copies may share it

    def has(self, theta: Array, in_use: NDArray[np.bool_]) -> bool:
        """Whether all that is in use is carried, and what is left out does nothing."""
        nothing = (abs(theta[self._absent]) <= LAW_BOX[0]).all()
        return bool(nothing and not in_use[self._others].any())

    def same(self, theta: Array, other: Array) -> bool:
        """Whether all that is not carried has the same value in two θ (p,)."""
        return np.array_equal(theta[self._others], other[self._others])

    def records(self, theta: Array) -> tuple[Record, Record]:
        """Return tuning and state, with all that is not carried at its value in θ (p,)."""
        others = theta[self._others].tobytes()
        if self._made is None or self._made[0] != others:
            design = self._held(theta)
            tuning, state = on_lanes(design, split(design.model)[0], series=self._series)
            self._made = others, joined(tuning, self._tuning), _ordered(joined(state, self._state))
        return self._made[1].copy(), self._made[2].copy()

    def _held(self, theta: Array) -> Design:
        design, mine = self._design, self.places
        return replace(
            design,
            model=held(design.model, theta, mine, self._laws),
            theta0=design.theta0[mine],
            scale=design.scale[mine],
            lower=design.lower[mine],
            upper=design.upper[mine],
            x0=design.x0[self._rows[:-1]],
        )

    def field(self, name: str, words: Array) -> NDArray[Any]:
        """Return one field (N, …) of rows of the ring (N, K)."""
        column = self._columns[name]
        own = np.ascontiguousarray(words[:, column.words])
        return own.view(column.kind).reshape(-1, *column.shape)

    def column(self, name: str) -> Column:
        """Return where a field of the sample stands in a row of the ring, whatever is carried."""
        return self._columns[name]

    def unpack(self, words: Array, theta: Array, rows: Record) -> None:
        """Write rows of the ring to rows (N,) of all parameters, the others of which are θ."""
        words_of(rows)[:, : self.samples] = words[:, : self.samples]
        rows["theta"] = theta
        for name in OF_ALL:
            self.spread(name, self.field(name, words), rows[name])

    def packed(self, values: Mapping[str, Array]) -> Array:
        """Return what is remembered of all parameters, (N, …), as rows of the ring end."""
        N = len(values["theta"])
        words = np.zeros((N, self.size))
        for name in OF_ALL:
            column, part = self._columns[name], values[name][self._where[name]]
            lanes = words[:, column.words].reshape(N, *column.shape)
            lanes[..., : part.shape[-1]] = part
            words[:, column.words] = lanes.reshape(N, -1)
        return words[:, self.samples :]

    def spread(self, name: str, own: Array, values: Array) -> None:
        """Write a field (N, …) of its own records to one of all parameters, where it carries it."""
        values[self._where[name]] = own[..., : 1 + len(self.places)] if name == "X" else own


def narrowest(carried: Sequence[Carried], theta: Array, in_use: NDArray[np.bool_]) -> Carried:
    """Return the first that has all that is in use."""
    return next((one for one in carried if one.has(theta, in_use)), carried[-1])


def _of_places(values: Record, places: Places) -> Record:
    """Return a record of some of the parameters."""
    return record(
        **{
            name: values[name][0][np.ix_(*[places] * AXES.get(name, 0))]
            for name in values.dtype.names or ()
        }
    )


def _phase(phase: Places, places: Places) -> Places:
    """Return where the parameters of a phase are among those carried; −1 if they are not."""
    carried = (phase >= 0).all() and np.isin(phase, places).all()
    return np.searchsorted(places, phase) if carried else np.full(2, -1)


def _ordered(state: Record) -> Record:
    """Return a state that begins with what is remembered of it."""
    first = OF_SAMPLE + OF_ALL
    names = (*first, *(name for name in state.dtype.names or () if name not in first))
    made = np.zeros(1, aligned(tuple((name, state.dtype[name]) for name in names)))
    for name in names:
        made[name] = state[name]
    return made


def _columns(state: Record) -> dict[str, Column]:
    fields = state.dtype.fields
    assert fields is not None  # it is a record
    places = {name: fields[name][1] // 8 for name in OF_SAMPLE + OF_ALL}
    kinds = {name: fields[name][0] for name in places}
    return {
        name: Column(
            slice(place, place + kinds[name].itemsize // 8), kinds[name].base, kinds[name].shape
        )
        for name, place in places.items()
    }
