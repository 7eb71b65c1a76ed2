"""The same physics in other units: the paper's model with its formulas edited, and its signals."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acceptance.axes import NAMES, Run
from flexaxis.estimators import Model, three_mass


@dataclass(frozen=True)
class Units:
    """
    A change of units.

    Attributes
    ----------
    name : str
    factors : mapping
        Number in the new unit over that in the old one, of each parameter that has a new unit.
    output : float
        The same of y.
    reversed : bool
        Whether the torque counts the other way, so that k_T is negative.
    """

    name: str
    factors: Mapping[str, float] = field(default_factory=dict)
    output: float = 1.0
    reversed: bool = False

    def model(self, q: Mapping[str, float]) -> Model:
        """The three-mass model of the axis q, given in SI, in these units."""
        base = three_mass(q)
        signs = {"k_T": -1.0} if self.reversed else {}
        return replace(
            base,
            A=[[self._formula(entry) for entry in row] for row in base.A],
            B=[self._formula(entry) for entry in base.B],
            C=[f"{self.output!r}" if entry == "1" else entry for entry in base.C],
            nominal={
                name: value * self.factors.get(name, 1.0) * signs.get(name, 1.0)
                for name, value in q.items()
            },
        )

    def _formula(self, entry: str) -> str:
        for name, factor in self.factors.items():
            entry = re.sub(rf"\b{name}\b", f"({name}/{factor!r})", entry)
        return entry

    def torque(self, u: np.ndarray) -> np.ndarray:
        return -u if self.reversed else u

    def signals(self, run: Run) -> tuple[np.ndarray, np.ndarray]:
        return self.torque(run.u), run.y * self.output

    def theta(self, names: Sequence[str] = NAMES) -> np.ndarray:
        """What θ is multiplied by."""
        factors = []
        for name in names:
            factor = self.factors.get(name.removeprefix("1/"), 1.0)
            sign = -1.0 if self.reversed and name == "k_T" else 1.0
            factors.append(sign / factor if name.startswith("1/") else sign * factor)
        return np.array(factors)


SI = Units("SI")
CHANGES = (
    Units("f_m in mN m s/rad", {"f_m": 1e3}),
    Units("y in mrad/s", output=1e3),
    Units("inertia in g m²", {"J_m": 1e3, "J_g": 1e3, "J_a": 1e3}),
    Units("k_T negative", reversed=True),
)
