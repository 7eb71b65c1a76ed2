"""Define faults, which multiply true parameters by factors that change over time."""

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


CAUSES = {
    "worn or dry motor bearing, or dragging brake": "f_m",
    "worn gear or failing gear bearing": "f_g",
    "seizing bearing of the arm": "f_a",
    "dry friction due to a tight seal, preload or dirt": "f_c",
    "demagnetised motor or lost phase": "k_T",
    "picked-up load or changed tool": "J_a",
    "loose coupling or cracked gear tooth": "k_g",
    "loose or cracked joint of the arm": "k_a",
    "aged damper in the gear coupling": "d_g",
    "aged damper in the arm coupling": "d_a",
    "additional part on the motor shaft": "J_m",
    "additional part on the gear": "J_g",
}
"""Name of the parameter that each physical fault changes, keyed by a description of the fault."""


def changeable(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the parameters that can change during a run.

    All axis parameters in `names` except the gear ratio r can change, and so can all nonlinear
    parameters.
    """
    return (*(name for name in names if name != "r"), *LAW_NAMES)


# A number above 100 is likely a percentage or a parameter value, and not a factor.
Factor = Annotated[float, Field(ge=0, le=100)]
Point = Annotated[
    tuple[Positive, Annotated[float, Field(ge=0, le=1)]],
    Field(strict=False),  # arrays in TOML become tuples
]
A_SAMPLE = "a sample at least"
"""Annotation of times that must be at least one sample; rounding can set shorter times to 0."""

Span = Annotated[Positive, A_SAMPLE]


def _change(fault: Fault, share: float = 1.0) -> str:
    """Return the name of a changed parameter and the size of its change, such as "f_m +50 %"."""
    factor = 1.0 + share * (fault.factor - 1.0)
    much = f"{factor:g}-fold" if factor >= 3 else f"{100 * factor - 100:+.3g} %"
    return f"{fault.parameter} {much}"


class Step(Config):
    """A parameter jumps to a new value and then remains constant.

    Attributes
    ----------
    parameter : str
        Name of a `changeable` parameter.
    at : float
        Onset time of the fault [s], rounded to the nearest sample. The parameter has its new value
        from the onset sample onwards.
    factor : float
        Ratio of the new parameter value to the previous value.
    """

    kind: Literal["step"] = "step"
    parameter: str
    at: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor that multiplies the parameter at each sample, as an array (N,)."""
        return np.where(grid.k >= grid.index(self.at), self.factor, 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return the sample indices at which each change begins and at which it is complete."""
        return [(grid.index(self.at), grid.index(self.at))]

    def in_words(self) -> str:
        """Return a short description of the fault, such as "f_m +50 % at 10 s"."""
        return f"{_change(self)} at {self.at:g} s"


class Ramp(Config):
    """A parameter changes linearly to a new value and then remains constant.

    Attributes
    ----------
    parameter : str
        Name of a `changeable` parameter.
    at : float
        Onset time of the fault [s], rounded to the nearest sample. The parameter begins to change
        at the onset sample.
    over : float
        Duration of the change from the old value to the new value [s].
    factor : float
        Ratio of the final parameter value to the value before the onset.
    """

    kind: Literal["ramp"] = "ramp"
    parameter: str
    at: Span
    over: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the parameter factor for each sample, averaged over the duration of the sample."""
        k = grid.k - grid.index(self.at)
        done = np.where(k < 0, 0.0, np.minimum((k + 0.5) / grid.index(self.over), 1.0))
        return 1.0 + done * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return the sample indices at which each change begins and at which it is complete."""
        first = grid.index(self.at)
        return [(first, first + grid.index(self.over))]

    def in_words(self) -> str:
        """Return a short description of the fault, such as "f_m +50 % from 10 to 15 s"."""
        return f"{_change(self)} from {self.at:g} to {self.at + self.over:g} s"


class Thermal(Config):
    """A parameter approaches a new value exponentially, like the friction of an axis that warms up.

    Attributes
    ----------
    parameter : str
        Name of a `changeable` parameter.
    at : float
        Onset time of the fault [s], rounded to the nearest sample. The parameter begins to change
        at the onset sample.
    time_constant : float
        Time until 63 % of the parameter change is complete [s].
    factor : float
        Ratio of the final parameter value to the value before the onset.
    """

    kind: Literal["thermal"] = "thermal"
    parameter: str
    at: Span
    time_constant: Span
    factor: Factor

    def factor_at(self, grid: Grid) -> Array:
        """Return the parameter factor for each sample, averaged over the duration of the sample."""
        k = np.maximum(grid.k - grid.index(self.at), -1)
        decay = np.exp(-grid.period / self.time_constant)
        left = decay**k * (1 - decay) * self.time_constant / grid.period
        return 1.0 + np.where(k < 0, 0.0, 1.0 - left) * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return the sample indices at which each change begins and at which it is complete."""
        first = grid.index(self.at)
        return [(first, first + grid.index(40 * self.time_constant))]  # e⁻⁴⁰ is round-off

    def in_words(self) -> str:
        """Return a short description, such as "f_m -30 % from 5 s, time constant 20 s"."""
        return f"{_change(self)} from {self.at:g} s, time constant {self.time_constant:g} s"


class Intermittent(Config):
    """A parameter alternates between two values, for example because of a loose contact.

    Attributes
    ----------
    parameter : str
        Name of a `changeable` parameter.
    at : float
        Time at which the fault first occurs [s], rounded to the nearest sample.
    on, off : float
        Durations of the intervals with and without the fault [s], rounded to whole samples.
    factor : float
        Ratio of the parameter value during the fault to the value without the fault.
    until : float, optional
        Time at which the fault finally disappears [s]. By default, the fault recurs until the end
        of the run.
    """

    kind: Literal["intermittent"] = "intermittent"
    parameter: str
    at: Span
    on: Span
    off: Span
    factor: Factor
    until: Positive | None = None

    def factor_at(self, grid: Grid) -> Array:
        """Return the factor that multiplies the parameter at each sample, as an array (N,)."""
        return np.where(self._faulty(grid, grid.k), self.factor, 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return each jump as a pair of equal sample indices, because a jump takes no time."""
        switched = self._faulty(grid, grid.k) != self._faulty(grid, grid.k - 1)
        return [(int(index), int(index)) for index in grid.k[switched]]

    def in_words(self) -> str:
        """Return a short description, such as "f_m +50 % from 10 s, 2 s out of 4 s"."""
        return f"{_change(self)} from {self.at:g} s, {self.on:g} s out of {self.on + self.off:g} s"

    def _faulty(self, grid: Grid, k: NDArray[np.int64]) -> NDArray[np.bool_]:
        since = k - grid.index(self.at)
        on, off = grid.index(self.on), grid.index(self.off)
        faulty = (since >= 0) & (since % (on + off) < on)
        return faulty if self.until is None else faulty & (k < grid.index(self.until))


class Profile(Config):
    """A parameter follows a piecewise linear profile over time, such as a measured curve.

    Attributes
    ----------
    parameter : str
        Name of a `changeable` parameter.
    at : float
        Onset time of the fault [s], rounded to the nearest sample. At the onset sample, the
        parameter still has its old value.
    points : tuple of (float, float)
        Corners of the profile. Each corner consists of a time since the onset [s] and the completed
        fraction of the change at this time (0 to 1). The corner times are rounded to whole samples,
        and successive corner times must differ by at least one sample. After the last corner, the
        parameter remains constant.
    factor : float
        Ratio of the parameter value after the complete change to the value before the onset.
    """

    kind: Literal["profile"] = "profile"
    parameter: str
    at: Span
    points: Annotated[tuple[Point, ...], Field(strict=False)]
    factor: Factor

    @field_validator("points")
    @classmethod
    def _in_order(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        times = [time for time, _ in points]
        if not times:
            raise ValueError("the array is empty, but must have at least one entry")
        for before, after in pairwise(times):
            if after <= before:
                raise ValueError(f"corner times must increase; {after:g} s follows "
                                 f"{before:g} s; for a jump, use kind = 'step'")  # fmt: skip
        return points

    def factor_at(self, grid: Grid) -> Array:
        """Return the parameter factor for each sample, linearly interpolated between corners."""
        index, share = self._knots(grid)
        return 1.0 + np.interp(grid.k, index, share) * (self.factor - 1.0)

    def onsets(self, grid: Grid) -> list[tuple[int, int]]:
        """Return the sample indices at which each change begins and at which it is complete."""
        index, share = self._knots(grid)
        lines = zip(pairwise(index), pairwise(share), strict=True)
        return [(first + 1, last) for (first, last), (old, new) in lines
                if old != new and first < grid.k[-1]]  # fmt: skip

    def in_words(self) -> str:
        """Return a short description of the fault, such as "f_m +50 % from 10 s in 3 points"."""
        number = len(self.points)
        points = "1 point" if number == 1 else f"{number} points"
        most = max(share for _, share in self.points)
        return f"{_change(self, most)} from {self.at:g} s in {points}"

    def _knots(self, grid: Grid) -> tuple[list[int], list[float]]:
        """Return the sample indices and the completed fractions of all corners of the profile."""
        times, shares = zip((0.0, 0.0), *self.points, strict=True)
        return [grid.index(self.at) + grid.index(time) for time in times], list(shares)


# To add a fault, write a class with `kind`, `parameter`, `at`, `factor_at`, `onsets` and
# `in_words`, and list it here.
Fault = Annotated[Step | Ramp | Thermal | Intermittent | Profile, Field(discriminator="kind")]
