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


def sample(axes: Mapping[str, Span], samples: int, seed: int, design: str) -> list[Point]:
    """Return random points that fill the space of the axes.

    Parameters
    ----------
    axes : mapping of str to Span
    samples : int
        Number of points; best a power of two for a Sobol sequence.
    seed : int
        Of the scrambling.
    design : {"sobol", "latin"}
        A scrambled Sobol sequence, whose first N points do not depend on how many follow, or a
        Latin hypercube, which has one point in each of N parts of every axis.

    References
    ----------
    Owen, A. B.: Randomly permuted (t, m, s)-nets and (t, s)-sequences, 1995.
    McKay, M. D., Beckman, R. J. and Conover, W. J.: A comparison of three methods for selecting
    values of input variables, 1979. `scipy.stats.qmc`.
    """
    from scipy.stats import qmc

    rng = np.random.default_rng(seed)
    if design == "sobol":
        power = max(0, math.ceil(math.log2(samples)))
        drawn = qmc.Sobol(len(axes), rng=rng).random_base2(power)[:samples]
    else:
        drawn = qmc.LatinHypercube(len(axes), rng=rng).random(samples)
    return [
        {key: span.at(fraction) for (key, span), fraction in zip(axes.items(), row, strict=True)}
        for row in drawn
    ]
