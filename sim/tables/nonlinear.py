"""Nonlinear effects of an axis; each class is a table of a scenario.

Every table adds itself to the MuJoCo model of the plant (`build`), states that the linear model
does not describe it (`exact`), and gives the simulation steps per sample that it needs
(`substeps`). The motor speed then agrees with an independent solution to 1e-5 of its rms, and to
1e-3 with stick-slip friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

from pydantic import Field

from flexaxis.sim.tables.config import Config, Positive

SPAN = 0.005  # s, of which `substeps` says into how many steps it is cut
LINEAR_SUBSTEPS = 5
_NO_INPUT = 16  # MuJoCo's mjINPUT_NONE: an actuator without a command


class Place(NamedTuple):
    """Where the engine keeps a number: field of its model, named object, column if it has some."""

    field: str
    owner: str
    column: int | None = None


class Nonlinearity(Config):
    """A table of a scenario that is built into the plant.

    Attributes
    ----------
    substeps : int
        Steps of the engine that 5 ms need with it.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        raise NotImplementedError

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name, of those that a record has."""
        return {}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps parameters such as these, and as what.

        Nowhere, where they cannot change in a run.
        """
        return {}


def substeps(features: Iterable[Nonlinearity], period: float, *, least: int = 1) -> int:
    """Return the steps of the engine in a period [s], fine enough for all features.

    ``least`` is that of 5 ms.

    Examples
    --------
    >>> [substeps([], period) for period in (0.001, 0.0025, 0.005, 0.01)]
    [1, 3, 5, 10]
    """
    finest = max([LINEAR_SUBSTEPS, least, *(feature.substeps for feature in features)])
    return math.ceil(finest * period / SPAN - 1e-9)


class CoggingConfig(Nonlinearity):
    """Cogging of the motor: a torque amplitude · sin(poles · φ_m) that the magnets add.

    Attributes
    ----------
    amplitude : float
        Largest torque [N m].
    poles : int
        Periods in one revolution of the motor.
    """

    amplitude: Positive
    poles: int = Field(ge=1, le=500)

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        passive(spec, "cogging", cogging=[self.amplitude, self.poles, 0.0])

    def in_words(self) -> str:
        """Return the effect and its size in words."""
        return f"cogging of {self.amplitude:g} N m, {self.poles} periods a turn"


class BacklashConfig(Nonlinearity):
    """Play between the motor and the gear.

    Attributes
    ----------
    gear : float
        Width of the gap [rad on the arm side] within which the gear spring has no force. The damper
        of the gear acts in the gap too.
    """

    substeps: ClassVar[int] = 20
    gear: Positive

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        spec.tendon("gear").springlength = [-self.gear / 2, self.gear / 2]

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {"gap": self.gear}

    def in_words(self) -> str:
        """Return the effect and its size in words."""
        return f"backlash of {self.gear:g} rad at the gear"


class StiffeningConfig(Nonlinearity):
    """A gear spring that stiffens with its twist x: torque k_g (x + gear · x³).

    The whole law is proportional to k_g, so that a fault of k_g weakens all of it.

    Attributes
    ----------
    gear : float
        Cubic coefficient over the linear one [1/rad² on the arm side].
    """

    gear: Positive

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        spring = spec.tendon("gear")
        spring.stiffness = [spring.stiffness[0], 0.0, self.gear * spring.stiffness[0]]

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {"kappa": self.gear}

    def in_words(self) -> str:
        """Return the effect and its size in words."""
        return f"gear spring stiffening by {self.gear:g}/rad²"


class SaturationConfig(Nonlinearity):
    """A limit of the drive: it acts on ±torque at most, while the log has the command.

    Attributes
    ----------
    torque : float
        Largest size of the command that acts [N m]; k_T multiplies what is left.
    """

    torque: Positive

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        spec.actuator("motor").forcerange = [-self.torque, self.torque]

    def in_words(self) -> str:
        """Return the effect and its size in words."""
        return f"torque limited to {self.torque:g} N m"


def passive(spec: Any, name: str, **law: list[float]) -> None:
    """Add a currentless electric motor to the joint, because the engine models friction there."""
    motor = spec.add_actuator(name=name, target="motor")
    motor.trntype = spec.actuator("motor").trntype
    motor.set_to_dcmotor(motorconst=[0.0, 0.0], resistance=1.0, ctrlspec=_NO_INPUT, **law)
