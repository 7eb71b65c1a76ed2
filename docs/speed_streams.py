"""An axis whose parameters change every few seconds and are repaired, for as long as one likes.

Its excitation has a period, and so have its faults: it is simulated for one lap of them, at whose
end the axis is nominal and moves as at its begin. Every lap after that is the same motion with
fresh noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

Array = NDArray[np.float64]

BASE = {"linear": "fm_step-v1", "friction": "coulomb_fm_step-v1"}
"""Scenarios that the streams are made of: the paper's axis, and the same with dry friction."""

SETTLE = 10.0  # s, a period of the excitation: after that the loop has forgotten that it stood
EVERY = 5.0  # s between two changes by default, as far as the scores look after a fault
CHANGES = {"f_m": 1.5, "J_a": 1.2, "k_T": 0.9, "k_g": 0.8, "J_m": 1.1, "d_g": 2.0, "k_a": 0.8}
"""Factors of the faults of a lap, each repaired at the next change: all sorts, known or not."""
DRY = {"f_c": 1.5}  # besides, where there is dry friction


@dataclass(frozen=True)
class Stream:
    """Motion of an axis without an end.

    Attributes
    ----------
    scenario : Scenario
        One lap, and what came before it: what an estimator is made for.
    u, clean : ndarray (N,)
        Torque [N m] and motor speed [rad/s] of a lap, without noise.
    noise : float
        Standard deviation of the speed's noise [rad/s].
    """

    scenario: Scenario
    u: Array
    clean: Array
    noise: float

    def samples(self, seed: int) -> Samples:
        """Return its samples from the first on, with noise of this seed."""
        return Samples(self, np.random.default_rng(seed))


class Samples:
    """Samples of a stream, one piece after another."""

    def __init__(self, stream: Stream, random: np.random.Generator) -> None:
        self._stream, self._random, self._next = stream, random, 0

    def take(self, count: int) -> tuple[Array, Array]:
        """Return u and y (count,) of the next samples."""
        stream = self._stream
        k = np.arange(self._next, self._next + count) % len(stream.u)
        self._next = int(k[-1]) + 1
        noise = stream.noise * self._random.standard_normal(count)
        return stream.u[k], stream.clean[k] + noise


def make_stream(axis: str, *, faults: bool = True, every: float = EVERY, seed: int = 0) -> Stream:
    """Simulate a lap.

    Parameters
    ----------
    axis : {"linear", "friction"}
        One of `BASE`.
    faults : bool
        Whether anything changes.
    every : float
        Time from one change to the next [s].
    seed : int
        Of the excitation.
    """
    base = find_scenario(BASE[axis])
    listed = [*_faults(axis, every)]
    period = base.grid.period
    lap = SETTLE * (1 + np.ceil(len(listed) * every / SETTLE))  # whole periods, the last nominal
    changes = {"name": f"stream-{axis}", "duration": SETTLE + lap, "fault": listed * faults}
    scenario = base.override(changes)
    record = simulate(scenario, [seed])[0]
    first = round(SETTLE / period)
    assert record.true_speed is not None  # a simulated record has it
    return Stream(scenario, record.torque[first:], record.true_speed[first:], _noise(scenario))


def axis_of(estimator: str) -> str:
    """Return which axis an estimator is made for, of `BASE`."""
    return "friction" if "friction" in estimator.partition("[")[0] else "linear"


def _faults(axis: str, every: float) -> Iterator[dict[str, object]]:
    """Yield the faults of a lap, each followed by its repair."""
    at = SETTLE
    for parameter, factor in (CHANGES | (DRY if axis == "friction" else {})).items():
        for change in (factor, 1 / factor):
            at += every
            yield {"kind": "step", "parameter": parameter, "at": at, "factor": change}


def _noise(scenario: Scenario) -> float:
    return float(scenario.noise.speed)
