r"""Friction laws of the motor; each class is a table of a scenario.

MuJoCo has Coulomb and LuGre friction. The other laws are compiled callbacks
(`sim/plant/friction.py`): such a table has its keys and the law itself (`torque`), a plain
function. To add one, write a table here, put its name into `COMPILED_LAWS` and add a key to
`Scenario`. These laws use :math:`\tanh(v/v_0)` in place of the sign of the speed v, with the key
`smooth` for v₀, so the motor creeps instead of sticking.
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
"""First number of a row, by which it is known to be ours."""

WIDTH = 12
"""Numbers in a row: mark, number of the law in `COMPILED_LAWS`, and up to ten parameters."""

Row = Sequence[float]


class _CompiledLaw(Nonlinearity):
    """A law that the engine calls, with its values in a row of custom data."""

    substeps: ClassVar[int] = 20  # a sign comes and goes within a millisecond: 6e-5 in the loop
    parameters: ClassVar[tuple[str, ...]]
    """Those of its keys that are parameters of a law."""

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        code = float(COMPILED_LAWS.index(type(self)))
        row = [MARK, code, *map(float, self.model_dump().values())]
        spec.add_numeric(name=type(self).__name__, size=WIDTH, data=row)

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps the parameters of its law, and as what."""
        keys, owner = [*type(self).model_fields], type(self).__name__
        at = {name: Place("numeric_data", owner, 2 + keys.index(name)) for name in law}
        return {at[name]: value for name, value in law.items()}


class FrictionConfig(Nonlinearity):
    """Friction of the motor that does not depend on the size of its speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction [N m]; it opposes the motion, and holds the motor up to that torque.
    """

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
        """Return the law and its size in words."""
        return f"Coulomb friction of {self.coulomb:g} N m"


class LuGreConfig(Nonlinearity):
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
        passive(spec, "lugre", lugre=law)

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
        """Return the law and its size in words."""
        return f"LuGre friction of {self.coulomb:g} N m, {self.static:g} N m to break away"


class StaticFrictionConfig(_CompiledLaw):
    r"""A static curve of friction, with its peak before the motor slides.

    .. math:: \tau = (F_c + F_{cs} / \cosh(\alpha v)) \tanh(\beta v)

    (E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot
    model*, SYSID 2006); its viscous part is f_m.

    Attributes
    ----------
    f_c : float
        F_c, the torque of fast sliding [N m].
    f_s : float
        F_cs, the excess at low speed [N m].
    alpha : float
        α, the inverse of the speed at which the excess has gone [s/rad].
    beta : float
        β, the inverse of the speed at which sliding begins [s/rad].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c", "f_s", "alpha", "beta")
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the torque against the motion [N m]."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"a friction curve with F_c = {self.f_c:.3g} N m, F_cs = {self.f_s:.3g} N m"


class LoadFrictionConfig(_CompiledLaw):
    r"""Dry friction that grows with the torque that the gear transmits.

    .. math:: \tau = (f_c + \mu |\tau_g|) \tanh(v/v_0)

    with the torque of the gear spring on the motor side, :math:`\tau_g = r k_g x_1` on the linear
    axis.

    Attributes
    ----------
    f_c : float
        Without load [N m].
    load : float
        μ, torque of friction over torque transmitted.
    smooth : float
        v₀ [rad/s].
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c",)
    f_c: Positive
    load: Positive
    smooth: Positive = 0.1

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the torque against the motion [N m]."""
        return (row[2] + row[3] * abs(load)) * math.tanh(speed / row[4])

    def in_words(self) -> str:
        """Return the law and its size in words."""
        return f"dry friction of {self.f_c:g} N m and {100 * self.load:g} % of the load"


class GearFrictionConfig(_CompiledLaw):
    r"""Friction of a geared drive, of which a part is a share of the torques at the gear.

    .. math::

        \tau = [f_c + |\mu_e \tau_g - \mu_m u|
                + (f_s + |\mu_{es} \tau_g - \mu_{ms} u|) e^{-|v/v_s|^\alpha}] \tanh(v/v_0)

    with the torque of the motor u and that of the gear spring on it, τ_g: model M5 of M. Duclusaud,
    G. Passault, V. Padois and O. Ly, *Extended friction models for the physics simulation of servo
    actuators*, arXiv:2410.08650, with tanh for the sign. Its viscous part is f_m. Driving and being
    driven differ, for u and τ_g have shares of their own.

    Attributes
    ----------
    f_c, f_s : float
        Without load: of fast sliding, and the excess at low speed [N m].
    motor, external : float
        μ_m and μ_e, torque of friction over the torque of motor and spring.
    motor_slow, external_slow : float
        μ_ms and μ_es, the same of the excess at low speed.
    v_s : float
        The speed at which the excess has gone [rad/s].
    alpha : float
        How suddenly it goes.
    smooth : float
        v₀ [rad/s].
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
        """Return the torque against the motion [N m]."""
        fast = row[2] + abs(row[5] * load - row[4] * motor)
        slow = row[3] + abs(row[7] * load - row[6] * motor)
        left = math.exp(-(abs(speed / row[8]) ** row[9]))
        return (fast + slow * left) * math.tanh(speed / row[10])

    def in_words(self) -> str:
        """Return the law and its size in words."""
        dry = f"{self.f_c:.2g} N m ({self.f_c + self.f_s:.2g} when slow)"
        shares = f"{100 * self.motor:.2g} % of the motor's torque, {100 * self.external:.2g} %"
        return f"gear friction of {dry}, {shares} of the load"


COMPILED_LAWS: tuple[Any, ...] = (
    StaticFrictionConfig,
    LoadFrictionConfig,
    GearFrictionConfig,
)
"""The laws that are compiled; a row names its law by the place in here."""
