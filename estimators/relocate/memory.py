"""
The recent past of a filter, in its compiled loop and as arrays.

Samples are counted from the first that the filter ever took. What is known of a sample is given of
all parameters, whatever the filter carried at the time.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.records import Record, record
from flexaxis.estimators.relocate.carried import AXES, Carried, narrowest
from flexaxis.estimators.relocate.colour import NORMAL
from flexaxis.estimators.relocate.front import Front, Present, taken
from flexaxis.estimators.relocate.replay import Replayed
from flexaxis.estimators.relocate.ring import Ring
from flexaxis.estimators.relocate.rows import OF_ALL, Stretch, heard, roughness, words_of
from flexaxis.estimators.relocate.taking import HANDED_ON, HEARS, hear_again
from flexaxis.estimators.relocate.work import CALL, WORD, Work, samples_of

Array = NDArray[np.float64]
Places = NDArray[np.int64]

MEMORY = 5.12  # s
SEARCHED = 4.0  # s of the past, that a search looks at …
EVALUATIONS = 200  # … for so many evaluations at most


class Memory:
    """
    A filter that remembers, and can be given another past.

    Parameters
    ----------
    carried : sequence of Carried
        What it may carry along, the narrowest first, everything last.
    row : (1,) record
        What is remembered of a sample, as it is at the start.
    tuning, state : (1,) records
        That the loop needs, of all parameters.
    period : float
        Sampling period [s].
    evaluation : int
        Samples that an evaluation of a search takes.
    """

    def __init__(
        self,
        carried: Sequence[Carried],
        row: Record,
        tuning: Record,
        state: Record,
        *,
        period: float,
        evaluation: int = 1,
    ) -> None:
        self._choices, self._row, self._set, self._begin = carried, row, tuning, state
        self._heard, self._carried, self._theta = heard(row), carried[-1], row["theta"][0]
        self._hears = record(**{name: tuning[name][0] for name in HEARS})
        self._kept = [name for name in state.dtype.names or () if name not in AXES]
        self._period = period
        searched = round(SEARCHED / period) + EVALUATIONS * evaluation
        self._length = max(round(MEMORY / period), searched)
        self.reset()
        for one in carried:  # what has to be compiled is compiled now, and not at the first alarm
            values = {name: row[name] for name in OF_ALL}
            self._go_on(one, one.packed(values)[0], row["theta"][0], 0)
            self.run(np.empty(0), np.empty(0), np.empty(0, bool), *np.empty((2, 0, 3)))
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._drift = self._set["drift"][0].copy()
        self._states, self._ring = self._begin, Ring(self._length)
        self._carry({name: self._row[name] for name in OF_ALL}, 0)

    def _carry(self, values: Mapping[str, Array], first: int) -> None:
        """
        Go on from what is known of all parameters, (N, …), the last of which is the present.

        What comes before is what is remembered, from some first sample on.
        """
        carried = self._narrowest(values)
        packed = carried.packed(values)
        self._go_on(carried, packed[-1], values["theta"][-1], first)
        self._remember(packed[:-1], first)

    def _narrowest(self, values: Mapping[str, Array]) -> Carried:
        return narrowest(self._choices, values["theta"][-1], np.diag(values["P"][-1]) != 0)

    def _go_on(self, carried: Carried, packed: Array, last: Array, first: int) -> None:
        theta = last.copy()
        begun = self._states is not self._begin
        if not (begun and carried is self._carried and carried.same(theta, self._theta)):
            self._tuning, state = carried.records(theta)
            for name in self._kept:
                state[name] = self._states[name]
            self._carried, self._states = carried, state
            self.drift = self._drift
        self._theta, rows = theta, slice(carried.samples, carried.size)
        words_of(self._states)[0, rows] = packed
        if "force" in (self._states.dtype.names or ()):
            self._states["force"] = 0.0  # from where Newton's method starts
        self._ring.begin(first, carried, theta)

    def _remember(self, packed: Array, first: int) -> None:
        """Write what was known of all parameters from a sample on."""
        rows = slice(self._carried.samples, self._carried.size)
        self._ring.words[self._places(first)[: len(packed)], rows] = packed

    @property
    def state(self) -> Present:
        """The filter, ready for the next measurement."""
        return Present(self._carried, self._states, self._theta, self._row.dtype)

    @property
    def drift(self) -> Array:
        """Δ, which P gains in a sample, of all parameters."""
        return self._drift

    @drift.setter
    def drift(self, value: Array) -> None:
        mine, self._drift = self._carried.places, value
        self._tuning["drift"][0] = value[np.ix_(mine, mine)]

    @property
    def carried(self) -> Places:
        """Places of the parameters that are carried along now."""
        return self._carried.places

    @property
    def count(self) -> int:
        """Samples taken."""
        return int(self._states["count"][0])

    @property
    def first(self) -> int:
        """First sample that is remembered."""
        return max(self.count - self._length, 0)

    @property
    def ringing(self) -> bool:
        """Whether there is enough evidence for an alarm."""
        return bool(np.any(self._states["evidence"] > self._tuning["threshold"]))

    def roughness(self, samples: int) -> float:
        """Return the variance of the noise by the last residuals, whatever a wrong model adds."""
        first = max(self.count - samples, self.first)
        return roughness(self.read("epsilon", first), samples // 2)

    def unlearn(self, row: np.void) -> None:
        """
        Take for normal what was so at an earlier sample, and neither learn nor listen.

        The angle is again what was measured since, as a change may have turned it.
        """
        state = self._states[0]
        for name in NORMAL:
            state[name] = row[name]
        state["armed"] = state["learning"] = state["turning"] = 0
        places, words = self._places(int(row["count"])), self._ring.words
        angle = self._carried.column("u").words.start + 1
        turned = self._carried.column("turned").words.start
        words[places, angle] -= words[places, turned] - row["turned"]
        words[places, turned] = row["turned"]
        state["angle"] -= state["turned"] - row["turned"]
        state["turned"] = row["turned"]

    def accept(self, recent: float, *, noise: bool) -> None:
        """Take the residual of the last seconds for normal: its variance, and learn its colour."""
        first = self.count - round(recent / self._period)
        squares = self.read("epsilon", first) ** 2 / self.read("scale", first)
        measured = squares[~np.isnan(squares)]
        if noise and len(measured):
            self._states["noise"] = np.mean(measured)
        for name in NORMAL:
            if name != "power":
                self._states[name] = self._begin[name]

    def arm(self) -> None:
        """Listen and learn again, from now on."""
        state = self._states[0]
        state["armed"] = state["learning"] = state["turning"] = 1
        state["evidence"], state["silent"] = 0.0, self.count

    def freeze(self, parameter: int) -> None:
        """Take a parameter as known from now on."""
        values = {name: self.state[name][None] for name in OF_ALL}
        for M in (values["P"], values["claim"]):
            M[0, parameter, :] = M[0, :, parameter] = 0.0
        self._carry(values, self.count)

    def run(
        self, u: Array, y: Array, present: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> int:
        """
        Take samples until an alarm goes off or the count reaches ``stop``; return how many.

        Estimates (N, q) are those of the first q parameters.
        """
        records = self._carried, (self._tuning, self._states), self._theta, self._ring.words
        return taken(*records, (u, y, present, estimates, trace))

    def fork(self) -> Front:
        """Return the filter of now, to go on by itself."""
        own = self._tuning.copy(), self._states.copy()
        return Front(self._carried, *own, self._theta, self._row.dtype)

    @property
    def longest(self) -> float:
        """Operations of the longest piece of a `rewriting`, however small a grain is."""
        return CALL + WORD * self._length * self._heard.itemsize / 2

    def state_at(self, sample: int) -> Array:
        """Return the state (n,) after a sample."""
        return self.stretch(sample, sample + 1).x[0]

    def beginning(self, count: int) -> np.void:
        """Return what would be remembered before the first sample, but for the count."""
        row = self._row.copy()
        row["count"] = count
        return row[0]

    def stretch(self, first: int, end: int | None = None) -> Stretch:
        """Return what is known of each sample from one on, up to another."""
        first, end = max(first, self.first), self.count if end is None else end
        rows = np.zeros(end - first, self._row.dtype)
        for era, start, places in self._ring.parts(first, end):
            part = rows[start - first :][: len(places)]
            era.carried.unpack(self._ring.words[places], era.theta, part)
        rows.flags.writeable = False
        return Stretch(first, rows)

    def read(self, name: str, first: int) -> Array:
        """Return one field of samples from one on; zero where nothing is remembered."""
        column, start = self._carried.column(name), max(self.first - first, 0)
        values = np.zeros((self.count - first, *column.shape), column.kind)
        words = self._ring.words[self._places(first + start), column.words]
        values[start:] = words.view(column.kind).reshape(-1, *column.shape)
        return values

    def signals(self, first: int) -> tuple[Array, Array, NDArray[np.bool_]]:
        """
        Return inputs from a sample on, and y, and whether it was measured, from one sample later.

        Inputs (N, 2) are the torque held after each sample, and the motor angle at it.
        """
        y, valid = self.read("y", first + 1), self.read("valid", first + 1)
        return self.read("u", first), y, valid > 0

    def rewriting(self, row: np.void, replayed: Replayed, *, grain: float = np.inf) -> Work[None]:
        """
        Make the past since a sample, and the present, what another filter makes of the data.

        Parameters
        ----------
        row : record
            What was known at that sample, before the other filter differs.
        replayed : Replayed
            The other filter at each later sample, and one sample ahead.
        grain : float
            Operations of a piece of the work.
        """
        first, values = int(row["count"]), replayed.of_all()
        carried = self._narrowest(values)
        packed = np.empty((len(replayed.theta), carried.size - carried.samples))
        samples = samples_of(grain, cost := WORD * (2 * packed.shape[1] + values["P"][0].size))
        for begin in range(0, len(packed), samples):
            yield CALL + cost * min(samples, len(packed) - begin)
            part = slice(begin, begin + samples)
            packed[part] = carried.packed({name: of[part] for name, of in values.items()})
        yield CALL + WORD * len(packed) * self._heard.itemsize / 2
        rows = self._heard_again(row, replayed)
        yield from self._ring.widening(first, carried, grain=grain)
        yield 8 * CALL  # where others are carried than before
        for name in HANDED_ON:
            self._states[name] = rows[name][-1]
        self._states["turning"] = 1
        self._go_on(carried, packed[-1], values["theta"][-1], first)
        words, samples = words_of(rows), samples_of(grain, WORD * carried.size)
        for begin in range(0, len(words), samples):
            yield CALL + WORD * min(samples, len(words) - begin) * carried.size
            some = slice(begin, begin + samples)
            places = self._places(first)[some]
            self._ring.words[places, : carried.samples] = words[some, : carried.samples]
            self._remember(packed[:-1][some], first + begin)

    def _heard_again(self, row: np.void, replayed: Replayed) -> Record:
        """Return what is known of each sample but for the parameters, with another residual."""
        places, samples = self._places(int(row["count"])), slice(0, self._carried.samples)
        rows, before = np.zeros(len(places), self._heard), np.zeros(1, self._heard)
        words_of(rows)[:, samples] = self._ring.words[places, samples]
        words_of(before)[:, samples] = words_of(np.array([row]))[:, samples]
        hear_again(self._hears, self._states, rows, before, replayed)
        return rows

    def _places(self, first: int) -> Places:
        return self._ring.places(first, self.count)
