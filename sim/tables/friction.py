r"""Friction laws of the motor; each class is a table of a scenario.

MuJoCo has Coulomb and LuGre friction. The other laws are compiled callbacks
(`sim/plant/friction.py`); their tables contain the law itself as a plain function, `torque`. To add
a law, write a table here, add its name to `COMPILED_LAWS` and add a key to `Scenario`. These laws
use :math:`\tanh(v/v_0)` in place of the sign of the speed v, with the key `smooth` for v₀, so the
motor creeps instead of sticking.
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
"""First number of each row of parameters, which marks the row as ours."""

WIDTH = 12
"""Length of a row: mark, index of the law in `COMPILED_LAWS`, and up to ten parameters."""

Row = Sequence[float]


class _CompiledLaw(Nonlinearity):
    """A law that the engine calls as a callback, with its values in a row of custom data."""

    substeps: ClassVar[int] = 20  # the speed can change sign within 1 ms; error 6e-5 in the loop
    parameters: ClassVar[tuple[str, ...]]
    """Keys that are parameters of a law in a record."""

    def build(self, spec: Any) -> None:
        """Add the law to an `MjSpec`."""
        code = float(COMPILED_LAWS.index(type(self)))
        row = [MARK, code, *map(float, self.model_dump().values())]
        spec.add_numeric(name=type(self).__name__, size=WIDTH, data=row)

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the law by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the engine's numbers for these parameters, by their place in the engine."""
        keys, owner = [*type(self).model_fields], type(self).__name__
        at = {name: Place("numeric_data", owner, 2 + keys.index(name)) for name in law}
        return {at[name]: value for name, value in law.items()}


class FrictionConfig(Nonlinearity):
    """Coulomb friction of the motor, independent of the magnitude of its speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction [N m]; it opposes the motion and holds a resting motor up to this torque.
    """

    substeps: ClassVar[int] = 20  # a switch is located to within one step; error 7e-4
    coulomb: Positive

    def build(self, spec: Any) -> None:
        """Add the law to an `MjSpec`."""
        motor = spec.joint("motor")
        motor.frictionloss = self.coulomb
        # the engine's friction is soft by default, which gives errors of 50 % here
        motor.solref_friction, motor.solimp_friction[:3] = [1e-6, 1.0], [0.9999, 0.9999, 0.001]

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the law by name."""
        return {"f_c": self.coulomb}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the engine's numbers for these parameters, by their place in the engine."""
        return {Place("dof_frictionloss", "motor"): law["f_c"]}

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"Coulomb friction of {self.coulomb:g} N m"


class LuGreConfig(Nonlinearity):
    r"""LuGre friction of the motor: bristles that bend, stick and slip.

    With the deflection z of the bristles and the motor speed v, the friction torque is

    .. math::

        F = \sigma_0 z + \sigma_1 \dot z, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
        g(v) = F_c + (F_s - F_c) e^{-(v/v_s)^2}

    (Canudas de Wit et al., IEEE Trans. AC 40, 1995, 419-425). f_m is the viscous part.

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

    substeps: ClassVar[int] = 10  # the engine integrates bristles to first order; error 7e-4
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
        """Add the law to an `MjSpec`."""
        law = [self.stiffness, self.damping, self.coulomb, self.static, self.stribeck]
        passive(spec, "lugre", lugre=law)

    @property
    def law(self) -> dict[str, float]:
        """Parameters of the law by name; f_s is the excess of the breakaway torque over f_c."""
        return {
            "f_c": self.coulomb,
            "f_s": self.static - self.coulomb,
            "v_s": self.stribeck,
            "sigma_0": self.stiffness,
            "sigma_1": self.damping,
        }

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the engine's numbers for these parameters, by their place in the engine."""
        return {
            Place("actuator_biasprm", "lugre", 3): law["f_c"],
            Place("actuator_biasprm", "lugre", 4): law["f_c"] + law["f_s"],
            Place("actuator_biasprm", "lugre", 5): law["v_s"],
            Place("actuator_dynprm", "lugre", 5): law["sigma_0"],
            Place("actuator_dynprm", "lugre", 6): law["sigma_1"],
        }

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"LuGre friction of {self.coulomb:g} N m, {self.static:g} N m to break away"


class StaticFrictionConfig(_CompiledLaw):
    r"""A static friction curve with a peak at low speed.

    .. math:: \tau = (F_c + F_{cs} / \cosh(\alpha v)) \tanh(\beta v)

    (E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot
    model*, SYSID 2006). f_m is the viscous part.

    Attributes
    ----------
    f_c : float
        Coulomb torque F_c at high speed [N m].
    f_s : float
        Excess torque F_cs at low speed [N m].
    alpha : float
        Inverse α of the speed at which the excess decays [s/rad].
    beta : float
        Inverse β of the speed at which the friction builds up [s/rad].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c", "f_s", "alpha", "beta")
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque, positive against the motion [N m]."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"a friction curve with F_c = {self.f_c:.3g} N m, F_cs = {self.f_s:.3g} N m"


class LoadFrictionConfig(_CompiledLaw):
    r"""Dry friction that grows with the torque transmitted by the gear.

    .. math:: \tau = (f_c + \mu |\tau_g|) \tanh(v/v_0)

    with the torque of the gear spring on the motor side, :math:`\tau_g = r k_g x_1` on the linear
    axis.

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
        """Return the friction torque, positive against the motion [N m]."""
        return (row[2] + row[3] * abs(load)) * math.tanh(speed / row[4])

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"dry friction of {self.f_c:g} N m and {100 * self.load:g} % of the load"


class GearFrictionConfig(_CompiledLaw):
    r"""Friction of a geared drive, partly proportional to the torques at the gear.

    .. math::

        \tau = [f_c + |\mu_e \tau_g - \mu_m u|
                + (f_s + |\mu_{es} \tau_g - \mu_{ms} u|) e^{-|v/v_s|^\alpha}] \tanh(v/v_0)

    with the motor torque u and the torque τ_g of the gear spring on the motor. This is model M5 of
    M. Duclusaud, G. Passault, V. Padois and O. Ly, *Extended friction models for the physics
    simulation of servo actuators*, arXiv:2410.08650, with tanh in place of the sign. f_m is the
    viscous part. Because u and τ_g have separate coefficients, the friction of a driving motor
    differs from that of a driven one.

    Attributes
    ----------
    f_c, f_s : float
        Coulomb torque at high speed and excess at low speed, both without load [N m].
    motor, external : float
        Ratios μ_m and μ_e of friction torque to motor torque and to spring torque.
    motor_slow, external_slow : float
        The same ratios μ_ms and μ_es for the excess at low speed.
    v_s : float
        Stribeck speed at which the excess decays [rad/s].
    alpha : float
        Exponent of the decay.
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
        """Return the friction torque, positive against the motion [N m]."""
        fast = row[2] + abs(row[5] * load - row[4] * motor)
        slow = row[3] + abs(row[7] * load - row[6] * motor)
        left = math.exp(-(abs(speed / row[8]) ** row[9]))
        return (fast + slow * left) * math.tanh(speed / row[10])

    def in_words(self) -> str:
        """Return the law and its size in words."""
        dry = f"{self.f_c:.2g} N m ({self.f_c + self.f_s:.2g} at low speed)"
        shares = f"{100 * self.motor:.2g} % of the motor's torque, {100 * self.external:.2g} %"
        return f"gear friction of {dry}, {shares} of the load"


COMPILED_LAWS: tuple[Any, ...] = (
    StaticFrictionConfig,
    LoadFrictionConfig,
    GearFrictionConfig,
)
"""Laws that are compiled as callbacks; a row refers to its law by the index in this tuple."""
