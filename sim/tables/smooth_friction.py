r"""Laws of friction of the motor beyond the engine's, a table of a scenario each.

The engine knows none of them; `sim/plant/passive.py` makes it call them. Beside its keys, a table
has the law itself (`torque`), a plain function that is compiled: a new one is a table here with its
name in `COMPILED_LAWS`, and a key of `Scenario`. None of them is dry in the strict sense: where a
law has a sign of the speed v, it is :math:`\tanh(v/v_0)` with the key `smooth` for v₀, so that the
motor creeps where it would stick.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, Field

from flexaxis.sim.tables.config import Config, NotNegative, Positive
from flexaxis.sim.tables.places import Place

MARK: float = struct.unpack("=d", b"flexaxis")[0]
"""First number of a row, by which it is known to be ours."""

WIDTH = 12
"""Numbers in a row: mark, number of the law in `COMPILED_LAWS`, and up to ten parameters."""

_FIRST = 2  # of the parameters in a row

Row = Sequence[float]


def add_row(table: BaseModel, spec: Any) -> None:
    """Build a law into an `MjSpec`, as a row of numbers."""
    row = [MARK, float(COMPILED_LAWS.index(type(table))), *map(float, table.model_dump().values())]
    spec.add_numeric(name=_row_name(table), size=WIDTH, data=row)


def row_places(table: BaseModel, law: Mapping[str, Any]) -> dict[Place, Any]:
    """Return where the engine keeps parameters of a law in its row, and as what."""
    place = {name: _FIRST + i for i, name in enumerate(type(table).model_fields)}
    return {Place("numeric_data", _row_name(table), place[n]): value for n, value in law.items()}


def _row_name(table: BaseModel) -> str:
    return type(table).__name__


class StaticFrictionConfig(Config):
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

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = 20  # sliding begins and ends within a millisecond: 6e-5 in the loop
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, angle: float, load: float, motor: float) -> float:
        """Return the torque against the motion [N m]."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    build: ClassVar[Any] = add_row
    kept: ClassVar[Any] = row_places

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return self.model_dump()

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"a friction curve with F_c = {self.f_c:.3g} N m, F_cs = {self.f_s:.3g} N m"


class LoadFrictionConfig(Config):
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

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = 20
    f_c: Positive
    load: Positive
    smooth: Positive = 0.1

    @staticmethod
    def torque(row: Row, speed: float, angle: float, load: float, motor: float) -> float:
        """Return the torque against the motion [N m]."""
        return (row[2] + row[3] * abs(load)) * math.tanh(speed / row[4])

    build: ClassVar[Any] = add_row
    kept: ClassVar[Any] = row_places

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {"f_c": self.f_c}

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"dry friction of {self.f_c:g} N m and {100 * self.load:g} % of the load"


class GearFrictionConfig(Config):
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

    exact: ClassVar[bool] = False
    substeps: ClassVar[int] = 20
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
    def torque(row: Row, speed: float, angle: float, load: float, motor: float) -> float:
        """Return the torque against the motion [N m]."""
        fast = row[2] + abs(row[5] * load - row[4] * motor)
        slow = row[3] + abs(row[7] * load - row[6] * motor)
        left = math.exp(-(abs(speed / row[8]) ** row[9]))
        return (fast + slow * left) * math.tanh(speed / row[10])

    build: ClassVar[Any] = add_row
    kept: ClassVar[Any] = row_places

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return {"f_c": self.f_c, "f_s": self.f_s, "v_s": self.v_s}

    def in_words(self) -> str:
        """Return what it is and how large."""
        dry = f"{self.f_c:.2g} N m ({self.f_c + self.f_s:.2g} when slow)"
        shares = f"{100 * self.motor:.2g} % of the motor's torque, {100 * self.external:.2g} %"
        return f"gear friction of {dry}, {shares} of the load"


COMPILED_LAWS: tuple[Any, ...] = (StaticFrictionConfig, LoadFrictionConfig, GearFrictionConfig)
"""The laws that are compiled; a row names its law by the place in here."""
