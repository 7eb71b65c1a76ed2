"""The axis as it runs: plant and loop; faults, friction, noise and excitation may change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.sim.parameters import AxisParameters, preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.scenario import Scenario, scenario_from
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.controller import Controller, ControllerConfig
from flexaxis.sim.tables.excitation import Multisine
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.tables.sensors import NoiseConfig
from flexaxis.sim.timing import PERIOD, sample_index

KINDS = ("none", "Coulomb", "static curve", "LuGre")
"""What can be had: a torque f_c against the motion, one that is larger at low speed, bristles."""

LIMITS = {"f_c": (0.01, 0.4), "f_s": (0.0, 0.4), "v_s": (0.2, 5.0)}
"""Least and largest value [N m, N m, rad/s]; the torque of the loop has an rms of 0.85 N m."""

UNITS = {"f_c": "N m", "f_s": "N m", "v_s": "rad/s"}

BEGINS = 5.0
"""β of the static curve [s/rad]: sliding begins at 0.2 rad/s, a twentieth of the rms of speed."""

BRISTLES = {"stiffness": 100.0, "damping": 0.3}
"""σ₀ [N m/rad] and σ₁ [N m s/rad] of LuGre friction, as in the catalogue."""


@dataclass(frozen=True)
class Friction:
    """A law of friction beside the viscous one.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    f_c, f_s : float
        Level of fast sliding, and what slow motion takes more [N m].
    v_s : float
        Speed above which that excess has gone [rad/s].
    """

    kind: str = "none"
    f_c: float = 0.1
    f_s: float = 0.1
    v_s: float = 0.5

    @property
    def knobs(self) -> tuple[str, ...]:
        """Which of its values mean something for this kind."""
        return {"none": (), "Coulomb": ("f_c",)}.get(self.kind, tuple(LIMITS))

    @property
    def level(self) -> float:
        """The level f_c that acts [N m], zero without friction."""
        return self.f_c if self.knobs else 0.0

    def acts_as(self, other: Friction) -> bool:
        """Return whether no motion could tell it from another one."""
        same = [getattr(self, name) == getattr(other, name) for name in self.knobs]
        return self.kind == other.kind and all(same)

    def tables(self) -> dict[str, dict[str, float]]:
        """Return it as tables of a scenario."""
        f_c, f_s, v_s = self.f_c, self.f_s, self.v_s
        curve = {"f_c": f_c, "f_s": max(f_s, 1e-9), "alpha": 1 / v_s, "beta": BEGINS}
        bristles = BRISTLES | {"coulomb": f_c, "static": f_c + f_s, "stribeck": v_s}
        return {
            "none": {},
            "Coulomb": {"friction": {"coulomb": f_c}},
            "static curve": {"static_friction": curve},
            "LuGre": {"lugre": bristles},
        }[self.kind]

    def in_words(self) -> str:
        """Return what it is and how large."""
        values = ", ".join(f"{name} {getattr(self, name):.3g} {UNITS[name]}" for name in self.knobs)
        return f"{self.kind} ({values})" if values else "no dry friction"


Array = NDArray[np.float64]

EXCITATION = ("on", "stop-and-go", "off")
SPELL = 10.0
"""Seconds that the axis moves, and then stands, in stop-and-go."""

FACTORS = (0.5, 2.0)
"""Least and largest fault: beyond them the controller, made for the nominal axis, loses grip."""


@dataclass(frozen=True)
class Samples:
    """What happened in n samples.

    Attributes
    ----------
    torque, speed : ndarray (n,)
        Command [N m] and measured motor speed [rad/s].
    excited : ndarray (n,) of bool
        Where the reference moves.
    """

    torque: Array
    speed: Array
    excited: NDArray[np.bool_]

    def then(self, later: Samples, *, keep: int) -> Samples:
        """Return these samples and later ones, the last `keep` of them."""
        return Samples(
            np.concatenate([self.torque, later.torque])[-keep:],
            np.concatenate([self.speed, later.speed])[-keep:],
            np.concatenate([self.excited, later.excited])[-keep:],
        )


NO_SAMPLES = Samples(np.empty(0), np.empty(0), np.empty(0, bool))


class LiveAxis:
    """The nominal axis in its closed loop, advanced by any number of samples at a time.

    Parameters
    ----------
    seed : int
        Of reference phases and noise: the same seed and the same actions give the same run.

    Attributes
    ----------
    nominal : AxisParameters
        Parameters without a fault.
    parameters : AxisParameters
        Those that act now.
    friction : Friction
        Dry friction that acts now.
    scenario : Scenario
        What the axis is, as a scenario would have it: its laws, and the noise of the catalogue.
    noise : float
        Standard deviation of the measured speed [rad/s].
    excitation : {"on", "stop-and-go", "off"}
        Whether the reference moves; where it does not, it keeps its value.
    """

    def __init__(self, *, seed: int = 0) -> None:
        self.nominal = self.parameters = preset("n1")
        self.noise = NoiseConfig().speed
        self.samples = 0
        self._excitation, self._since = "on", 0
        self._signal = Multisine().one_period(stream("demo", seed, "excitation"), PERIOD)
        self._clock = 0
        self._white = stream("demo", seed, "noise.speed")
        self.friction = Friction()
        self.scenario = _scenario(self.friction)
        self._plant = self._made()
        self._controller = Controller(ControllerConfig(), 1, period=PERIOD)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.samples * PERIOD

    @property
    def excitation(self) -> str:  # noqa: D102
        return self._excitation

    @excitation.setter
    def excitation(self, mode: str) -> None:
        self._excitation, self._since = mode, self.samples

    @property
    def excited(self) -> bool:
        """Whether the reference moves in the next sample."""
        if self._excitation != "stop-and-go":
            return self._excitation == "on"
        return (self.samples - self._since) // sample_index(SPELL, PERIOD) % 2 == 0

    @property
    def angles(self) -> Array:
        """Motor, gear and arm angle (3,) [rad]."""
        return self._plant.angles[0].copy()

    @property
    def state(self) -> Array:
        """Twist of gear and arm [rad], speed of motor, gear and arm [rad/s], (5,)."""
        motor, gear, arm = self.angles
        return np.array([self.parameters.r * motor - gear, gear - arm, *self._plant.speeds[0]])

    @property
    def values(self) -> dict[str, float]:
        """All parameters that act now, those of the law of friction behind the twelve."""
        return self.parameters.as_dict() | self.scenario.laws

    def theta(self, names: tuple[str, ...]) -> Array:
        """Return the true values (p,) of estimated parameters."""
        values = self.parameters.as_dict() | {"f_c": self.friction.level}
        return true_theta(names, np.array(list(values.values())), tuple(values))

    def set_factors(self, factors: dict[str, float]) -> None:
        """Set parameters to factors times nominal, within `FACTORS`, and all others to nominal."""
        values = {n: v * factors.get(n, 1.0) for n, v in self.nominal.as_dict().items()}
        self.parameters = AxisParameters(**values)
        self._plant.set_parameters([self.parameters])

    def set_friction(self, friction: Friction) -> None:
        """Let another dry friction act from now on; angles and speeds stay."""
        old, before, same = self._plant, self.scenario.laws, friction.kind == self.friction.kind
        self.friction, self.scenario = friction, _scenario(friction)
        if same:
            for name, value in self.scenario.laws.items():
                if value != before[name]:
                    old.set_law(name, value)
            return
        self._plant = self._made()
        self._plant.angles[:], self._plant.speeds[:] = old.angles, old.speeds

    def _made(self) -> Plant:
        laws = list(self.scenario.nonlinear.values())
        return Plant(
            [self.parameters], period=PERIOD, substeps=substeps(laws, PERIOD), nonlinear=laws
        )

    def advance(self, samples: int) -> Samples:
        """Simulate some samples and return what was commanded and measured in them."""
        torque, speed = np.empty((2, samples))
        excited = np.empty(samples, bool)
        for k in range(samples):
            excited[k] = self.excited
            speed[k] = self._plant.speed_m[0]
            self._clock += int(excited[k])  # else the reference keeps its last value
            reference = self._signal[[(self._clock - 1) % len(self._signal)]]
            torque[k] = self._controller.torque(reference, self._plant.angle_m)[0]
            self._plant.step(torque[k : k + 1])
            self.samples += 1
        speed += self.noise * self._white.standard_normal(samples)
        return Samples(torque, speed, excited)


def _scenario(friction: Friction) -> Scenario:
    content = {"name": "live", "duration": 1.0, "preset": "n1", **friction.tables()}
    return scenario_from(content, source="live axis")
