"""Contenders, timed in rounds: ratios within a round survive what absolute times do not.

Machines are shared and noisy, so every round measures all contenders one after the other, in the
processor time of this thread, and what is reported is the ratio to another one within the round,
its median and its range.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Timed = Callable[[], float]  # seconds a sample, measured now
Clock = Callable[[], float]


@dataclass(frozen=True)
class Contender:
    """Something that is timed.

    Attributes
    ----------
    name, what : str
        What it is called, and in words.
    unit : str
        Name of the contender that its time is divided by.
    seconds : callable
        Measures once, and returns seconds a sample (of one run).
    faster : bool
        Whether to give unit over it ("times faster") rather than it over unit.
    besides : str, optional
        Name of a second contender; it over this one is given as well.
    facts : dict
        What else its row says.
    """

    name: str
    what: str
    unit: str
    seconds: Timed
    faster: bool = True
    besides: str | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def measure(contenders: Sequence[Contender], rounds: int = 7) -> Iterator[list[dict[str, Any]]]:
    """Yield the table of ratios after each round.

    Parameters
    ----------
    contenders : sequence of Contender
        With those that they are divided by.
    rounds : int
        How often each is measured.

    Yields
    ------
    list of dict
        ``name, what, us_per_sample`` (median), ``unit, faster, ratio, low, high``: median and
        range over the rounds so far; ``besides, times`` of it: the median; and its facts.
    """
    for contender in contenders:
        contender.seconds()  # caches, first calls
    times: list[dict[str, float]] = []
    for _ in range(rounds):
        times.append({contender.name: contender.seconds() for contender in contenders})
        yield [_row(contender, times) for contender in contenders]


def _row(contender: Contender, times: list[dict[str, float]]) -> dict[str, Any]:
    own = np.array([round_[contender.name] for round_ in times])
    unit = np.array([round_[contender.unit] for round_ in times])
    ratios = unit / own if contender.faster else own / unit
    row = {
        "name": contender.name,
        "what": contender.what,
        "us_per_sample": 1e6 * float(np.median(own)),
        "unit": contender.unit,
        "faster": contender.faster,
        "ratio": float(np.median(ratios)),
        "low": float(ratios.min()),
        "high": float(ratios.max()),
    }
    if contender.besides is not None:
        other = np.array([round_[contender.besides] for round_ in times])
        row |= {"besides": contender.besides, "times": float(np.median(own / other))}
    return row | contender.facts


def timed(
    work: Callable[[], object], samples: int, clock: Clock = time.thread_time, before: Any = None
) -> Timed:
    """Return what measures some work.

    Parameters
    ----------
    work : callable
        Takes so many samples.
    samples : int
    clock : callable
        Time [s]; that of this thread by default, which a busy machine does not lengthen.
    before : callable, optional
        Called first, untimed.
    """

    def seconds() -> float:
        if before is not None:
            before()
        start = clock()
        work()
        return (clock() - start) / samples

    return seconds
