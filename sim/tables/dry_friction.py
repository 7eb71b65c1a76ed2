"""Dry friction of the motor, which the engine has, a table of a scenario each: Coulomb and LuGre.

Built in as `flexaxis.sim.tables.nonlinear` says; laws that the engine lacks are in
`flexaxis.sim.tables.smooth_friction`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import model_validator

from flexaxis.sim.tables.config import Config, Positive
from flexaxis.sim.tables.nonlinear import passive
from flexaxis.sim.tables.places import Place


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
        """Return what it is and how large."""
        return f"LuGre friction of {self.coulomb:g} N m, {self.static:g} N m to break away"
