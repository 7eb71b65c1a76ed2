r"""Laws of friction of the motor beyond the engine's, a table of a scenario each.

The engine knows none of them; `sim/passive.py` makes it call them. Beside its keys, a table has the
law itself (`torque`), a plain function that is compiled: a new one is a table here with its name in
`LAWS`, and a key of `Scenario`. None of them is dry in the strict sense: where a law has a sign of
the speed v, it is :math:`\tanh(v/v_0)` with the key `smooth` for v₀, so that the motor creeps
where it would stick.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, Field

from flexaxis.sim.config import Config, Positive
from flexaxis.sim.nonlinear import Place

MARK: float = struct.unpack("=d", b"flexaxis")[0]
"""First number of a row, by which it is known to be ours."""

WIDTH = 8
"""Numbers in a row: mark, number of the law in `LAWS`, and up to six parameters."""

_FIRST = 2  # of the parameters in a row

Row = Sequence[float]


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
    substeps: ClassVar[int] = 20  # sliding begins and ends within a millisecond
    f_c: Positive
    f_s: Positive
    alpha: Positive
    beta: Positive

    @staticmethod
    def torque(row: Row, speed: float, angle: float, load: float) -> float:
        """Return the torque against the motion [N m]."""
        peak = row[3] / math.cosh(row[4] * speed)
        return (row[2] + peak) * math.tanh(row[5] * speed)

    def build(self, spec: Any) -> None:
        """Build it into an `MjSpec`."""
        add_row(spec, self)

    @property
    def law(self) -> dict[str, float]:
        """Its parameters by name."""
        return self.model_dump()

    def kept(self, law: Mapping[str, Any]) -> dict[Place, Any]:
        """Return where the engine keeps the parameters of its law, and as what."""
        return row_places(self, law)

    def in_words(self) -> str:
        """Return what it is and how large."""
        return f"a friction curve of {self.f_c:g} N m, {self.f_s:g} N m more at low speed"


def add_row(spec: Any, table: BaseModel) -> None:
    """Write a law into an `MjSpec`, as a row of numbers."""
    row = [MARK, float(LAWS.index(type(table))), *map(float, table.model_dump().values())]
    spec.add_numeric(name=_row_name(table), size=WIDTH, data=row)


def row_places(table: BaseModel, law: Mapping[str, Any]) -> dict[Place, Any]:
    """Return where the engine keeps the parameters of a law in its row, and their values."""
    places = (Place("numeric_data", _row_name(table), _FIRST + i) for i in range(len(law)))
    return dict(zip(places, law.values(), strict=True))


def _row_name(table: BaseModel) -> str:
    return type(table).__name__


LAWS: tuple[Any, ...] = (StaticFrictionConfig,)
"""The laws that are compiled; a row names its law by the place in here."""
