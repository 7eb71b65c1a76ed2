"""Everything that claims and figures are made of: runs, and what was estimated from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.experiments.paper.data import Data, Size, collect
from flexaxis.experiments.paper.further_work import FurtherWork, further_work
from flexaxis.experiments.paper.offline import Offline, identify_offline
from flexaxis.experiments.paper.recursive import Convergence, converge
from flexaxis.experiments.running.cache import RecordCache

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
