"""A claim of the paper, how it is decided, and the words for when it holds."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from flexaxis.experiments.paper.measures import Measures
from flexaxis.experiments.scoring.scores import finite

Holds = Callable[[pd.Series], Any]


class Check(NamedTuple):
    """How a claim is decided: what is measured of the evidence, and when the claim holds."""

    id: str
    source: str
    claim: str
    expected: str
    measure: Callable[[Measures], Any]
    holds: Holds

    def __call__(self, evidence: Measures) -> dict[str, Any]:
        """Return the claim as it stands in claims.json; a number that is not finite is None.

        What is measured of each identified parameter has their names, one number is a ``value``.
        """
        result = self.measure(evidence)
        if not isinstance(result, dict):
            names = evidence.names if np.ndim(result) else ["value"]
            result = dict(zip(names, np.ravel(result), strict=True))
        claim = {key: getattr(self, key) for key in ("id", "claim", "source", "expected")}
        measured = {name: finite(value) for name, value in result.items()}
        holds = bool(self.holds(pd.Series(result, dtype=float)))
        return claim | {"measured": measured, "holds": holds}


def within(low: float, high: float, *, least: int = 1) -> Holds:
    """Return whether all that was measured is between two limits, and how many these must be."""
    return lambda measured: len(measured) >= least and measured.between(low, high).all()


def below(limit: float) -> Holds:
    """Return whether all that was measured is at most a limit."""
    return within(-np.inf, limit)


def above(limit: float) -> Holds:
    """Return whether all that was measured is at least a limit."""
    return within(limit, np.inf)


def half_of_P(tolerance: float) -> Holds:
    """Return whether deviations, over those of σ²P/2, are 1 within a tolerance.

    Their mean must also be nearer to these than to those of σ²P or σ²P/4, √2 away.
    """
    near = within(1 - tolerance, 1 + tolerance)
    return lambda ratios: near(ratios) and abs(np.log2(ratios).mean()) < 0.25
