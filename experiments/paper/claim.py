"""A claim of the paper, the evidence it is decided on, and the words for when it holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.paper.data import Data, Size, collect
from flexaxis.experiments.paper.experiments import (
    Convergence,
    Offline,
    converge,
    identify_offline,
)
from flexaxis.experiments.paper.further_work import FurtherWork, further_work
from flexaxis.experiments.running.cache import RecordCache

Array = NDArray[np.float64]
Measured = float | Mapping[str, float]
SHARES = {"data": 0.6, "offline": 0.05, "convergence": 0.05, "further": 0.2, "figures": 0.1}
"""What part of the time a stage takes."""


@dataclass(frozen=True)
class Evidence:
    """Everything that was simulated and estimated."""

    data: Data
    convergence: Convergence
    offline: Offline
    further: FurtherWork


def gather(
    size: Size,
    *,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[float], None] = lambda fraction: None,
) -> Evidence:
    """Simulate and estimate everything that the claims are about.

    Parameters
    ----------
    size : Size
        Numbers of runs, and their first seed.
    jobs : int
        Processes of the simulations.
    store : RecordCache, optional
        Where records are kept.
    advance : callable, optional
        Called with the fraction done since the last call.
    """
    data = collect(
        size, jobs=jobs, store=store, advance=lambda part: advance(part * SHARES["data"])
    )
    offline = identify_offline(data)
    advance(SHARES["offline"])
    convergence = converge(data)
    advance(SHARES["convergence"])
    further = further_work(data, convergence.Q)
    advance(SHARES["further"])
    return Evidence(data=data, convergence=convergence, offline=offline, further=further)


def by_name(e: Evidence, values: ArrayLike) -> dict[str, float]:
    """Return numbers (p,) by the names of the identified parameters."""
    return dict(zip(e.data.names, np.asarray(values, float).tolist(), strict=True))


@dataclass(frozen=True)
class Claim:
    """A decided claim, as it stands in claims.json.

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
        several = isinstance(self.measured, Mapping)
        plain = {
            key: float(value) if np.isfinite(value) else None
            for key, value in _table(self.measured).items()
        }
        return asdict(self) | {"measured": plain if several else plain[""]}


@dataclass(frozen=True)
class Check:
    """How a claim is decided: what is measured of the evidence, and when the claim holds."""

    id: str
    source: str
    claim: str
    expected: str
    measure: Callable[[Evidence], Measured | Array]
    holds: Callable[[Any], Any]

    def __call__(self, evidence: Evidence) -> Claim:
        """Return the claim, decided; what is measured of each parameter has their names."""
        found = self.measure(evidence)
        measured = by_name(evidence, found) if isinstance(found, np.ndarray) else found
        holds = bool(self.holds(measured))
        return Claim(self.id, self.claim, self.source, measured, self.expected, holds)


def _table(measured: Measured) -> Mapping[str, float]:
    return measured if isinstance(measured, Mapping) else {"": measured}


def within(low: float, high: float, *, least: int = 1) -> Callable[[Measured], bool]:
    """Return whether all that was measured is between two limits, and how many these must be."""
    return lambda measured: (
        len(every := _table(measured).values()) >= least
        and low <= min(every)
        and max(every) <= high
    )


def below(limit: float) -> Callable[[Measured], bool]:
    """Return whether all that was measured is below a limit."""
    return lambda measured: max(_table(measured).values()) < limit


def above(limit: float) -> Callable[[Measured], bool]:
    """Return whether all that was measured is above a limit."""
    return lambda measured: min(_table(measured).values()) > limit


def spread(measured: Any) -> float:
    """Return the largest over the smallest."""
    return float(max(measured.values()) / min(measured.values()))


def half_of_P(tolerance: float) -> Callable[[Any], bool]:
    """Return whether deviations, given over those of σ²P/2, are these within a tolerance.

    On the whole they also have to lie nearer to them than to those of σ²P or σ²P/4, √2 away.
    """
    near = within(1 - tolerance, 1 + tolerance)
    return lambda ratios: near(ratios) and bool(abs(np.log2([*ratios.values()]).mean()) < 0.25)
