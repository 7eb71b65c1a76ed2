"""Define the nonlinear effects of an axis; each class defines a table of a scenario.

The method `build` of a class adds the nonlinear effect to the MuJoCo model of the plant. The
attribute `exact` states whether the linear axis model describes the effect exactly. The attribute
`substeps` is the number of simulation steps per 5 ms that the effect requires. With this number of
steps, the relative error of the simulated motor speed is 1e-5, or 1e-3 for stick-slip friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

from pydantic import Field

from flexaxis.sim.tables.config import Config, Positive

SPAN = 0.005  # simulated time to which the attribute `substeps` refers [s]
LINEAR_SUBSTEPS = 5
_NO_INPUT = 16  # MuJoCo's mjINPUT_NONE: an actuator without a command


class Place(NamedTuple):
    """Location of a number in a MuJoCo model: name of the field, name of the object, and column."""

    field: str
    owner: str
    column: int | None = None


class Nonlinearity(Config):
    """Base class of all scenario tables that add a nonlinear effect to the plant.

    Attributes
    ----------
    exact : bool
        Always False, because the linear axis model cannot describe a nonlinear effect.
    substeps : int
        Number of simulation steps per 5 ms that the effect requires.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS

    def build(self, spec: Any) -> None:
        """Add the effect to a MuJoCo model specification (`MjSpec`)."""
        raise NotImplementedError

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the effect, keyed by their names in a record."""
        return {}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the MuJoCo values of the parameters in `law`, keyed by location in the model.

        The returned dictionary is empty if the parameters cannot change during a run.
        """
        return {}


def substeps(features: Iterable[Nonlinearity], period: float, *, least: int = 1) -> int:
    """Return the number of simulation steps per sampling period that all nonlinear effects require.

    The argument `least` is a lower limit for the number of simulation steps per 5 ms.

    Examples
    --------
    >>> [substeps([], period) for period in (0.001, 0.0025, 0.005, 0.01)]
    [1, 3, 5, 10]
    """
    finest = max([LINEAR_SUBSTEPS, least, *(feature.substeps for feature in features)])
    return math.ceil(finest * period / SPAN - 1e-9)


class CoggingConfig(Nonlinearity):
    """Cogging torque of the motor magnets: amplitude · sin(poles · motor angle).

    Attributes
    ----------
    amplitude : float
        Amplitude of the cogging torque [N m].
    poles : int
        Number of cogging periods per motor revolution.
    """

    amplitude: Positive
    poles: int = Field(ge=1, le=500)

    def build(self, spec: Any) -> None:
        """Add the effect to a MuJoCo model specification (`MjSpec`)."""
        passive(spec, "cogging", cogging=[self.amplitude, self.poles, 0.0])

    def in_words(self) -> str:
        """Return a short description of the nonlinear effect."""
        return f"cogging of {self.amplitude:g} N m, {self.poles} periods per revolution"


class BacklashConfig(Nonlinearity):
    """Backlash between the motor and the gear.

    Attributes
    ----------
    gear : float
        Width of the backlash gap, in which the gear spring exerts no torque [rad on the arm side].
        The gear damper also acts within the backlash gap.
    """

    substeps: ClassVar[int] = 20
    gear: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to a MuJoCo model specification (`MjSpec`)."""
        spec.tendon("gear").springlength = [-self.gear / 2, self.gear / 2]

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the nonlinear effect, keyed by name."""
        return {"gap": self.gear}

    def in_words(self) -> str:
        """Return a short description of the nonlinear effect."""
        return f"backlash of {self.gear:g} rad at the gear"


class StiffeningConfig(Nonlinearity):
    """Gear spring whose stiffness increases with the twist x; the torque is k_g (x + gear · x³).

    The linear and the cubic term are both proportional to k_g, so a fault in k_g changes them by
    the same factor.

    Attributes
    ----------
    gear : float
        Ratio of the cubic stiffness coefficient to the linear stiffness coefficient [1/rad² on the
        arm side].
    """

    gear: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to a MuJoCo model specification (`MjSpec`)."""
        spring = spec.tendon("gear")
        spring.stiffness = [spring.stiffness[0], 0.0, self.gear * spring.stiffness[0]]

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the nonlinear effect, keyed by name."""
        return {"kappa": self.gear}

    def in_words(self) -> str:
        """Return a short description of the nonlinear effect."""
        return f"stiffening gear spring, {self.gear:g}/rad²"


class SaturationConfig(Nonlinearity):
    """Torque limit of the drive; the logged torque is the command before the limit is applied.

    Attributes
    ----------
    torque : float
        Largest absolute value of the torque command [N m]. The motor torque is the limited command
        times the torque constant k_T.
    """

    torque: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to a MuJoCo model specification (`MjSpec`)."""
        spec.actuator("motor").forcerange = [-self.torque, self.torque]

    def in_words(self) -> str:
        """Return a short description of the nonlinear effect."""
        return f"torque limited to {self.torque:g} N m"


def passive(spec: Any, name: str, **law: list[float]) -> None:
    """Add a DC motor without input to the motor joint, to model LuGre friction or cogging.

    The DC motor of MuJoCo implements LuGre friction and cogging. The keyword arguments are the
    parameters of LuGre friction or cogging in MuJoCo.
    """
    motor = spec.add_actuator(name=name, target="motor")
    motor.trntype = spec.actuator("motor").trntype
    motor.set_to_dcmotor(motorconst=[0.0, 0.0], resistance=1.0, ctrlspec=_NO_INPUT, **law)
