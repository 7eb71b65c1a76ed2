"""A claim of the paper, the check that decides it, and the evidence that it is decided on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from flexaxis.experiments.paper.convergence import Convergence
from flexaxis.experiments.paper.data import Data
from flexaxis.experiments.paper.further_work import FurtherWork
from flexaxis.experiments.paper.offline import Offline

Measured = float | Mapping[str, float]
Decided = tuple[Measured, bool]
"""What was measured, and whether the claim holds."""


@dataclass(frozen=True)
class Evidence:
    """Everything that was simulated and estimated."""

    data: Data
    convergence: Convergence
    offline: Offline
    further: FurtherWork


@dataclass(frozen=True)
class Claim:
    """A checked claim, as it stands in claims.json.

    Attributes
    ----------
    id : str
    claim : str
        What is claimed, in a sentence.
    source : str
        Section, figure and equation of the paper.
    measured : float or mapping of str to float
    expected : str
        What was to be measured for the claim to hold.
    holds : bool
    """

    id: str
    claim: str
    source: str
    measured: Measured
    expected: str
    holds: bool

    def as_json(self) -> dict[str, Any]:
        """Return plain values; a number that is not finite is None."""
        values = self.measured
        plain = (
            {name: _finite(value) for name, value in values.items()}
            if isinstance(values, Mapping)
            else _finite(values)
        )
        return {
            "id": self.id,
            "claim": self.claim,
            "source": self.source,
            "measured": plain,
            "expected": self.expected,
            "holds": self.holds,
        }


@dataclass(frozen=True)
class Check:
    """How a claim is decided: `measure` returns what was measured, and whether the claim holds."""

    source: str
    expected: str
    measure: Callable[[Evidence], Decided]

    def __call__(self, evidence: Evidence) -> Claim:
        """Return the claim, decided."""
        measured, holds = self.measure(evidence)
        return Claim(
            id=self.measure.__name__.replace("_", "-"),
            claim=(self.measure.__doc__ or "").rstrip("."),
            source=self.source,
            measured=measured,
            expected=self.expected,
            holds=bool(holds),
        )


def check(source: str, expected: str) -> Callable[[Callable[[Evidence], Decided]], Check]:
    """Make a check of a function: its name is the id of the claim, its docstring the claim."""
    return lambda measure: Check(source, expected, measure)


def checks_in(module: ModuleType) -> list[Check]:
    """Return the checks of a module, in their order."""
    return [value for value in vars(module).values() if isinstance(value, Check)]


def by_name(names: tuple[str, ...], values: Any) -> dict[str, float]:
    """Return numbers by the names of the parameters."""
    return dict(zip(names, np.asarray(values, float).tolist(), strict=True))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
