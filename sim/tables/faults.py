"""Faults: how the true parameters change over time, as factors on their nominal values."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from flexaxis.sim.parameters import LAW_NAMES
from flexaxis.sim.tables.config import Config, Positive
from flexaxis.sim.timing import Grid

Array = NDArray[np.float64]


def changeable(names: Iterable[str]) -> tuple[str, ...]:
    """Return what can change in a run of an axis with these parameters, if it has such laws."""
    return (*(name for name in names if name != "r"), *LAW_NAMES)


Parameter = str
"""One of those that are `changeable`, which the scenario sees to."""

# Above that a percentage was meant, or a value instead of a factor.
Factor = Annotated[float, Field(ge=0, le=100)]
Point = Annotated[
    tuple[Positive, Annotated[float, Field(ge=0, le=1)]],
    Field(strict=False),  # TOML has arrays
]
A_SAMPLE = "a sample at least"
"""Marks times: what is shorter would round to nothing; at sample 0 there is no value before."""

Span = Annotated[Positive, A_SAMPLE]


def _change(fault: Fault, share: float = 1.0) -> str:
    """Return what changes and how much, such as "f_m +50 %"."""
    factor = 1.0 + share * (fault.factor - 1.0)
    much = f"{factor:g}-fold" if factor >= 3 else f"{100 * factor - 100:+.3g} %"
    return f"{fault.parameter} {much}"


class Step(Config):
    """A parameter jumps and stays.

    Attributes
    ----------
    parameter : str
        One that is `changeable`.
    at : float
        Time of the onset [s], rounded to a sample; that sample has the new value.
    factor : float
        New value over the value before.
    """

    kind: Literal["step"] = "step"
    parameter: Parameter
    at: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor (N,) at the samples."""
        return np.where(grid.k >= grid.index(self.at), self.factor, 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return (first changed sample, first settled sample) of each change."""
        return [(grid.index(self.at), grid.index(self.at))]

    def in_words(self) -> str:
        """Return what changes, how much and when, such as "f_m +50 % at 10 s"."""
        return f"{_change(self)} at {self.at:g} s"


class Ramp(Config):
    """A parameter changes evenly over a time, and stays.

    Attributes
    ----------
    parameter : str
        One that is `changeable`.
    at : float
        Time of the onset [s], rounded to a sample; that sample has the first changed value.
    over : float
        Time from the onset to the final value [s].
    factor : float
        Final value over the value before.
    """

    kind: Literal["ramp"] = "ramp"
    parameter: Parameter
    at: Span
    over: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor (N,) at the samples: the mean of the ramp until the next sample."""
        k = grid.k - grid.index(self.at)
        done = np.where(k < 0, 0.0, np.minimum((k + 0.5) / grid.index(self.over), 1.0))
        return 1.0 + done * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return (first changed sample, first settled sample) of each change."""
        first = grid.index(self.at)
        return [(first, first + grid.index(self.over))]

    def in_words(self) -> str:
        """Return what changes, how much and when, such as "f_m +50 % from 10 to 15 s"."""
        return f"{_change(self)} from {self.at:g} to {self.at + self.over:g} s"


class Thermal(Config):
    """A parameter approaches a new value exponentially, as friction does while an axis warms up.

    Attributes
    ----------
    parameter : str
        One that is `changeable`.
    at : float
        Time of the onset [s], rounded to a sample; that sample has the first changed value.
    time_constant : float
        Time after which 63 % of the change is done [s].
    factor : float
        Value approached over the value before.
    """

    kind: Literal["thermal"] = "thermal"
    parameter: Parameter
    at: Span
    time_constant: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor (N,) at the samples: the mean of the curve until the next sample."""
        k = np.maximum(grid.k - grid.index(self.at), -1)
        decay = np.exp(-grid.period / self.time_constant)
        left = decay**k * (1 - decay) * self.time_constant / grid.period
        return 1.0 + np.where(k < 0, 0.0, 1.0 - left) * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return (first changed sample, first settled sample) of each change."""
        first = grid.index(self.at)
        return [(first, first + grid.index(40 * self.time_constant))]  # e⁻⁴⁰ is round-off

    def in_words(self) -> str:
        """Return what changes, how much and when, such as "f_m -30 % from 5 s, 20 s to 63 %"."""
        return f"{_change(self)} from {self.at:g} s, {self.time_constant:g} s to 63 %"


class Intermittent(Config):
    """A parameter jumps to and fro, as with a loose contact.

    Attributes
    ----------
    parameter : str
        One that is `changeable`.
    at : float
        Time of the first onset [s], rounded to a sample.
    on, off : float
        Time with the fault and time without it, in turn [s], rounded to samples.
    factor : float
        Value during the fault over the value without.
    until : float, optional
        Time from which there is no fault any more [s]; without it, to the end of the run.
    """

    kind: Literal["intermittent"] = "intermittent"
    parameter: Parameter
    at: Span
    on: Span
    off: Span
    factor: Factor
    until: Positive | None = None

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor (N,) at the samples."""
        return np.where(self._faulty(grid, grid.k), self.factor, 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return (first changed sample, first settled sample) of each change in `grid`."""
        switched = self._faulty(grid, grid.k) != self._faulty(grid, grid.k - 1)
        return [(int(index), int(index)) for index in grid.k[switched]]

    def in_words(self) -> str:
        """Return what changes, how much and when, such as "f_m +50 % from 10 s, 2 s of 4"."""
        return f"{_change(self)} from {self.at:g} s, {self.on:g} s of {self.on + self.off:g}"

    def _faulty(self, grid: Grid, k: NDArray[np.int64]) -> NDArray[np.bool_]:
        since = k - grid.index(self.at)
        on, off = grid.index(self.on), grid.index(self.off)
        faulty = (since >= 0) & (since % (on + off) < on)
        return faulty if self.until is None else faulty & (k < grid.index(self.until))


class Profile(Config):
    """A parameter goes along straight lines from point to point, as it was measured or is feared.

    Attributes
    ----------
    parameter : str
        One that is `changeable`.
    at : float
        Time of the onset [s], rounded to a sample, which still has the value before.
    points : tuple of (float, float)
        Time since the onset [s], rounded to samples of their own, and the share of the whole
        change that is done by then, 0 to 1. It stays at the last one.
    factor : float
        Value where all of the change is done, over the value before.
    """

    kind: Literal["profile"] = "profile"
    parameter: Parameter
    at: Span
    points: Annotated[tuple[Point, ...], Field(strict=False)]
    factor: Factor

    @field_validator("points")
    @classmethod
    def _in_order(cls, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        times = [time for time, _ in points]
        if not times:
            raise ValueError("must have at least one entry, not []")
        for before, after in pairwise(times):
            if after <= before:
                raise ValueError(f"times must rise from point to point: {after:g} s is after "
                                 f"{before:g} s; a jump is a fault of its own, a step")  # fmt: skip
        return points

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor (N,) at the samples: that of the line at the sample's time."""
        index, share = self._knots(grid)
        return 1.0 + np.interp(grid.k, index, share) * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return (first changed sample, first settled sample) of each line that is not level."""
        index, share = self._knots(grid)
        lines = zip(pairwise(index), pairwise(share), strict=True)
        return [(first + 1, last) for (first, last), (old, new) in lines
                if old != new and first < grid.k[-1]]  # fmt: skip

    def in_words(self) -> str:
        """Return what changes, how much and when, such as "f_m +50 % from 10 s in 3 points"."""
        number = len(self.points)
        points = "a point" if number == 1 else f"{number} points"
        most = max(share for _, share in self.points)
        return f"{_change(self, most)} from {self.at:g} s in {points}"

    def _knots(self, grid: Grid) -> tuple[list[int], list[float]]:
        """Return samples and shares of the ends of the lines."""
        times, shares = zip((0.0, 0.0), *self.points, strict=True)
        return [grid.index(self.at) + grid.index(time) for time in times], list(shares)


# A new fault is a class with `kind`, `parameter`, `at`, `factor_at`, `onsets` and `in_words`, and
# its name here.
Fault = Annotated[Step | Ramp | Thermal | Intermittent | Profile, Field(discriminator="kind")]
