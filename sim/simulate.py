"""Simulate the plant and the control loop of a scenario for a batch of seeds."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.models_mjcf import model_digest
from flexaxis.sim.errors import ScenarioError, SimulationError
from flexaxis.sim.plant.loop import Truth, closed_loop
from flexaxis.sim.random_draws import stream
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.feed_forward import Follower
from flexaxis.sim.tables.sensors import angle_increment, reading

Array = NDArray[np.float64]


def simulate(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    repeat: int = 0,
) -> list[Record]:
    """Simulate a scenario once for each seed, in one batch.

    A record depends only on its scenario, its seed and `repeat`, and not on the other seeds in the
    batch.

    Parameters
    ----------
    scenario : Scenario
        Scenario to simulate.
    seeds : sequence of int
        Random seeds of the runs, which must be non-negative integers.
    repeat : int
        Index of the repetition. Runs that differ only in `repeat` have the same excitation and the
        same faults, but different noise realizations.

    Returns
    -------
    list of Record
        One record per seed.

    Raises
    ------
    SimulationError
        If the physics engine issues a warning, or if an angle or speed is not finite. The error
        message contains the scenario, the seed and the simulated time.
    """
    seeds = [int(seed) for seed in seeds]
    if not seeds or min(seeds) < 0:
        raise ScenarioError(f"seeds must be one or more non-negative integers, not {seeds}.")
    grid, runs = scenario.grid, [scenario.drawn(seed) for seed in seeds]
    reference = np.column_stack(
        [
            run.excitation.reference(grid, stream(scenario.key, seed, "excitation"))
            for run, seed in zip(runs, seeds, strict=True)
        ]
    )
    white = partial(_white, scenario, seeds, repeat)
    with _named(scenario, seeds):
        truth = closed_loop(runs, reference, white)
    sensors = scenario.sensors.values()
    angle = reading(sensors, "angle", white, period=grid.period)(truth.angles[:, :, 0])
    speed = reading(sensors, "speed", white, period=grid.period)(truth.speed)
    return _records(scenario, seeds, truth, [angle, speed])


def tracked(
    scenario: Scenario,
    runs: Sequence[Scenario],
    seed: int,
    followers: Sequence[Follower | None],
    *,
    samples: int | None = None,
) -> tuple[Array, NDArray[np.int64]]:
    """Simulate several runs, each of which has its own estimator in the control loop.

    One random seed determines the reference and the noise, which are the same in all runs.

    Parameters
    ----------
    scenario : Scenario
        Scenario that determines the random numbers in all runs.
    runs : sequence of Scenario
        Scenario of each run; the scenarios of the runs differ only in their faults.
    seed : int
        Seed of the random numbers.
    followers : sequence of Follower or None
        Estimator that provides the parameter estimates for the feed-forward of each run, or None
        for a run without an estimator.
    samples : int, optional
        Number of samples to simulate (default: all samples of the scenario).

    Returns
    -------
    error : ndarray (N, R)
        Motor angle error [rad], which is the reference minus the true motor angle.
    limited : ndarray (R,)
        Number of samples in each run at which the feed-forward limited a parameter estimate.

    Raises
    ------
    SimulationError
        If the physics engine issues a warning, or if an angle or speed is not finite.
    """
    seeds, grid = [seed] * len(runs), scenario.grid
    one = runs[0].excitation.reference(grid, stream(scenario.key, seed, "excitation"))
    reference = np.column_stack([one[:samples]] * len(runs))
    white = partial(_white, scenario, seeds, 0)
    with _named(scenario, seeds):
        truth = closed_loop(runs, reference, white, followers=followers)
    return reference - truth.angles[:, :, 0], truth.limited


def _white(scenario: Scenario, seeds: list[int], repeat: int, purpose: str) -> Array:
    """Return unit white noise as an array (N, R), for a purpose such as "noise.speed"."""
    purpose += f".{repeat}" if repeat else ""
    streams = [stream(scenario.key, seed, purpose) for seed in seeds]
    return np.column_stack([each.standard_normal(scenario.samples) for each in streams])


@contextmanager
def _named(scenario: Scenario, seeds: list[int]) -> Iterator[None]:
    """Add the scenario and the seed to the error message of a failed simulation."""
    try:
        yield
    except SimulationError as error:
        message = (
            f"{scenario.name}, seed {seeds[error.run]}: the simulation failed at "
            f"t = {error.time:.3f} s ({error.reason}). The axis is unstable, or too stiff for the "
            "integration step. Check the controller gains, the parameters and the faults."
        )
        raise SimulationError(message, error.run, error.time, error.reason) from None


def _records(scenario: Scenario, seeds: list[int], truth: Truth, read: list[Array]) -> list[Record]:
    angle, speed = read
    signals: dict[str, Any] = {
        "torque": truth.torque,
        "angle": angle,
        "speed": speed,
        "increment": angle_increment(angle, period=scenario.period),
        "true_speed": truth.speed,
    }
    masses = [name[2:] for name in scenario.nominal if name[0] == "J"]
    signals |= {f"true_angle_{name}": truth.angles[..., i] for i, name in enumerate(masses)}
    return [
        record_of(scenario, seed, {name: values[:, i].copy() for name, values in signals.items()})
        for i, seed in enumerate(seeds)
    ]


def record_of(scenario: Scenario, seed: int, signals: Mapping[str, Any]) -> Record:
    """Create the record of a run from a dict of its signals, keyed by signal name."""
    run = scenario.drawn(seed)
    return Record(
        time=scenario.times,
        **signals,
        true_parameters=run.true_parameters(),
        parameter_names=scenario.parameter_names,
        scenario=run.resolved(),
        hash=scenario.hash,
        seed=seed,
        burn_in=scenario.burn_in,
        versions=made_with(scenario),
    )


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python, flexaxis, MuJoCo and NumPy, keyed by name."""
    packages = ("flexaxis", "mujoco", "numpy")
    return {"python": platform.python_version()} | {name: version(name) for name in packages}


def made_with(scenario: Scenario) -> dict[str, str]:
    """Return the software versions and the MJCF digest, which can affect the simulated signals."""
    return versions() | {"mjcf": model_digest(scenario.model)}
