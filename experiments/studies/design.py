"""Designs: from the axes of a sweep to its points."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.running.study import Point
from flexaxis.sim.tables.config import Config

MOST = 100_000  # points: what is run of each takes seconds, and all lie in memory
DIGITS = 6  # of a drawn value: enough to fill any axis, and still to be read in a name


class Span(Config):
    """An axis of a Sobol design: where to draw values from.

    Attributes
    ----------
    low, high : float
        Ends.
    log : bool
        Whether the logarithm of the values is spread evenly instead of the values.
    """

    low: float
    high: float
    log: bool = False

    def at(self, fraction: float) -> float:
        """Return the value at a fraction of the way from low to high.

        Examples
        --------
        >>> Span(low=0.01, high=1.0, log=True).at(0.5)
        0.1
        """
        if self.log:
            value = self.low * (self.high / self.low) ** fraction
        else:
            value = self.low + (self.high - self.low) * fraction
        return float(f"{value:.{DIGITS}g}")


def product(axes: Mapping[str, Sequence[Any]]) -> list[Point]:
    """Return every combination of values, the last axis fastest.

    Examples
    --------
    >>> product({"a": [1, 2], "b": [3]})
    [{'a': 1, 'b': 3}, {'a': 2, 'b': 3}]
    """
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def listed(axes: Mapping[str, Sequence[Any]]) -> list[Point]:
    """Return the first values of all axes, then the second ones, and so on.

    Examples
    --------
    >>> listed({"a": [1, 2], "b": [3, 4]})
    [{'a': 1, 'b': 3}, {'a': 2, 'b': 4}]
    """
    return [dict(zip(axes, row, strict=True)) for row in zip(*axes.values(), strict=True)]


def sobol(axes: Mapping[str, Span], samples: int, seed: int) -> list[Point]:
    """Return points of a scrambled Sobol sequence: the first N do not depend on how many follow.

    Parameters
    ----------
    axes : mapping of str to Span
    samples : int
        Number of points; best a power of two.
    seed : int
        Of the scrambling.

    References
    ----------
    Owen, A. B.: Randomly permuted (t, m, s)-nets and (t, s)-sequences, 1995;
    `scipy.stats.qmc.Sobol`.
    """
    from scipy.stats import qmc

    power = max(0, math.ceil(math.log2(samples)))
    drawn = qmc.Sobol(len(axes), rng=np.random.default_rng(seed)).random_base2(power)
    return [
        {key: span.at(fraction) for (key, span), fraction in zip(axes.items(), row, strict=True)}
        for row in drawn[:samples]
    ]
