"""Dry friction of the live axis: its kinds, and their parameters as sliders turn them."""

from __future__ import annotations

from dataclasses import dataclass

from flexaxis.sim.errors import FlexaxisError, unknown

KINDS = ("none", "Coulomb", "static curve", "LuGre")
"""What can be had: a torque f_c against the motion, one that is larger at low speed, bristles."""

LIMITS = {"f_c": (0.01, 0.4), "f_s": (0.0, 0.4), "v_s": (0.2, 5.0)}
"""Least and largest value [N m, N m, rad/s]; the torque of the loop has an rms of 0.85 N m."""

UNITS = {"f_c": "N m", "f_s": "N m", "v_s": "rad/s"}

BEGINS = 5.0
"""β of the static curve [s/rad]: sliding begins at 0.2 rad/s, a twentieth of the rms of speed."""

BRISTLES = {"stiffness": 100.0, "damping": 0.3}
"""σ₀ [N m/rad] and σ₁ [N m s/rad] of LuGre friction, as in the catalogue."""


@dataclass(frozen=True)
class Friction:
    """A law of friction beside the viscous one.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    f_c, f_s : float
        Level of fast sliding, and what slow motion takes more [N m].
    v_s : float
        Speed above which that excess has gone [rad/s].

    Raises
    ------
    FlexaxisError
        If there is no such kind, or a value is not within `LIMITS`.
    """

    kind: str = "none"
    f_c: float = 0.1
    f_s: float = 0.1
    v_s: float = 0.5

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise FlexaxisError(unknown("friction", self.kind, KINDS))
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise FlexaxisError(
                    f"{name} = {value:g}: give from {low:g} to {high:g} {UNITS[name]}"
                )

    @property
    def knobs(self) -> tuple[str, ...]:
        """Which of its values mean something for this kind."""
        return {"none": (), "Coulomb": ("f_c",)}.get(self.kind, tuple(LIMITS))

    @property
    def level(self) -> float:
        """The level f_c that acts [N m], zero without friction."""
        return self.f_c if self.knobs else 0.0

    def acts_as(self, other: Friction) -> bool:
        """Return whether no motion could tell it from another one."""
        same = [getattr(self, name) == getattr(other, name) for name in self.knobs]
        return self.kind == other.kind and all(same)

    def tables(self) -> dict[str, dict[str, float]]:
        """Return it as tables of a scenario."""
        f_c, f_s, v_s = self.f_c, self.f_s, self.v_s
        curve = {"f_c": f_c, "f_s": max(f_s, 1e-9), "alpha": 1 / v_s, "beta": BEGINS}
        bristles = BRISTLES | {"coulomb": f_c, "static": f_c + f_s, "stribeck": v_s}
        return {
            "none": {},
            "Coulomb": {"friction": {"coulomb": f_c}},
            "static curve": {"static_friction": curve},
            "LuGre": {"lugre": bristles},
        }[self.kind]

    def in_words(self) -> str:
        """Return what it is and how large."""
        values = ", ".join(f"{name} {getattr(self, name):.3g} {UNITS[name]}" for name in self.knobs)
        return f"{self.kind} ({values})" if values else "no dry friction"
