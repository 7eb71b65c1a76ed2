"""The data that the claims are checked on: MuJoCo runs on seeds that no estimator is tuned on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from loky import ProcessPoolExecutor
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import three_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.studies.definition import FIRST
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.excitation import Multisine

Array = NDArray[np.float64]

NOMINAL = "paper_nominal-v1"
FAULTS = {"k_T": "kt_step-v1", "1/J_a": "ja_step-v1", "f_m": "fm_step-v1"}
"""The step-fault scenario of each identified parameter."""

SMALL = {"k_T": 0.97, "1/J_a": 1.02, "f_m": 1.1}
"""Factors on k_T, J_a and f_m that are small enough for a linear theory, well above the noise."""

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
    few: int = 16

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
    faults, small : dict of str to list of Record
        Runs with a step fault, and with a small one, by the identified parameter that it changes.
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
    small: Mapping[str, list[Record]]
    onset: int
    reference_torque: Array

    @property
    def excitation(self) -> Multisine:
        """What the reference is made of."""
        assert isinstance(self.scenario.excitation, Multisine)
        return self.scenario.excitation

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
        Called with the fraction done since the last call.
    """
    scenario = find_scenario(NOMINAL)
    pause = {"start": 1.0, "duration": 45.0, "excitation.pause": [list(PAUSE)]}
    faults = {name: find_scenario(fault) for name, fault in FAULTS.items()}
    wanted = {
        "nominal": (scenario, size.seeds(size.runs)),
        "long": (scenario.override({"duration": 60.0}), size.seeds(size.long)),
        "pause": (scenario.override(pause), size.seeds(size.few)),
        **{name: (fault, size.seeds(size.few)) for name, fault in faults.items()},
        **{f"small {name}": (_small(name, faults), size.seeds(size.few)) for name in faults},
    }
    found = _simulate(wanted, jobs, store, advance or (lambda fraction: None))
    return Data(
        scenario=scenario,
        nominal=found["nominal"],
        long=found["long"],
        pause=found["pause"],
        faults={name: found[name] for name in FAULTS},
        small={name: found[f"small {name}"] for name in FAULTS},
        onset=faults["f_m"].events()[0].index,
        reference_torque=nominal_torque(scenario),
    )


def signals(record: Record) -> tuple[Array, Array]:
    """Return torque [N m] and measured speed [rad/s] of a record, (N,) each."""
    assert record.speed is not None  # a simulated record has it
    return record.torque, record.speed


def _small(name: str, faults: Mapping[str, Scenario]) -> Scenario:
    return faults[name].override({"fault[0].factor": SMALL[name]})


@dataclass(frozen=True)
class _Part:
    """Some runs of a group, simulated at a time."""

    group: str
    scenario: Scenario
    seeds: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.scenario.name}, seeds {', '.join(map(str, self.seeds))}"


def _made(part: _Part, store: RecordCache | None) -> tuple[str, list[Record]]:
    return part.group, records(part.scenario, part.seeds, store)


def _simulate(
    wanted: Mapping[str, tuple[Scenario, Sequence[int]]],
    jobs: int,
    store: RecordCache | None,
    advance: Callable[[float], None],
) -> dict[str, list[Record]]:
    """Return the records of each group, its seeds shared out to the processes."""
    parts = [
        _Part(group, scenario, tuple(seeds[i::jobs]))
        for group, (scenario, seeds) in wanted.items()
        for i in range(min(jobs, len(seeds)))
    ]
    total = sum(part.scenario.samples * len(part.seeds) for part in parts)
    found: dict[str, list[Record]] = {group: [] for group in wanted}
    with ProcessPoolExecutor(jobs) as pool:
        for group, records_ in pool.map(partial(_made, store=store), parts):
            found[group] += records_
            advance(sum(len(record.time) for record in records_) / total)
    return {group: sorted(made, key=lambda r: r.seed or 0) for group, made in found.items()}
