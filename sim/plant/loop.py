"""Simulate the plant in closed loop, sample by sample, for several runs in parallel."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.controller import Controller
from flexaxis.sim.tables.feed_forward import FeedForward, Follower
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.tables.sensors import White, reading
from flexaxis.sim.timing import TICK

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Truth:
    """Logged torque and true motion of R simulated runs.

    Attributes
    ----------
    torque : ndarray (N, R)
        Logged torque [N m].
    speed : ndarray (N, R)
        True motor speed [rad/s].
    angles : ndarray (N, R, n)
        True angles of the n masses [rad].
    limited : ndarray (R,)
        For each run, the number of samples at which the feed-forward limited a parameter estimate.
    """

    torque: Array
    speed: Array
    angles: Array
    limited: NDArray[np.int64]


def closed_loop(
    scenarios: Sequence[Scenario],
    reference: Array,
    white: White,
    *,
    followers: Sequence[Follower | None] = (),
) -> Truth:
    """Simulate R runs of the closed loop in parallel.

    Parameters
    ----------
    scenarios : sequence of Scenario
        One scenario per run. The scenarios of all runs differ only in their faults and pauses.
    reference : ndarray (N, R)
        Desired motor angle [rad].
    white : callable
        Function that takes the purpose of the noise, such as "noise.speed", and returns white noise
        with standard deviation 1 in an array (N, R). The simulation adds noise to the torque and to
        the sensor signals.
    followers : sequence of Follower or None
        Estimator of each run, which is used only if the controller has a feed-forward. By default,
        no run has an estimator in the control loop.

    Raises
    ------
    SimulationError
        If the physics engine issues a warning, or if an angle or speed is not finite.
    """
    samples, runs = reference.shape
    scenario, changes = scenarios[0], Changes(scenarios)
    drive = _Drive(scenario, runs)
    sensors = scenario.sensors.values() if scenario.feedback == "measured" else ()
    read = reading(sensors, "angle", white, period=scenario.period)
    disturbance = scenario.noise.on_torque(white)
    adapt, feed, measured = scenario.controller.adapt, None, None
    if adapt:
        feed = FeedForward(adapt, scenario.initial, reference, scenario.period, followers)
        measured = [reading(scenario.sensors.values(), signal, white, period=scenario.period)
                    for signal in ("angle", "speed") if any(followers)]  # fmt: skip
    torque, speed = np.empty((2, samples, runs))
    angles = np.empty((samples, *drive.plant.angles.shape))
    for k in range(samples):
        changes.make(drive.plant, k)
        speed[k], angles[k] = drive.plant.speed_m, drive.plant.angles
        (seen,) = read(angles[k : k + 1, :, 0])
        if disturbance is not None:
            drive.disturbance = disturbance[k]
        if feed:
            drive.feed = partial(feed.command, k)
        torque[k] = drive.advance(reference[k], reference[min(k + 1, samples - 1)], seen)
        if feed and measured:
            of_angle, of_speed = measured
            (angle,), (fast,) = of_angle(angles[k : k + 1, :, 0]), of_speed(speed[k : k + 1])
            feed.learn(k, torque[k], angle, fast)
    return Truth(torque, speed, angles, feed.limited if feed else np.zeros(runs, int))


class Changes:
    """Parameter changes of the plant in several runs, each of which has its own scenario."""

    def __init__(self, scenarios: Sequence[Scenario]) -> None:
        known = {s.hash: s.true_parameters() for s in scenarios}
        linear, self._whose = len(scenarios[0].nominal), [[*known].index(s.hash) for s in scenarios]
        truth = np.stack([*known.values()], axis=1)  # (N, scenarios, P)
        self._parameters, self._laws = truth[..., :linear], truth[..., linear:]
        self._moves, self._turns = _changing(self._parameters), _changing(self._laws)
        self._names = scenarios[0].parameter_names[linear:]

    def make(self, plant: Plant, k: int) -> None:
        """Update the plant parameters that change at sample k."""
        if k in self._moves:
            plant.set_parameters(self._parameters[k, self._whose])
        if k in self._turns:
            for i, name in enumerate(self._names):
                before, now = self._laws[k - 1 : k + 1, :, i]
                if (before != now).any():
                    plant.set_law(name, now[self._whose])


def _changing(values: Array) -> set[int]:
    """Return the indices of all samples at which at least one of the values changes."""
    return {int(k) for k in np.flatnonzero(np.diff(values, axis=0).any(axis=(1, 2))) + 1}


def plant_of(scenario: Scenario, runs: int = 1, ticks: int = 1) -> Plant:
    """Return the plant of a scenario, at rest and with its parameter values before any fault.

    Parameters
    ----------
    scenario : Scenario
        Scenario that defines the plant.
    runs : int
        Number of runs in the batch.
    ticks : int
        Number of calls of `Plant.step` per sample.
    """
    nonlinear, period = list(scenario.nonlinear.values()), scenario.period / ticks
    return Plant(
        [scenario.nominal] * runs,
        period=period,
        substeps=substeps(nonlinear, period, least=scenario.substeps or 1),
        nonlinear=nonlinear,
        model=scenario.model,
    )


class _Drive:
    """The controller and the plant, including the inner control loop and the torque delay.

    Attributes
    ----------
    disturbance : ndarray (R,) or None
        Disturbance torque during the next sample [N m]. The disturbance is added to the torque
        commands, but not to the logged torque.
    feed : callable or None
        Function that takes the torque command of the feedback controller and returns the torque
        command including the feed-forward [N m].
    """

    def __init__(self, scenario: Scenario, runs: int) -> None:
        config, delay = scenario.controller, scenario.delay.torque_ticks
        self._ticks = round(scenario.period / TICK) if config.rate or delay else 1
        self._every = 1 if config.rate else self._ticks  # ticks between commands
        self._logged = config.logged
        between = scenario.period * self._every / self._ticks
        self._controller = Controller(config, runs, period=between)
        self._on_the_way = deque(np.zeros((delay, runs)))
        self.disturbance: Array | None = None
        self.feed: Callable[[Array], Array] | None = None
        self.plant = plant_of(scenario, runs, self._ticks)

    def advance(self, target: Array, next_target: Array, angle: Array) -> Array:
        """Simulate one sample, and return the logged torque of each run [N m].

        For each run, the argument `angle` contains the motor angle [rad] that the controller reads
        at the start of the sample.
        """
        commands = []
        for tick in range(self._ticks):
            if tick % self._every == 0:
                part = tick / self._ticks
                seen = self.plant.angle_m.copy() if tick else angle
                goal = target + part * (next_target - target) if tick else target
                asked = self._controller.torque(goal, seen)
                commands.append(self.feed(asked) if self.feed else asked)
            self._on_the_way.append(commands[-1])
            acting = self._on_the_way.popleft()
            self.plant.step(acting if self.disturbance is None else acting + self.disturbance)
        return self._logged(commands)
