"""The data that the paper's claims are checked on: MuJoCo runs on seeds that nothing was tuned on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.model import Model, Parametrization, three_mass
from flexaxis.experiments.cache import RecordCache, records
from flexaxis.experiments.catalogue import find_scenario
from flexaxis.experiments.harness import pool
from flexaxis.experiments.seeds import FIRST
from flexaxis.experiments.specs import nominal_torque
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

NOMINAL = "paper_nominal-v1"
FAULTS = {"k_T": "kt_step-v1", "1/J_a": "ja_step-v1", "f_m": "fm_step-v1"}
"""The step-fault scenario of each identified parameter."""

PAUSE = (10.0, 30.0)
"""Standstill of the scenario that shows windup [s]."""


@dataclass(frozen=True)
class Size:
    """How many runs of each kind, from which seed on.

    Attributes
    ----------
    first : int
        Seed of the first run.
    runs : int
        Runs of the paper's experiment, 40 s.
    long : int
        Runs of 60 s for off-line identification.
    few : int
        Runs of each scenario with a standstill or a fault.
    """

    first: int = FIRST
    runs: int = 30
    long: int = 8
    few: int = 8

    def seeds(self, number: int) -> tuple[int, ...]:
        """Return the first seeds."""
        return tuple(range(self.first, self.first + number))


@dataclass(frozen=True)
class Data:
    """All records, and what an estimator may know beforehand.

    Attributes
    ----------
    scenario : Scenario
        The paper's experiment.
    nominal, long, pause : list of Record
        Runs of that, of 60 s of it, and of it with a standstill and θ(0) at the truth.
    faults : dict of str to list of Record
        Runs with a step fault, by the identified parameter that it changes.
    onset : int
        First sample after each of the faults.
    reference_torque : ndarray (8000,)
        Torque of a run at nominal parameters that is not among the records [N m].
    """

    scenario: Scenario
    nominal: list[Record]
    long: list[Record]
    pause: list[Record]
    faults: Mapping[str, list[Record]]
    onset: int
    reference_torque: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The identified parameters."""
        return self.scenario.identify

    @property
    def model(self) -> Model:
        """The three-mass model with nominal parameters."""
        return three_mass(self.scenario.nominal.as_dict())

    @property
    def parametrization(self) -> Parametrization:
        """The model as a function of the identified parameters."""
        return self.model.parametrize(self.names)


def collect(
    size: Size,
    *,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[float], None] | None = None,
) -> Data:
    """Simulate all runs, or take them from the cache.

    Parameters
    ----------
    size : Size
    jobs : int
        Processes. One stays in this process.
    store : RecordCache, optional
        Where records are kept.
    advance : callable, optional
        Called with the number of samples done since the last call.
    """
    scenario = find_scenario(NOMINAL)
    pause = {"start": 1.0, "duration": 45.0, "excitation.pause": [list(PAUSE)]}
    faults = [find_scenario(name) for name in FAULTS.values()]
    wanted = [
        (scenario, size.runs),
        (scenario.override({"duration": 60.0}), size.long),
        (scenario.override(pause), size.few),
        *((fault, size.few) for fault in faults),
    ]
    tasks = [
        (s, chunk) for s, n in wanted for chunk in _chunks(size.seeds(n), -(-n // min(jobs, n)))
    ]
    found: dict[str, list[Record]] = {s.name: [] for s, _ in wanted}
    for (s, _), made in zip(tasks, _spread(tasks, jobs, store), strict=True):
        found[s.name] += made
        if advance:
            advance(s.samples * len(made))
    groups = [found[s.name] for s, _ in wanted]
    return Data(
        scenario=scenario,
        nominal=groups[0],
        long=groups[1],
        pause=groups[2],
        faults=dict(zip(FAULTS, groups[3:], strict=True)),
        onset=faults[0].events()[0].index,
        reference_torque=nominal_torque(scenario),
    )
