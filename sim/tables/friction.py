r"""Define the motor friction laws; each class defines a table of a scenario.

MuJoCo implements Coulomb and LuGre friction. A compiled callback (`sim/plant/callback.py`) computes
the other friction laws. The static method `torque` of a class defines a compiled friction law. To
add a friction law, write a class in this module, add the class to `COMPILED_LAWS` and add a key to
`Scenario`. The compiled friction laws use a smooth function such as :math:`\tanh(v/v_0)` instead of
the sign of the speed v, so the motor creeps instead of sticking. The scenario key `smooth` sets the
speed v₀.
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
"""First number of each row of friction parameters, which identifies the row in a MuJoCo model."""

WIDTH = 12
"""Length of a row of friction parameters: a mark, a friction-law index and up to ten values."""

Row = Sequence[float]


class _CompiledLaw(Nonlinearity):
    """Base class of friction laws that the compiled callback computes from a row of parameters."""

    substeps: ClassVar[int] = 20  # the speed can change sign within 1 ms; the error is 6e-5
    parameters: ClassVar[tuple[str, ...]]
    """Scenario-table keys whose values a record contains as parameters."""

    def build(self, spec: Any) -> None:
        """Add the friction law to a MuJoCo model specification (`MjSpec`)."""
        code = float(COMPILED_LAWS.index(type(self)))
        row = [MARK, code, *map(float, self.model_dump().values())]
        spec.add_numeric(name=type(self).__name__, size=WIDTH, data=row)

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the friction law, keyed by name."""
        return {name: getattr(self, name) for name in self.parameters}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the MuJoCo values of the parameters in `law`, keyed by location in the model."""
        keys, owner = [*type(self).model_fields], type(self).__name__
        at = {name: Place("numeric_data", owner, 2 + keys.index(name)) for name in law}
        return {at[name]: value for name, value in law.items()}


class FrictionConfig(Nonlinearity):
    """Coulomb friction of the motor, which depends only on the sign of the motor speed.

    Attributes
    ----------
    coulomb : float
        Coulomb friction torque [N m]. The friction torque opposes the motor motion. If the motor is
        at rest, friction prevents motion until another torque exceeds the Coulomb friction torque.
    """

    substeps: ClassVar[int] = 20  # a reversal is located to within one step; the error is 7e-4
    coulomb: Positive

    def build(self, spec: Any) -> None:
        """Add the friction law to a MuJoCo model specification (`MjSpec`)."""
        motor = spec.joint("motor")
        motor.frictionloss = self.coulomb
        # the engine's default friction is soft, which would cause errors of 50 %
        motor.solref_friction, motor.solimp_friction[:3] = [1e-6, 1.0], [0.9999, 0.9999, 0.001]

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the friction law, keyed by name."""
        return {"f_c": self.coulomb}

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the MuJoCo values of the parameters in `law`, keyed by location in the model."""
        return {Place("dof_frictionloss", "motor"): law["f_c"]}

    def in_words(self) -> str:
        """Return a short description of the friction law."""
        return f"Coulomb friction of {self.coulomb:g} N m"


class LuGreConfig(Nonlinearity):
    r"""LuGre friction of the motor, which models friction as the deflection of elastic bristles.

    With the bristle deflection z and the motor speed v, the friction torque is

    .. math::

        F = \sigma_0 z + \sigma_1 \dot z, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
        g(v) = F_c + (F_s - F_c) e^{-(v/v_s)^2}

    (Canudas de Wit et al., IEEE Transactions on Automatic Control 40, 1995, 419-425). The axis
    parameter f_m adds viscous friction.

    Attributes
    ----------
    stiffness : float
        Stiffness σ₀ of the bristles [N m/rad].
    damping : float
        Damping coefficient σ₁ of the bristles [N m s/rad].
    coulomb, static : float
        Coulomb torque F_c at high speed and breakaway torque F_s [N m].
    stribeck : float
        Stribeck speed v_s, around which the friction torque decreases from F_s to F_c [rad/s].
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
                f"static = {self.static:g} must not be less than coulomb = {self.coulomb:g}"
            )
        return self

    def build(self, spec: Any) -> None:
        """Add the friction law to a MuJoCo model specification (`MjSpec`)."""
        law = [self.stiffness, self.damping, self.coulomb, self.static, self.stribeck]
        passive(spec, "lugre", lugre=law)

    @property
    def law(self) -> dict[str, float]:
        """Parameter values of the friction law, keyed by name."""
        return {
            "f_c": self.coulomb,
            "f_s": self.static - self.coulomb,
            "v_s": self.stribeck,
            "sigma_0": self.stiffness,
            "sigma_1": self.damping,
        }

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return the MuJoCo values of the parameters in `law`, keyed by location in the model."""
        return {
            Place("actuator_biasprm", "lugre", 3): law["f_c"],
            Place("actuator_biasprm", "lugre", 4): law["f_c"] + law["f_s"],
            Place("actuator_biasprm", "lugre", 5): law["v_s"],
            Place("actuator_dynprm", "lugre", 5): law["sigma_0"],
            Place("actuator_dynprm", "lugre", 6): law["sigma_1"],
        }

    def in_words(self) -> str:
        """Return a short description of the friction law."""
        return f"LuGre friction of {self.coulomb:g} N m, breakaway torque {self.static:g} N m"


class StaticFrictionConfig(_CompiledLaw):
    r"""Static friction curve with a peak at low motor speed.

    .. math:: \tau = (F_c + F_{cs} / \cosh(\alpha v)) \tanh(\beta v)

    (Wernholt and Gunnarsson, *Nonlinear identification of a physically parameterized robot
    model*, SYSID 2006). The axis parameter f_m adds viscous friction.

    Attributes
    ----------
    f_c : float
        Coulomb torque F_c at high speed [N m].
    f_s : float
        Additional friction torque F_cs at low speed [N m].
    alpha : float
        Inverse speed α [s/rad]. Above the speed 1/α, the additional friction torque decays.
    beta : float
        Inverse speed β [s/rad]. The friction torque builds up between standstill and a speed of
        about 1/β.
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c", "f_s", "alpha", "beta")
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque [N m], which is positive if it opposes a positive `speed`."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    def in_words(self) -> str:
        """Return a short description of the friction law."""
        return f"a friction curve with F_c = {self.f_c:.3g} N m, F_cs = {self.f_s:.3g} N m"


class LoadFrictionConfig(_CompiledLaw):
    r"""Dry friction that increases with the torque transmitted by the gear.

    .. math:: \tau = (f_c + \mu |\tau_g|) \tanh(v/v_0)

    The gear spring torque on the motor side is :math:`\tau_g`. For a linear gear spring,
    :math:`\tau_g = r k_g x_1`.

    Attributes
    ----------
    f_c : float
        Friction torque without load [N m].
    load : float
        Ratio μ of load-dependent friction torque to transmitted torque.
    smooth : float
        Speed v₀ [rad/s], below which a smooth function replaces the sign of the motor speed.
    """

    parameters: ClassVar[tuple[str, ...]] = ("f_c",)
    f_c: Positive
    load: Positive
    smooth: Positive = 0.1

    @staticmethod
    def torque(row: Row, speed: float, load: float, motor: float) -> float:
        """Return the friction torque [N m], which is positive if it opposes a positive `speed`."""
        return (row[2] + row[3] * abs(load)) * math.tanh(speed / row[4])

    def in_words(self) -> str:
        """Return a short description of the friction law."""
        return f"dry friction of {self.f_c:g} N m plus {100 * self.load:g} % of the gear torque"


class GearFrictionConfig(_CompiledLaw):
    r"""Friction of a geared drive, which depends on the motor torque and the gear torque.

    .. math::

        \tau = [f_c + |\mu_e \tau_g - \mu_m u|
                + (f_s + |\mu_{es} \tau_g - \mu_{ms} u|) e^{-|v/v_s|^\alpha}] \tanh(v/v_0)

    In this equation, u is the motor torque and τ_g is the gear spring torque on the motor side. The
    friction law is model M5 of Duclusaud et al. (arXiv:2410.08650), with tanh instead of the sign
    function. The axis parameter f_m adds viscous friction. The motor torque and the gear torque
    have separate coefficients. Therefore the friction depends on whether the motor drives the load
    or the load drives the motor.

    Attributes
    ----------
    f_c, f_s : float
        Coulomb torque at high speed, and additional friction torque at low speed [N m]. Both values
        apply to a drive without load.
    motor, external : float
        Coefficients of the friction at all speeds: μ_m for the motor torque, and μ_e for the gear
        torque.
    motor_slow, external_slow : float
        Coefficients of the additional friction at low speed: μ_ms for the motor torque, and μ_es
        for the gear torque.
    v_s : float
        Stribeck speed, above which the additional friction decays [rad/s].
    alpha : float
        Exponent α in the decay of the additional friction.
    smooth : float
        Speed v₀ [rad/s], below which a smooth function replaces the sign of the motor speed.
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
        """Return the friction torque [N m], which is positive if it opposes a positive `speed`."""
        fast = row[2] + abs(row[5] * load - row[4] * motor)
        slow = row[3] + abs(row[7] * load - row[6] * motor)
        left = math.exp(-(abs(speed / row[8]) ** row[9]))
        return (fast + slow * left) * math.tanh(speed / row[10])

    def in_words(self) -> str:
        """Return a short description of the friction law."""
        dry = f"{self.f_c:.2g} N m ({self.f_c + self.f_s:.2g} at low speed)"
        shares = f"{100 * self.motor:.2g} % of the motor torque, {100 * self.external:.2g} %"
        return f"gear friction of {dry}, {shares} of the gear torque"


COMPILED_LAWS: tuple[Any, ...] = (
    StaticFrictionConfig,
    LoadFrictionConfig,
    GearFrictionConfig,
)
"""Compiled friction laws; a row of friction parameters contains an index into this tuple."""
