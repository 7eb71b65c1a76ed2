"""Define nonlinear effects of an axis; each class is a table of a scenario.

The method `build` of a class adds the effect to the MuJoCo model of the plant. The attribute
`exact` states whether the linear model describes the effect exactly. The attribute `substeps` is
the number of simulation steps that the effect requires. With this number of steps, the motor speed
agrees with an independent solution to 1e-5 of its rms value, or to 1e-3 for stick-slip friction.
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
    """Location of a number in the engine: name of the field, name of the object, and column."""

    field: str
    owner: str
    column: int | None = None


class Nonlinearity(Config):
    """A scenario table that adds a nonlinear effect to the plant.

    Attributes
    ----------
    exact : bool
        Whether the linear model describes the effect exactly (False for all nonlinear effects).
    substeps : int
        Number of simulation steps per 5 ms that the effect requires.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS

    def build(self, spec: Any) -> None:
        """Add the effect to an `MjSpec`."""
        raise NotImplementedError

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the effect that records contain, keyed by name."""
        return {}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the numbers in the engine that represent the parameters `law`, keyed by place.

        The dictionary is empty if the parameters cannot change during a run.
        """
        return {}


def substeps(features: Iterable[Nonlinearity], period: float, *, least: int = 1) -> int:
    """Return the number of simulation steps per `period` [s] that all features together require.

    The argument `least` is a lower limit of the number of steps per 5 ms.

    Examples
    --------
    >>> [substeps([], period) for period in (0.001, 0.0025, 0.005, 0.01)]
    [1, 3, 5, 10]
    """
    finest = max([LINEAR_SUBSTEPS, least, *(feature.substeps for feature in features)])
    return math.ceil(finest * period / SPAN - 1e-9)


class CoggingConfig(Nonlinearity):
    """Cogging of the motor, which is a torque amplitude · sin(poles · φ_m) due to the magnets.

    Attributes
    ----------
    amplitude : float
        Amplitude of the cogging torque [N m].
    poles : int
        Number of cogging periods per revolution of the motor.
    """

    amplitude: Positive
    poles: int = Field(ge=1, le=500)

    def build(self, spec: Any) -> None:
        """Add the effect to an `MjSpec`."""
        passive(spec, "cogging", cogging=[self.amplitude, self.poles, 0.0])

    def in_words(self) -> str:
        """Return a description of the effect, for messages and tables."""
        return f"cogging of {self.amplitude:g} N m, {self.poles} periods per revolution"


class BacklashConfig(Nonlinearity):
    """Backlash between the motor and the gear.

    Attributes
    ----------
    gear : float
        Width of the gap in which the gear spring exerts no torque [rad on the arm side]. The damper
        of the gear also acts in the gap.
    """

    substeps: ClassVar[int] = 20
    gear: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to an `MjSpec`."""
        spec.tendon("gear").springlength = [-self.gear / 2, self.gear / 2]

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the effect, keyed by name."""
        return {"gap": self.gear}

    def in_words(self) -> str:
        """Return a description of the effect, for messages and tables."""
        return f"backlash of {self.gear:g} rad at the gear"


class StiffeningConfig(Nonlinearity):
    """A gear spring that stiffens with its twist x; its torque is k_g (x + gear · x³).

    Both terms of the torque are proportional to k_g, so a fault of k_g changes both terms by the
    same factor.

    Attributes
    ----------
    gear : float
        Ratio of the cubic coefficient to the linear coefficient [1/rad² on the arm side].
    """

    gear: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to an `MjSpec`."""
        spring = spec.tendon("gear")
        spring.stiffness = [spring.stiffness[0], 0.0, self.gear * spring.stiffness[0]]

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the effect, keyed by name."""
        return {"kappa": self.gear}

    def in_words(self) -> str:
        """Return a description of the effect, for messages and tables."""
        return f"gear spring stiffening by {self.gear:g}/rad²"


class SaturationConfig(Nonlinearity):
    """A torque limit of the drive; the log contains the torque command before the limit acts.

    Attributes
    ----------
    torque : float
        Limit of the absolute value of the command [N m]. The torque constant k_T multiplies the
        limited command.
    """

    torque: Positive

    def build(self, spec: Any) -> None:
        """Add the effect to an `MjSpec`."""
        spec.actuator("motor").forcerange = [-self.torque, self.torque]

    def in_words(self) -> str:
        """Return a description of the effect, for messages and tables."""
        return f"torque limited to {self.torque:g} N m"


def passive(spec: Any, name: str, **law: list[float]) -> None:
    """Add a DC motor without current to the motor joint.

    The engine's DC motor implements LuGre friction and cogging. The keyword arguments `law` contain
    the parameters of these effects.
    """
    motor = spec.add_actuator(name=name, target="motor")
    motor.trntype = spec.actuator("motor").trntype
    motor.set_to_dcmotor(motorconst=[0.0, 0.0], resistance=1.0, ctrlspec=_NO_INPUT, **law)
