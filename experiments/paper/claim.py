"""A claim of the paper, how it is decided, and the words for when it holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.experiments.paper.evidence import Evidence
from flexaxis.experiments.scoring.scores import finite

Measured = Mapping[str, float]
Holds = Callable[[Measured], Any]


@dataclass(frozen=True)
class Check:
    """How a claim is decided: what is measured of the evidence, and when the claim holds."""

    id: str
    source: str
    claim: str
    expected: str
    measure: Callable[[Evidence], Any]
    holds: Holds

    def __call__(self, evidence: Evidence) -> dict[str, Any]:
        """Return the claim as it stands in claims.json; a number that is not finite is None.

        What is measured of each identified parameter has their names, one number is a ``value``.
        """
        result = self.measure(evidence)
        if not isinstance(result, Mapping):
            names = evidence.names if np.ndim(result) else ["value"]
            result = dict(zip(names, np.ravel(result), strict=True))
        claim = {key: getattr(self, key) for key in ("id", "claim", "source", "expected")}
        measured = {name: finite(value) for name, value in result.items()}
        return claim | {"measured": measured, "holds": bool(self.holds(result))}


def within(low: float, high: float, *, least: int = 1) -> Holds:
    """Return whether all that was measured is between two limits, and how many these must be."""
    return lambda measured: (
        len(measured) >= least and all(low <= value <= high for value in measured.values())
    )


def below(limit: float) -> Holds:
    """Return whether all that was measured is at most a limit."""
    return within(-np.inf, limit)


def above(limit: float) -> Holds:
    """Return whether all that was measured is at least a limit."""
    return within(limit, np.inf)


def spread(measured: Measured) -> float:
    """Return the largest over the smallest."""
    return max(measured.values()) / min(measured.values())


def half_of_P(tolerance: float) -> Holds:
    """Return whether deviations, over those of σ²P/2, are 1 within a tolerance.

    Their mean must also be nearer to these than to those of σ²P or σ²P/4, √2 away.
    """
    near = within(1 - tolerance, 1 + tolerance)
    return lambda ratios: near(ratios) and abs(np.log2([*ratios.values()]).mean()) < 0.25
