"""Reference signals of the motor angle."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from flexaxis.sim.tables.config import Config, NotNegative, Positive
from flexaxis.sim.timing import Grid, sample_index

Array = NDArray[np.float64]


# TOML has arrays where we keep tuples.
Interval = Annotated[tuple[NotNegative, float], Field(strict=False)]


class Multisine(Config):
    """Sum of sinusoids: all lines of the DFT in a band, of equal size and random phase.

    In a pause the reference keeps its last value and the clock of the signal stops, so that the
    signal resumes without a jump.

    Attributes
    ----------
    low, high : float
        Band, ends included [Hz].
    period : float
        Period of the signal [s]; its inverse is the distance of the lines.
    rms : float
        Root mean square of the reference over one period [rad of the motor].
    pause : tuple of (float, float)
        Pauses from ... to [s].
    """

    kind: Literal["multisine"] = "multisine"
    low: NotNegative = 0.1
    high: Positive = 30.0
    period: Annotated[float, Field(gt=0, le=3600)] = 10.0  # all of it lies in memory
    rms: Annotated[float, Field(gt=0, le=10)] = 0.0511
    pause: Annotated[tuple[Interval, ...], Field(strict=False)] = ()

    @field_validator("pause")
    @classmethod
    def _pauses_in_order(
        cls, pause: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        ends = [end for interval in pause for end in interval]
        if any(later <= earlier for earlier, later in pairwise(ends)):
            raise ValueError("pauses must be [from, to] with from < to, in order of time")
        return pause

    @model_validator(mode="after")
    def _has_lines(self) -> Multisine:
        if not self._lines():
            raise ValueError(
                f"no line of the period {self.period:g} s (a multiple of {1 / self.period:g} Hz) "
                f"lies between low = {self.low:g} Hz and high = {self.high:g} Hz"
            )
        return self

    def _lines(self) -> range:
        """Return the numbers of the DFT lines in the band, without the mean."""
        slack = 1e-9  # so that 0.1 Hz at 10 s is line 1 and not line 1.0000000000000002
        first = max(1, int(np.ceil(self.low * self.period - slack)))
        return range(first, int(np.floor(self.high * self.period + slack)) + 1)

    def sampling_problems(self, period: float) -> Iterator[tuple[str, str]]:
        """Yield the keys, and why, that do not go with a sampling period [s]."""
        if self.high * period >= 0.5:
            yield "high", f"must be below half the sampling rate, {0.5 / period:g} Hz"
        if abs(self.period / period - sample_index(self.period, period)) > 1e-6:
            yield "period", f"must be a whole number of samples of {1000 * period:g} ms"

    def one_period(self, rng: np.random.Generator, period: float) -> Array:
        """Return one period of the signal, sampled every `period` s [rad]; `rng` draws phases."""
        lines, samples = self._lines(), sample_index(self.period, period)
        spectrum = np.zeros(samples // 2 + 1, dtype=complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
        signal = np.fft.irfft(spectrum, samples)
        return signal * (self.rms / np.sqrt(np.mean(signal**2)))

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference (N,) [rad] at the samples; before its first sample it is 0."""
        signal = self.one_period(rng, grid.period)
        clock = np.cumsum(self.excited(grid)) - 1
        return np.where(clock < 0, 0.0, signal[clock % signal.size])

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return at which samples (N,) the reference moves."""
        moves = np.ones(grid.k.size, dtype=bool)
        for begin, end in self.pause:
            moves &= (grid.k < grid.index(begin)) | (grid.k >= grid.index(end))
        return moves

    def in_words(self) -> str:
        """Return the reference in words."""
        pauses = "".join(f", paused {begin:g} to {end:g} s" for begin, end in self.pause)
        return f"multisine {self.low:g} to {self.high:g} Hz{pauses}"


class Moves(Config):
    """Moves from point to point, each with the least jerk and a rest after it: a work cycle.

    Attributes
    ----------
    reach : float
        The targets are drawn evenly from ±reach [rad of the motor]; the first move starts at 0.
    move : float
        Time of a move [s].
    dwell : float
        Time at rest after each [s].
    """

    kind: Literal["moves"] = "moves"
    reach: Annotated[float, Field(gt=0, le=1000)] = 4.0
    move: Annotated[float, Field(ge=0.05)] = 0.4
    dwell: NotNegative = 0.2

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference (N,) [rad] at the samples; the targets are drawn from `rng`."""
        cycle, done = self._clock(grid)
        drawn = rng.uniform(-self.reach, self.reach, int(cycle.max()) + 1)
        targets = np.concatenate([[0.0], drawn])
        part = done**3 * (10 - 15 * done + 6 * done**2)  # T. Flash and N. Hogan, 1985
        return (1 - part) * targets[cycle] + part * targets[cycle + 1]

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return at which samples (N,) the reference moves."""
        return self._clock(grid)[1] < 1

    def in_words(self) -> str:
        """Return the reference in words."""
        return f"moves of {self.move:g} s within {self.reach:g} rad, {self.dwell:g} s apart"

    def _clock(self, grid: Grid) -> tuple[NDArray[np.int64], Array]:
        """Return the number of the move (N,) at the samples, and how much of its time is over."""
        length = grid.index(self.move)
        cycle, since = np.divmod(grid.k, length + grid.index(self.dwell))
        return cycle, np.minimum(since / length, 1.0)


class Standstill(Config):
    """A reference of zero: the axis is held where it is."""

    kind: Literal["standstill"] = "standstill"

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference (N,), all zero [rad]."""
        return np.zeros(len(grid.k))

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return at which samples (N,) the reference moves: at none."""
        return np.zeros(len(grid.k), dtype=bool)

    def in_words(self) -> str:
        """Return the reference in words."""
        return "standstill"


# A new excitation is a class with `kind`, `reference`, `excited` and `in_words`, and its name here.
Excitation = Annotated[Multisine | Moves | Standstill, Field(discriminator="kind")]
