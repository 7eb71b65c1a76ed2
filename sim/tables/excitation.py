"""Generate reference signals for the motor angle."""

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


# Scenario files contain TOML arrays, which are converted to tuples.
Interval = Annotated[tuple[NotNegative, float], Field(strict=False)]


class Multisine(Config):
    """A sum of sinusoids at all DFT lines in a band, with equal amplitudes and random phases.

    During a pause, the reference keeps its last value. After the pause, the multisine continues
    without a jump.

    Attributes
    ----------
    low, high : float
        Lowest and highest frequency of the multisine [Hz].
    period : float
        Period of the multisine [s]. The frequency spacing of the DFT lines is the inverse of the
        period.
    rms : float
        Root-mean-square value of the multisine [rad on the motor side].
    pause : tuple of (float, float)
        Start and end time of each pause [s].
    """

    kind: Literal["multisine"] = "multisine"
    low: NotNegative = 0.1
    high: Positive = 30.0
    period: Annotated[float, Field(gt=0, le=3600)] = 10.0  # a whole period is kept in memory
    rms: Annotated[float, Field(gt=0, le=10)] = 0.0511
    pause: Annotated[tuple[Interval, ...], Field(strict=False)] = ()

    @field_validator("pause")
    @classmethod
    def _pauses_in_order(
        cls, pause: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        ends = [end for interval in pause for end in interval]
        if any(later <= earlier for earlier, later in pairwise(ends)):
            raise ValueError("each pause must end after its start and before the next pause")
        return pause

    @model_validator(mode="after")
    def _has_lines(self) -> Multisine:
        if not self._lines():
            raise ValueError(
                f"no multiple of 1/period = {1 / self.period:g} Hz "
                f"lies between low = {self.low:g} Hz and high = {self.high:g} Hz: increase `high` "
                "or `period`, or decrease `low`"
            )
        return self

    def _lines(self) -> range:
        """Return the indices of the DFT lines from `low` to `high`, except line 0 (the mean)."""
        slack = 1e-9  # tolerance for rounding: 0.1 Hz at 10 s is line 1
        first = max(1, int(np.ceil(self.low * self.period - slack)))
        return range(first, int(np.floor(self.high * self.period + slack)) + 1)

    def sampling_problems(self, period: float) -> Iterator[tuple[str, str]]:
        """Yield a key and an error message for each value that the sampling period forbids."""
        if self.high * period >= 0.5:
            yield "high", f"the frequency must be below {0.5 / period:g} Hz, half the sampling rate"
        if abs(self.period / period - sample_index(self.period, period)) > 1e-6:
            yield "period", f"must be a multiple of the sampling period ({1000 * period:g} ms)"

    def one_period(self, rng: np.random.Generator, period: float) -> Array:
        """Return one period of the multisine [rad], sampled every `period` seconds."""
        lines, samples = self._lines(), sample_index(self.period, period)
        spectrum = np.zeros(samples // 2 + 1, dtype=complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
        signal = np.fft.irfft(spectrum, samples)
        return signal * (self.rms / np.sqrt(np.mean(signal**2)))

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference at each sample [rad]; before the first motion, its value is 0."""
        signal = self.one_period(rng, grid.period)
        clock = np.cumsum(self.excited(grid)) - 1
        return np.where(clock < 0, 0.0, signal[clock % signal.size])

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return whether the reference moves at each sample, as a boolean array (N,)."""
        moves = np.ones(grid.k.size, dtype=bool)
        for begin, end in self.pause:
            moves &= (grid.k < grid.index(begin)) | (grid.k >= grid.index(end))
        return moves

    def in_words(self) -> str:
        """Return a short description of the reference."""
        pauses = "".join(f", paused {begin:g} to {end:g} s" for begin, end in self.pause)
        return f"multisine {self.low:g} to {self.high:g} Hz{pauses}"


class Moves(Config):
    """Point-to-point moves with minimum jerk, and a standstill after each move.

    Attributes
    ----------
    reach : float
        Largest absolute value of a target angle [rad on the motor side]. The target angles are
        uniformly distributed between -reach and reach. The first move starts at angle 0.
    move : float
        Duration of each move [s].
    dwell : float
        Duration of the standstill after each move [s].
    """

    kind: Literal["moves"] = "moves"
    reach: Annotated[float, Field(gt=0, le=1000)] = 4.0
    move: Annotated[float, Field(ge=0.05)] = 0.4
    dwell: NotNegative = 0.2

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference at each sample [rad], with random target angles from `rng`."""
        cycle, done = self._clock(grid)
        drawn = rng.uniform(-self.reach, self.reach, int(cycle.max()) + 1)
        targets = np.concatenate([[0.0], drawn])
        part = done**3 * (10 - 15 * done + 6 * done**2)  # T. Flash and N. Hogan, 1985
        return (1 - part) * targets[cycle] + part * targets[cycle + 1]

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return whether the reference moves at each sample, as a boolean array (N,)."""
        return self._clock(grid)[1] < 1

    def in_words(self) -> str:
        """Return a short description of the reference."""
        return f"moves of {self.move:g} s within {self.reach:g} rad, with rests of {self.dwell:g} s"

    def _clock(self, grid: Grid) -> tuple[NDArray[np.int64], Array]:
        """Return, for each sample, the index and the completed fraction of the current move."""
        length = grid.index(self.move)
        cycle, since = np.divmod(grid.k, length + grid.index(self.dwell))
        return cycle, np.minimum(since / length, 1.0)


class Standstill(Config):
    """A reference that is always zero, so the axis remains at its initial position."""

    kind: Literal["standstill"] = "standstill"

    def reference(self, grid: Grid, rng: np.random.Generator) -> Array:
        """Return the reference [rad], which is zero at all samples."""
        return np.zeros(len(grid.k))

    def excited(self, grid: Grid) -> NDArray[np.bool_]:
        """Return False for each sample, because the reference never moves."""
        return np.zeros(len(grid.k), dtype=bool)

    def in_words(self) -> str:
        """Return a short description of the reference."""
        return "standstill"


# To add an excitation, write a class with `kind`, `reference`, `excited` and `in_words`, and list
# it here.
Excitation = Annotated[Multisine | Moves | Standstill, Field(discriminator="kind")]
