"""
The recent past of a filter, in its compiled loop and as arrays.

The ring keeps the whole record of the filter after each measurement, so that to go back to a sample
is to copy its row. Samples are counted from the first that the filter ever took; only this module
knows that the ring closes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.measurement import (
    correct_state,
    learn,
    measure,
    predict,
    publish,
)
from flexaxis.estimators.recursion.records import Record, joined, record
from flexaxis.estimators.relocate.colour import NORMAL, listen, listening, resting
from flexaxis.estimators.relocate.follow import integrate
from flexaxis.estimators.relocate.replay import Replayed
from flexaxis.estimators.sampling.compiler import Compiled, compiled, inlined, remembered
from flexaxis.estimators.sampling.pattern import Pattern

Array = NDArray[np.float64]

MEMORY = 5.12  # s
SEARCHED = 4.0  # s of the past, that a search looks at …
EVALUATIONS = 200  # … for so many samples at most, one evaluation in each
REPLAYED = ("theta", "P", "claim", "epsilon", "scale")  # fields of a row that a replay gives


@dataclass(frozen=True)
class Stretch:
    """
    A copy of what was known after each of N samples in a row; nothing changes it any more.

    Attributes
    ----------
    first : int
        The first sample, counted from the start of the filter.
    rows : (N,) array of records
        The filter after the measurement of each.
    """

    first: int
    rows: Record

    def at(self, sample: int) -> np.void:
        """Return the filter after a sample."""
        return self.rows[sample - self.first]

    @property
    def theta(self) -> Array:
        """All parameters, (N, p)."""
        return np.ascontiguousarray(self.rows["theta"])

    @property
    def x(self) -> Array:
        """State, (N, n)."""
        return np.ascontiguousarray(self.rows["X"][:, :-1, 0])


class Memory:
    """
    A filter that remembers, and can be given another past.

    Parameters
    ----------
    pattern : Pattern
        Of the model.
    tuning, state : (1,) records
        Of a filter on lanes with `flexaxis.estimators.recursion.measurement.measured`.
    alarm : float
        Evidence that raises an alarm [nats].
    period : float
        Sampling period [s].
    angle : (tuning, state)
        As from `flexaxis.estimators.relocate.follow.measuring`.
    """

    def __init__(
        self,
        pattern: Pattern,
        tuning: Record,
        state: Record,
        *,
        alarm: float,
        period: float,
        angle: tuple[Record, Record],
    ) -> None:
        parts = listening(alarm, period)
        place = record(count=0, stop=-1, guarded=0, y=0.0, valid=0)
        self._set = joined(tuning, parts[0], angle[0])
        self._begin = joined(state, parts[1], place, angle[1])
        self._period = period
        self._length = max(round(MEMORY / period), round(SEARCHED / period) + EVALUATIONS)
        self._loop = remembering_loop(pattern)
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._states, self._tuning = self._begin.copy(), self._set.copy()
        self._ring = np.zeros(self._length, self._begin.dtype)

    @property
    def state(self) -> np.void:
        """The filter, ready for the next measurement."""
        return self._states[0]

    @property
    def drift(self) -> Array:
        """Δ, which P gains in a sample."""
        return self._tuning["drift"][0]

    @drift.setter
    def drift(self, value: Array) -> None:
        self._tuning["drift"][0] = value

    @property
    def count(self) -> int:
        """Samples taken."""
        return int(self.state["count"])

    @property
    def first(self) -> int:
        """First sample that is remembered."""
        return max(self.count - self._length, 0)

    @property
    def ringing(self) -> bool:
        """Whether there is enough evidence for an alarm."""
        return bool(np.any(self.state["evidence"] > self._tuning["threshold"]))

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
        for name in NORMAL:
            self.state[name] = row[name]
        self.state["armed"] = self.state["learning"] = self.state["turning"] = 0
        places = self._places(int(row["count"]))
        since = self._ring["turned"][places] - row["turned"]
        self._ring["u"][places, 1] -= since
        self.state["angle"] -= self.state["turned"] - row["turned"]
        self._ring["turned"][places] = self.state["turned"] = row["turned"]

    def accept(self, recent: float, *, noise: bool) -> None:
        """Take the residual of the last seconds for normal: its variance, and learn its colour."""
        first = self.count - round(recent / self._period)
        squares = self.read("epsilon", first) ** 2 / self.read("scale", first)
        measured = squares[~np.isnan(squares)]
        if noise and len(measured):
            self.state["noise"] = np.mean(measured)
        for name in NORMAL:
            if name != "power":
                self.state[name] = self._begin[name][0]

    def arm(self) -> None:
        """Listen and learn again, from now on."""
        self.state["armed"] = self.state["learning"] = self.state["turning"] = 1
        self.state["evidence"], self.state["silent"] = 0.0, self.count

    def run(
        self, u: Array, y: Array, present: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> int:
        """Take samples until an alarm goes off or the count reaches ``stop``; return how many."""
        return self._loop(self._tuning, self._states, u, y, present, estimates, trace, self._ring)

    def beginning(self, count: int) -> np.void:
        """Return the filter as it was before the first sample, but for the count."""
        row = self._begin.copy()
        row["count"] = count
        return row[0]

    def stretch(self, first: int) -> Stretch:
        """Return what is known of each sample from one on."""
        first = max(first, self.first)
        rows = self._ring[self._places(first)]
        rows.flags.writeable = False
        return Stretch(first, rows)

    def read(self, name: str, first: int) -> Array:
        """Return one field from a sample on; zero where nothing is remembered."""
        values = self._ring[name][self._places(first)]
        values[: max(self.first - first, 0)] = 0
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
        places, state = self._places(int(row["count"])), self.state
        lanes, last = replayed.X.shape[1], self._ring["epsilon"][places[-1]]
        for name in REPLAYED:
            self._ring[name][places] = getattr(replayed, name)[:-1]
        self._ring["X"][places, :, :lanes] = replayed.X[:-1].transpose(0, 2, 1)
        self._ring["psi"][places] = replayed.X[:-1, 1:, -1]
        if state["guarded"]:  # what has diverged says nothing of how large y is
            self._ring["expected"][places] = replayed.X[:-1, 0, -1]
            self._ring["signal"][places] = state["signal"] = state["power"]
        before = np.array([row])
        relearn(self._tuning, self._ring, places, replayed.spread, before, self._states)
        # what the other filter left out is left out for good, but for the last sample, of which it
        # is not known yet whether it is an outlier
        self._ring["valid"][places[:-1]] = ~np.isnan(replayed.epsilon[:-2])
        if np.isnan(replayed.epsilon[-2]):
            self._ring["epsilon"][places[-1]] = last
        state["theta"], state["P"], state["turning"] = replayed.theta[-1], replayed.P[-1], 1
        state["claim"], state["X"][:, :lanes] = replayed.claim[-1], replayed.X[-1].T

    def _places(self, first: int) -> NDArray[np.int64]:
        return np.arange(first, self.count) % self._length


@remembered
def remembering_loop(pattern: Pattern) -> Compiled:
    """
    Return the compiled loop: a filter with forgetting and state correction, memory and alarm.

    ``run(tunings, states, u, y, valid, estimates, trace, ring)`` stops after the sample at which
    the alarm goes off, ``count`` reaches ``stop``, or a guarded filter diverges.
    """
    return sample_loop(pattern, remember, "relocate")


@inlined
def remember(tunings, states, k, u, y, valid, estimates, trace, ring):  # noqa: PLR0917
    """Take one sample, as `flexaxis.estimators.recursion.loop` wants it."""
    tuning, state = tunings[0], states[0]
    measure(tuning, state, y[k], valid[k])
    correct_state(state)
    ringing = listen(tuning, state, y[k])
    integrate(tuning, state, y[k], valid[k])
    state["u"][0], state["y"], state["valid"] = u[k], y[k], int(valid[k])
    state["count"] += 1
    ring[(state["count"] - 1) % len(ring)] = state
    if valid[k] and not resting(state):  # nothing is forgotten while nothing can be learnt
        predict(tuning, state)
    publish(state, k, estimates, trace)
    return ringing or state["count"] == state["stop"] or diverged(state)


@inlined
def diverged(state):
    """Return whether θ is no number, in a filter that minds it."""
    total = 0.0
    if state["guarded"]:
        for i in range(len(state["theta"])):
            total += state["theta"][i]
    return not np.isfinite(total)


@compiled
def relearn(tunings, ring, places, spread, before, states):  # noqa: PLR0917
    """Learn noise and colour again from the residuals at some places of the ring, in order."""
    tuning, earlier = tunings[0], before[0]
    for k in range(len(places)):
        row = ring[places[k]]
        hand_on(earlier, row)
        row["armed"], row["learning"], row["quiet"] = 0, 1, row["noise"]
        if not np.isnan(row["epsilon"]):
            listen(tuning, row, row["y"])
            learn(tuning, row, row["epsilon"] ** 2 / spread[k])
        earlier = row
    hand_on(earlier, states[0])


@inlined
def hand_on(earlier, later):
    """Copy what is known of noise and colour."""
    for i in range(len(later["lags"])):
        later["lags"][i] = earlier["lags"][i]
    for i in range(len(later["colour"])):
        later["colour"][i] = earlier["colour"][i]
        later["model"][i] = earlier["model"][i]
        later["correlations"][i] = earlier["correlations"][i]
    later["noise"], later["samples"] = earlier["noise"], earlier["samples"]
    later["heard"], later["power"] = earlier["heard"], earlier["power"]
    later["unforeseen"], later["plain"] = earlier["unforeseen"], earlier["plain"]
    later["white"], later["correlation"] = earlier["white"], earlier["correlation"]
