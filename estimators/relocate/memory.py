"""
The recent past of a filter, in its compiled loop and as arrays.

Samples are counted from the first that the filter ever took. What is known of a sample is given of
all parameters, whatever the filter carried at the time.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.records import Record, record
from flexaxis.estimators.relocate.carried import AXES, Carried, narrowest
from flexaxis.estimators.relocate.colour import NORMAL
from flexaxis.estimators.relocate.replay import Replayed
from flexaxis.estimators.relocate.ring import Ring
from flexaxis.estimators.relocate.rows import OF_ALL, Stretch, heard, words_of
from flexaxis.estimators.relocate.taking import HANDED_ON, HEARS, relearn

Array = NDArray[np.float64]
Places = NDArray[np.int64]

MEMORY = 5.12  # s
SEARCHED = 4.0  # s of the past, that a search looks at …
EVALUATIONS = 200  # … for so many samples at most, one evaluation in each


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
    """

    def __init__(
        self,
        carried: Sequence[Carried],
        row: Record,
        tuning: Record,
        state: Record,
        *,
        period: float,
    ) -> None:
        self._choices, self._row, self._set, self._begin = carried, row, tuning, state
        self._heard, self._carried, self._theta = heard(row), carried[-1], row["theta"][0]
        self._hears = record(**{name: tuning[name][0] for name in HEARS})
        self._kept = [name for name in state.dtype.names or () if name not in AXES]
        self._period = period
        self._length = max(round(MEMORY / period), round(SEARCHED / period) + EVALUATIONS)
        self.reset()
        for one in carried:  # what has to be compiled is compiled now, and not at the first alarm
            self._go_on(one, {name: row[name] for name in OF_ALL}, 0)
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
        carried = narrowest(self._choices, values["theta"][-1], np.diag(values["P"][-1]) != 0)
        self._go_on(carried, values, first)

    def _go_on(self, carried: Carried, values: Mapping[str, Array], first: int) -> None:
        packed, theta = carried.packed(values), values["theta"][-1].copy()
        begun = self._states is not self._begin
        if not (begun and carried is self._carried and carried.same(theta, self._theta)):
            self._tuning, state = carried.records(theta)
            for name in self._kept:
                state[name] = self._states[name]
            self._carried, self._states = carried, state
            self.drift = self._drift
        self._theta, rows = theta, slice(carried.samples, carried.size)
        words_of(self._states)[0, rows] = packed[-1]
        if "force" in (self._states.dtype.names or ()):
            self._states["force"] = 0.0  # from where Newton's method starts
        self._ring.begin(first, carried, theta)
        self._ring.words[self._places(first)[: len(packed) - 1], rows] = packed[:-1]

    @property
    def state(self) -> "Present":
        """The filter, ready for the next measurement."""
        return Present(self)

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
        """
        Return the variance of the noise by the last residuals, whatever a wrong model adds.

        Mean of (e[k] − 3e[k−1] + 3e[k−2] − e[k−3])²/20, as in
        `flexaxis.estimators.recursion.level`; zero where nothing is known.
        """
        last = self.read("epsilon", max(self.count - samples, self.first))
        rough = np.convolve(last, [1.0, -3.0, 3.0, -1.0], "valid")
        known = rough[~np.isnan(rough)]
        return float(np.mean(known**2) / 20) if len(known) > samples // 2 else 0.0

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
        values = {name: self._now(name)[None] for name in OF_ALL}
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
        mine, q = self._carried.places, estimates.shape[1]
        every = len(mine) >= q and mine[q - 1] == q - 1
        mine = mine[mine < q]
        found = estimates if every else np.empty((len(u), len(mine)))
        words = words_of(self._states)
        taken = self._carried.loop(
            self._tuning, self._states, u, y, present, found, trace, words, self._ring.words
        )
        if not every:
            estimates[:taken] = self._theta[:q]
            estimates[:taken, mine] = found[:taken]
        return int(taken)

    def beginning(self, count: int) -> np.void:
        """Return what would be remembered before the first sample, but for the count."""
        row = self._row.copy()
        row["count"] = count
        return row[0]

    def stretch(self, first: int) -> Stretch:
        """Return what is known of each sample from one on."""
        first = max(first, self.first)
        rows = np.zeros(self.count - first, self._row.dtype)
        for era, start, places in self._ring.parts(first, self.count):
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

    def rewrite(self, row: np.void, replayed: Replayed) -> None:
        """
        Make the past since a sample, and the present, what another filter makes of the data.

        Parameters
        ----------
        row : record
            What was known at that sample, before the other filter differs.
        replayed : Replayed
            The other filter at each later sample, and one sample ahead.
        """
        first = int(row["count"])
        places, samples = self._places(first), slice(0, self._carried.samples)
        rows, before = np.zeros(len(places), self._heard), np.zeros(1, self._heard)
        words_of(rows)[:, samples] = self._ring.words[places, samples]
        words_of(before)[:, samples] = words_of(np.array([row]))[:, samples]
        last = rows["epsilon"][-1]
        rows["epsilon"], rows["scale"] = replayed.epsilon[:-1], replayed.scale[:-1]
        rows["psi"] = replayed.X[:-1, 1:, -1]
        if self._states["guarded"][0]:  # what has diverged says nothing of how large y is
            rows["expected"] = replayed.X[:-1, 0, -1]
            rows["signal"] = self._states["signal"] = self._states["power"]
        relearn(self._hears, rows, replayed.spread, before)
        # what the other filter left out is left out for good, but for the last sample, of which it
        # is not known yet whether it is an outlier
        rows["valid"][:-1] = ~np.isnan(replayed.epsilon[:-2])
        if np.isnan(replayed.epsilon[-2]):
            rows["epsilon"][-1] = last
        for name in HANDED_ON:
            self._states[name] = rows[name][-1]
        self._states["turning"] = 1
        self._carry(replayed.of_all(), first)
        self._ring.words[places, samples] = words_of(rows)[:, samples]

    def _now(self, name: str) -> Array:
        """Return what there is of every parameter, of all of them."""
        values = self._theta.copy() if name == "theta" else np.zeros(self._row.dtype[name].shape)
        self._carried.spread(name, self._states[name], values[None])
        return values

    def _places(self, first: int) -> Places:
        return self._ring.places(first, self.count)


class Present:
    """
    The filter as it is now; what there is of every parameter, of all of them.

    Parameters
    ----------
    memory : Memory
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def __getitem__(self, name: str) -> Any:
        return self._memory._now(name) if name in OF_ALL else self._memory._states[name][0]

    def __setitem__(self, name: str, value: object) -> None:
        if name in OF_ALL:
            raise KeyError(f"{name} of a filter changes by a rewind alone")
        self._memory._states[name] = value
