"""What an axis has beyond the linear model, one table of a scenario each.

Every table knows how to build itself into MuJoCo's description of the plant (`build`), that the
linear model does not describe it (`exact`), and how finely time must then be cut (`substeps`):
such that the motor speed agrees with an independent solution to 1e-5 of its rms, and to 1e-3 where
friction sticks and slips.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from pydantic import Field, model_validator

from flexaxis.sim.tables.config import Config, Positive
from flexaxis.sim.tables.places import Place

SPAN = 0.005  # s, of which `substeps` says into how many steps it is cut
LINEAR_SUBSTEPS = 5
_NO_INPUT = 16  # MuJoCo's mjINPUT_NONE: an actuator without a command


@runtime_checkable
class Nonlinearity(Protocol):
    """A table of a scenario that is built into the plant: whatever has `build` is."""

    @property
    def substeps(self) -> int:
        """Steps of the engine that 5 ms need with it."""

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""


@runtime_checkable
class Law(Protocol):
    """A nonlinearity with parameters that can change in a run."""

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps parameters such as these, and as what."""


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


class FrictionConfig(Config):
    """Friction of the motor that does not depend on the size of its speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction [N m]; it opposes the motion, and holds the motor up to that torque.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = 20  # a switch is located to within a step: 7e-4 with these
    coulomb: Positive

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        motor = spec.joint("motor")
        motor.frictionloss = self.coulomb
        # the engine's friction is soft by default, which is wrong by half here
        motor.solref_friction, motor.solimp_friction[:3] = [1e-6, 1.0], [0.9999, 0.9999, 0.001]

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {"f_c": self.coulomb}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps the parameters of its law, and as what."""
        return {Place("dof_frictionloss", "motor"): law["f_c"]}

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"Coulomb friction of {self.coulomb:g} N m"


class LuGreConfig(Config):
    r"""LuGre friction of the motor: bristles that bend, stick and slip.

    With the deflection z of the bristles and the motor speed v, the friction torque is

    .. math::

        F = \sigma_0 z + \sigma_1 \dot z, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
        g(v) = F_c + (F_s - F_c) e^{-(v/v_s)^2}

    (Canudas de Wit et al., IEEE Trans. AC 40, 1995, 419-425); its viscous part is f_m.

    Attributes
    ----------
    stiffness : float
        σ₀ [N m/rad].
    damping : float
        σ₁ [N m s/rad].
    coulomb, static : float
        F_c and F_s, the torque of fast sliding and of breaking away [N m].
    stribeck : float
        v_s, the speed at which the second has given way to the first [rad/s].
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = 10  # the engine's bristles are of first order in the step: 7e-4
    stiffness: Positive
    damping: Positive
    coulomb: Positive
    static: Positive
    stribeck: Positive

    @model_validator(mode="after")
    def _breaking_away_is_harder(self) -> LuGreConfig:
        if self.static < self.coulomb:
            raise ValueError(
                f"static = {self.static:g} must be at least coulomb = {self.coulomb:g}"
            )
        return self

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        law = [self.stiffness, self.damping, self.coulomb, self.static, self.stribeck]
        _passive(spec, "lugre", lugre=law)

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name; f_s is what breaking away takes more than sliding."""
        return {
            "f_c": self.coulomb,
            "f_s": self.static - self.coulomb,
            "v_s": self.stribeck,
            "sigma_0": self.stiffness,
            "sigma_1": self.damping,
        }

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps the parameters of its law, and as what."""
        return {
            Place("actuator_biasprm", "lugre", 3): law["f_c"],
            Place("actuator_biasprm", "lugre", 4): law["f_c"] + law["f_s"],
            Place("actuator_biasprm", "lugre", 5): law["v_s"],
            Place("actuator_dynprm", "lugre", 5): law["sigma_0"],
            Place("actuator_dynprm", "lugre", 6): law["sigma_1"],
        }

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"LuGre friction of {self.coulomb:g} N m, {self.static:g} N m to break away"


class CoggingConfig(Config):
    """Cogging of the motor: a torque amplitude · sin(poles · φ_m) that the magnets add.

    Attributes
    ----------
    amplitude : float
        Largest torque [N m].
    poles : int
        Periods in one revolution of the motor.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS  # smooth
    amplitude: Positive
    poles: int = Field(ge=1, le=500)

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        _passive(spec, "cogging", cogging=[self.amplitude, self.poles, 0.0])

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"cogging of {self.amplitude:g} N m, {self.poles} periods a turn"


class BacklashConfig(Config):
    """Play between the motor and the gear.

    Attributes
    ----------
    gear : float
        Width of the gap [rad on the arm side] within which the gear spring has no force. The damper
        of the gear acts in the gap too.
    """

    exact: ClassVar[bool] = False
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
        """Return what it is and how large."""
        return f"backlash of {self.gear:g} rad at the gear"


class StiffeningConfig(Config):
    """A gear spring that stiffens with its twist x: torque k_g (x + gear · x³).

    The whole law is proportional to k_g, so that a fault of k_g weakens all of it.

    Attributes
    ----------
    gear : float
        Cubic coefficient over the linear one [1/rad² on the arm side].
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS
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
        """Return what it is and how large."""
        return f"gear spring stiffening by {self.gear:g}/rad²"


class SaturationConfig(Config):
    """A limit of the drive: it acts on ±torque at most, while the log has the command.

    Attributes
    ----------
    torque : float
        Largest size of the command that acts [N m]; k_T multiplies what is left.
    """

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = LINEAR_SUBSTEPS
    torque: Positive

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        spec.actuator("motor").forcerange = [-self.torque, self.torque]

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"torque limited to {self.torque:g} N m"


def _passive(spec: Any, name: str, **law: list[float]) -> None:
    """Add an electric motor without current to the motor joint, for the friction it can have."""
    motor = spec.add_actuator(name=name, target="motor")
    motor.trntype = spec.actuator("motor").trntype
    motor.set_to_dcmotor(motorconst=[0.0, 0.0], resistance=1.0, ctrlspec=_NO_INPUT, **law)
