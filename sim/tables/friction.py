r"""Define friction laws of the motor; each class is a table of a scenario.

MuJoCo implements Coulomb and LuGre friction. A compiled callback (`sim/plant/friction.py`) computes
the other laws; the static method `torque` of a class defines the law. To add a law, write a class
in this module, add the class to `COMPILED_LAWS` and add a key to `Scenario`. The compiled laws use
a smooth function such as :math:`\tanh(v/v_0)` instead of the sign of the speed v, so the motor
creeps instead of sticking. The key `smooth` is v₀.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator

from flexaxis.sim.tables.config import NotNegative, Positive
from flexaxis.sim.tables.nonlinear import Nonlinearity, Place, passive

MARK: float = struct.unpack("=d", b"flexaxis")[0]
"""First number of each parameter row, which distinguishes our rows from other custom numbers."""

WIDTH = 12
"""Length of a parameter row: the mark, the index of the law, and up to ten parameters."""

Row = Sequence[float]


class _CompiledLaw(Nonlinearity):
    """A friction law that the compiled callback computes from a row of custom numbers."""

    substeps: ClassVar[int] = 20  # the speed can change sign within 1 ms; the error is 6e-5
    parameters: ClassVar[tuple[str, ...]]
    """Keys of the table that are also parameters in a record."""

    def build(self, spec: Any) -> None:
        """Add the friction law to an `MjSpec`."""
        code = float(COMPILED_LAWS.index(type(self)))
        row = [MARK, code, *map(float, self.model_dump().values())]
        spec.add_numeric(name=type(self).__name__, size=WIDTH, data=row)

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the friction law, keyed by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the numbers in the engine that represent the parameters `law`, keyed by place."""
        keys, owner = [*type(self).model_fields], type(self).__name__
        at = {name: Place("numeric_data", owner, 2 + keys.index(name)) for name in law}
        return {at[name]: value for name, value in law.items()}


class FrictionConfig(Nonlinearity):
    """Coulomb friction of the motor, which does not depend on the magnitude of the speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction torque [N m]. The friction opposes the motion of a moving motor, and keeps
        a motor at rest against torques up to this value.
    """

    substeps: ClassVar[int] = 20  # a reversal is located to within one step; the error is 7e-4
    coulomb: Positive

    def build(self, spec: Any) -> None:
        """Add the friction law to an `MjSpec`."""
        motor = spec.joint("motor")
        motor.frictionloss = self.coulomb
        # the engine's default friction is soft, which would cause errors of 50 %
        motor.solref_friction, motor.solimp_friction[:3] = [1e-6, 1.0], [0.9999, 0.9999, 0.001]

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the friction law, keyed by name."""
        return {"f_c": self.coulomb}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the numbers in the engine that represent the parameters `law`, keyed by place."""
        return {Place("dof_frictionloss", "motor"): law["f_c"]}

    def in_words(self) -> str:
        """Return a description of the friction law, for messages and tables."""
        return f"Coulomb friction of {self.coulomb:g} N m"


class LuGreConfig(Nonlinearity):
    r"""LuGre friction of the motor: bristles that bend, stick and slip.

    If z is the deflection of the bristles and v is the motor speed, the friction torque is

    .. math::

        F = \sigma_0 z + \sigma_1 \dot z, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
        g(v) = F_c + (F_s - F_c) e^{-(v/v_s)^2}

    (Canudas de Wit et al., IEEE Trans. AC 40, 1995, 419-425). Viscous friction with the axis
    parameter f_m acts in addition.

    Attributes
    ----------
    stiffness : float
        Stiffness σ₀ of the bristles [N m/rad].
    damping : float
        Damping σ₁ of the bristles [N m s/rad].
    coulomb, static : float
        Coulomb torque F_c at high speed and breakaway torque F_s [N m].
    stribeck : float
        Stribeck speed v_s of the transition from F_s to F_c [rad/s].
    """

    substeps: ClassVar[int] = 10  # bristles are integrated to first order; the error is 7e-4
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
        """Add the friction law to an `MjSpec`."""
        law = [self.stiffness, self.damping, self.coulomb, self.static, self.stribeck]
        passive(spec, "lugre", lugre=law)

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the friction law, keyed by name; f_s is the breakaway torque minus f_c."""
        return {
            "f_c": self.coulomb,
            "f_s": self.static - self.coulomb,
            "v_s": self.stribeck,
            "sigma_0": self.stiffness,
            "sigma_1": self.damping,
        }

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the numbers in the engine that represent the parameters `law`, keyed by place."""
        return {
            Place("actuator_biasprm", "lugre", 3): law["f_c"],
            Place("actuator_biasprm", "lugre", 4): law["f_c"] + law["f_s"],
            Place("actuator_biasprm", "lugre", 5): law["v_s"],
            Place("actuator_dynprm", "lugre", 5): law["sigma_0"],
            Place("actuator_dynprm", "lugre", 6): law["sigma_1"],
        }

    def in_words(self) -> str:
        """Return a description of the friction law, for messages and tables."""
        return f"LuGre friction of {self.coulomb:g} N m, {self.static:g} N m to break away"


class StaticFrictionConfig(_CompiledLaw):
    r"""A static friction curve with a peak at low speed.

    .. math:: \tau = (F_c + F_{cs} / \cosh(\alpha v)) \tanh(\beta v)

    (E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot
    model*, SYSID 2006). Viscous friction with the axis parameter f_m acts in addition.

    Attributes
    ----------
    f_c : float
        Coulomb torque F_c at high speed [N m].
    f_s : float
        Additional torque F_cs at low speed [N m].
    alpha : float
        Inverse α of the speed above which the additional torque decays [s/rad].
    beta : float
        Inverse β of the speed within which the friction builds up [s/rad].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c", "f_s", "alpha", "beta")
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque [N m]; a positive torque opposes a positive speed."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    def in_words(self) -> str:
        """Return a description of the friction law, for messages and tables."""
        return f"a friction curve with F_c = {self.f_c:.3g} N m, F_cs = {self.f_s:.3g} N m"


class LoadFrictionConfig(_CompiledLaw):
    r"""Dry friction that grows with the torque that the gear transmits.

    .. math:: \tau = (f_c + \mu |\tau_g|) \tanh(v/v_0)

    Here :math:`\tau_g` is the torque of the gear spring on the motor side; if the spring is linear,
    :math:`\tau_g = r k_g x_1`.

    Attributes
    ----------
    f_c : float
        Friction torque without load [N m].
    load : float
        Ratio μ of friction torque to transmitted torque.
    smooth : float
        Speed v₀ below which the sign of the speed is smoothed [rad/s].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c",)
    f_c: Positive
    load: Positive
    smooth: Positive = 0.1

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque [N m]; a positive torque opposes a positive speed."""
        return (row[2] + row[3] * abs(load)) * math.tanh(speed / row[4])

    def in_words(self) -> str:
        """Return a description of the friction law, for messages and tables."""
        return f"dry friction of {self.f_c:g} N m and {100 * self.load:g} % of the load"


class GearFrictionConfig(_CompiledLaw):
    r"""Friction of a geared drive, which depends on the motor torque and on the gear torque.

    .. math::

        \tau = [f_c + |\mu_e \tau_g - \mu_m u|
                + (f_s + |\mu_{es} \tau_g - \mu_{ms} u|) e^{-|v/v_s|^\alpha}] \tanh(v/v_0)

    Here u is the motor torque, and τ_g is the torque of the gear spring on the motor side. The law
    is model M5 of M. Duclusaud, G. Passault, V. Padois and O. Ly, *Extended friction models for the
    physics simulation of servo actuators*, arXiv:2410.08650, with tanh instead of the sign. Viscous
    friction with the axis parameter f_m acts in addition. Because u and τ_g have separate
    coefficients, the friction depends on whether the motor drives the load or the load drives the
    motor.

    Attributes
    ----------
    f_c, f_s : float
        Coulomb torque at high speed and additional torque at low speed, without load [N m].
    motor, external : float
        Coefficients μ_m of the motor torque and μ_e of the spring torque.
    motor_slow, external_slow : float
        Coefficients μ_ms of the motor torque and μ_es of the spring torque for the additional
        friction at low speed.
    v_s : float
        Stribeck speed above which the additional friction decays [rad/s].
    alpha : float
        Exponent α of the decay.
    smooth : float
        Speed v₀ below which the sign of the speed is smoothed [rad/s].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c", "f_s", "v_s")
    f_c: NotNegative
    f_s: NotNegative
    motor: NotNegative
    external: NotNegative
    motor_slow: NotNegative
    external_slow: NotNegative
    v_s: Positive
    alpha: Annotated[float, Field(ge=0.5, le=10)]
    smooth: Positive = 0.05

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque [N m]; a positive torque opposes a positive speed."""
        fast = row[2] + abs(row[5] * load - row[4] * motor)
        slow = row[3] + abs(row[7] * load - row[6] * motor)
        left = math.exp(-(abs(speed / row[8]) ** row[9]))
        return (fast + slow * left) * math.tanh(speed / row[10])

    def in_words(self) -> str:
        """Return a description of the friction law, for messages and tables."""
        dry = f"{self.f_c:.2g} N m ({self.f_c + self.f_s:.2g} at low speed)"
        shares = f"{100 * self.motor:.2g} % of the motor torque, {100 * self.external:.2g} %"
        return f"gear friction of {dry}, {shares} of the load"


COMPILED_LAWS: tuple[Any, ...] = (
    StaticFrictionConfig,
    LoadFrictionConfig,
    GearFrictionConfig,
)
"""Laws that the compiled callback computes; a row selects its law by the index in this tuple."""
