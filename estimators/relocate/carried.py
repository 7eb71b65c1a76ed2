"""
Which parameters a filter carries from sample to sample, and what it remembers of them.

How the output depends on a parameter matters only while that is estimated. Between two alarms that
is what is tracked, and what the data of a real axis asked for. So there are some choices of what is
carried, each with a compiled loop of its own, in which all other parameters are numbers, and laws
that do nothing are left out. The narrowest that has what is in use takes the samples. A suspect
needs no past: what has just changed had no influence before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import KINDS
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.records import Record, joined, on_lanes, record
from flexaxis.estimators.relocate.guesses import INERT
from flexaxis.estimators.relocate.held import held, rows_with
from flexaxis.estimators.relocate.suspects import LAW_BOX, Roles
from flexaxis.estimators.relocate.taking import remembering_loop
from flexaxis.estimators.sampling.pattern import split
from flexaxis.estimators.sampling.plan import law_plan

Array = NDArray[np.float64]
Places = NDArray[np.int64]

OF_ALL = ("theta", "P", "claim", "X", "psi")
"""What is remembered of the parameters …"""
OF_SAMPLE = (
    "epsilon", "scale", "expected", "noise", "quiet", "samples", "signal", "armed", "learning",
    "heard", "evidence", "silent", "lags", "correlations", "model", "colour", "unforeseen", "plain",
    "white", "correlation", "power", "count", "y", "valid", "u", "turned",
)  # fmt: skip
"""… and of a sample."""
COMMON = ("bristle", "sinusoid")
"""Laws of which an axis may well have one and no other: dry friction, cogging."""
AXES: Mapping[str, int] = {
    "inflation": 2, "drift": 2, "regularization": 1, "lower": 1, "upper": 1, "floor": 1, "early": 1,
    "theta": 1, "P": 2, "claim": 2, "granted": 1, "psi": 1, "gain": 1, "moved": 1, "spread": 1,
}  # fmt: skip
"""How many axes of a field are the parameters."""


class Choice(NamedTuple):
    """Places of the parameters that are carried, and of the laws that act."""

    places: Places
    laws: tuple[int, ...]


def choices(design: Design, roles: Roles) -> list[Choice]:
    """
    Return what a filter may carry, the narrowest first and everything last.

    That is what is tracked; with laws, what is tracked of a linear axis, and of one with dry
    friction or cogging alone.
    """
    everything = np.arange(len(design.theta0))
    laws = design.model.laws
    if laws is None:
        few = Choice(np.arange(roles.tracked), ())
        return [few, Choice(everything, ())] if roles.tracked < len(everything) else [few]
    every = tuple(range(len(laws.kind)))
    maybe = [i for i in every if _inert(design, i) is not None]
    found = []
    common = [i for i in maybe if KINDS[laws.kind[i]] in COMMON]
    for absent in (maybe, *([j for j in maybe if j != i] for i in common)):
        kept = tuple(i for i in every if i not in absent)
        gone = {int(j) for i in absent for j in laws.parameter[i]}
        mine = {int(j) for i in kept for j in laws.parameter[i] if j >= 0}
        places = [j for j in everything if (j < roles.tracked or j in mine) and j not in gone]
        found.append(Choice(np.array(places), kept))
    return [*found, Choice(everything, every)] if maybe else [Choice(everything, every)]


def _inert(design: Design, law: int) -> Places | None:
    """Return the parameters of a law that are zero where it does nothing; None if it always acts."""
    laws, names = design.model.laws, design.model.names
    assert laws is not None  # its caller has one
    roles = 2 if KINDS[laws.kind[law]] in {"bristle", "static", "sinusoid", "spring"} else 0
    places = laws.parameter[law, :roles]
    named = all(j >= 0 and names[j] in INERT for j in places)
    return places if roles and named else None


class Column(NamedTuple):
    """Which numbers of eight bytes in a row a field is, their kind, and the shape of the field."""

    words: slice
    kind: np.dtype
    shape: tuple[int, ...]


class Carried:
    """
    One choice, with the records of its filter.

    Parameters
    ----------
    choice : Choice
    design : Design
        Of all parameters.
    tuning, state : (1,) records
        All that the loop needs besides `flexaxis.estimators.recursion.records.on_lanes`, of all
        parameters.

    Attributes
    ----------
    places : (q,) int array
        Of the parameters that are carried.
    columns : mapping of str to Column
        Where in a row of the ring each field stands.
    parameters, size : int
        Numbers of eight bytes in a row, those of the parameters and all.
    """

    def __init__(self, choice: Choice, design: Design, tuning: Record, state: Record) -> None:
        self.places, self._laws = choice
        self._design, self._rows = design, rows_with(design.model, self._laws)
        self._tuning = _of_places(tuning, self.places)
        self._tuning["phase"] = _phase(tuning["phase"][0], self.places)
        self._state = _of_places(state, self.places)
        laws = range(0 if design.model.laws is None else len(design.model.laws.kind))
        inert = [_inert(design, i) for i in laws if i not in self._laws]
        self._inert = np.concatenate([np.arange(0), *(i for i in inert if i is not None)])
        box = design.lower, design.upper
        # the same parts of a sample whatever is carried, as their error is not negligible
        self._series = law_plan(design.model, *box, design.period) if self._laws else None
        self._made: tuple[bytes, Record, Record] | None = None
        _, begun = self.records(design.theta0)
        kinds = begun.dtype.fields
        assert kinds is not None  # it is a record
        self.columns = {
            name: Column(
                slice(kinds[name][1] // 8, (kinds[name][1] + kinds[name][0].itemsize) // 8),
                kinds[name][0].base,
                kinds[name][0].shape,
            )
            for name in OF_ALL + OF_SAMPLE
        }
        self.size = self.columns[OF_SAMPLE[-1]].words.stop
        self.parameters = self.columns[OF_SAMPLE[0]].words.start
        mine, every = self.places, slice(None)
        self._where = {name: (every, mine) for name in ("theta", "psi")} | {
            "P": (every, mine[:, None], mine),
            "claim": (every, mine[:, None], mine),
            "X": (every, self._rows[:, None], np.r_[0, 1 + mine]),
        }
        self.loop = remembering_loop(split(self._held(design.theta0).model)[0], self.size)

    def has(self, theta: Array, in_use: NDArray[np.bool_]) -> bool:
        """Whether all that is in use is carried, and what is left out does nothing."""
        used = np.flatnonzero(in_use)
        return bool(np.isin(used, self.places).all() and self._does_nothing(theta))

    def _does_nothing(self, theta: Array) -> bool:
        return bool((abs(theta[self._inert]) <= LAW_BOX[0]).all())

    def records(self, theta: Array) -> tuple[Record, Record]:
        """Return tuning and state, with all that is not carried at its value in θ (p,)."""
        others = np.delete(theta, self.places).tobytes()
        if self._made is None or self._made[0] != others:
            design = self._held(theta)
            tuning, state = on_lanes(design, split(design.model)[0], series=self._series)
            made = joined(state, self._state)
            first = [name for name in OF_ALL + OF_SAMPLE if name in (made.dtype.names or ())]
            self._made = others, joined(tuning, self._tuning), _ordered(made, first)
        return self._made[1].copy(), self._made[2].copy()

    def _held(self, theta: Array) -> Design:
        design, mine = self._design, self.places
        model = held(design.model, theta, mine, self._laws)
        return replace(
            design, model=model, theta0=design.theta0[mine], scale=design.scale[mine],
            lower=design.lower[mine], upper=design.upper[mine], x0=design.x0[self._rows[:-1]],
        )  # fmt: skip

    def field(self, name: str, words: Array, places: Places) -> NDArray[Any]:
        """Return one field (N, …) of some rows of the ring (length, K)."""
        column = self.columns[name]
        if not column.shape:
            return words[places, column.words.start].view(column.kind)
        return words[places, column.words].view(column.kind).reshape(-1, *column.shape)

    def unpack(self, words: Array, places: Places, theta: Array, rows: Record) -> None:
        """Write some rows of the ring to rows (N,) of all parameters, the others of which are θ."""
        samples_of(rows)[:] = words[places, self.parameters : self.size]
        rows["theta"] = theta
        for name in OF_ALL:
            self.spread(name, self.field(name, words, places), rows[name])

    def packed(self, values: Mapping[str, Array]) -> Array:
        """Return what is remembered of all parameters, (N, …), as rows of the ring begin."""
        mine, N = self.places, len(values["theta"])
        words = np.zeros((N, self.parameters))
        for name in OF_ALL:
            column = self.columns[name]
            part = values[name][self._where[name]]
            if name == "X":
                lanes = words[:, column.words].reshape(N, *column.shape)
                lanes[:, :, : 1 + len(mine)] = part
                part = lanes
            words[:, column.words] = part.reshape(N, -1)
        return words

    def spread(self, name: str, own: Array, values: Array) -> None:
        """Write a field (N, …) of its own records to one of all parameters, where it carries it."""
        values[self._where[name]] = own[..., : 1 + len(self.places)] if name == "X" else own


def samples_of(rows: Record) -> Array:
    """Return what is remembered of samples, as in rows of the ring; to read, or to write."""
    words = rows.view(float).reshape(len(rows), -1)
    assert rows.dtype.fields is not None  # they are records
    return words[:, : rows.dtype.fields[OF_SAMPLE[-1]][1] // 8 + 1]


def row_of(design: Design, state: Record) -> Record:
    """
    Return a row (1,) of what is remembered, of all parameters, as it is at the start.

    Its fields are in another order than those of any state, as numba would take a state that begins
    with them for one of these.
    """
    p, n = len(design.theta0), design.model.n
    X = np.zeros((n + 1, 1 + p))
    X[:-1, 0] = design.x0
    X[-1, 0] = design.model.blocks(design.theta0)[0, -1, :-1] @ design.x0
    fields = {"X": X, "theta": design.theta0}
    names = (*OF_SAMPLE, *OF_ALL)
    return record(**{name: fields.get(name, state[name][0] if name in (state.dtype.names or ()) else 0.0) for name in names})


def narrowest(carried: Sequence[Carried], theta: Array, in_use: NDArray[np.bool_]) -> Carried:
    """Return the first that has all that is in use."""
    return next((one for one in carried if one.has(theta, in_use)), carried[-1])


def _of_places(values: Record, places: Places) -> Record:
    """Return a record of some parameters."""
    return record(
        **{
            name: values[name][0][np.ix_(*[places] * AXES[name])] if name in AXES else values[name][0]
            for name in values.dtype.names or ()
        }
    )


def _phase(phase: Places, places: Places) -> Places:
    """Return where the parameters of a phase are among those that are carried; −1 if they are not."""
    if (phase >= 0).all() and np.isin(phase, places).all():
        return np.searchsorted(places, phase)
    return np.full(2, -1)


def _ordered(values: Record, first: Sequence[str]) -> Record:
    """Return a record with some of its fields first."""
    names = [*first, *(name for name in values.dtype.names or () if name not in first)]
    made = np.zeros(1, np.dtype([(name, values.dtype[name]) for name in names], align=True))
    for name in names:
        made[name] = values[name]
    return made
