"""Where the core-seconds of a run go: plant, each estimator, bounds, scores, writing, waiting."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from flexaxis.experiments.running.cache import PLANT
from flexaxis.experiments.running.case import ESTIMATOR
from flexaxis.experiments.running.compiling import COMPILING, compiled_apart
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.scoring.spending import OTHER, ledger
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark

STARTING = "starting processes, and their imports"
WAITING = "waiting"  # cores that nobody used
HANDING_OUT = "planning, and handing out work"
NEEDED = (PLANT, ESTIMATOR, COMPILING)  # what there is to be done; all else is overhead


@dataclass(frozen=True)
class Campaign:
    """What a run took.

    Attributes
    ----------
    wall : float
        From its begin to its report [s].
    jobs : int
        Processes that could work at a time.
    spent : dict of str to float
        Core-seconds by account, the largest first; their sum is `wall * jobs`.
    cases, records : int
        Cases that were run, and records that were simulated for them.
    """

    wall: float
    jobs: int
    spent: Mapping[str, float]
    cases: int
    records: int

    @property
    def overhead(self) -> float:
        """Share of the processor time that is neither plant nor estimators, nor waiting."""
        busy = {name: s for name, s in self.spent.items() if name != WAITING}
        needed = sum(s for name, s in busy.items() if name.startswith(NEEDED))
        return 1 - needed / sum(busy.values())

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON takes it."""
        return {
            "wall": self.wall,
            "jobs": self.jobs,
            "cases": self.cases,
            "records": self.records,
            "overhead": self.overhead,
            "core_seconds": dict(self.spent),
        }


def campaign(wanted: Benchmark, folder: Path, means: Means) -> Campaign:
    """Run a benchmark, and return where its time went.

    Parameters
    ----------
    wanted : Benchmark
    folder : Path
        Where its results are written.
    means : Means
        Processes of this machine, none elsewhere.
    """
    total: Counter[str] = Counter()
    cases = records = 0

    def landed(outcome: Any) -> None:
        nonlocal cases, records
        total.update(outcome.spent)
        cases, records = cases + outcome.cases, records + outcome.simulated

    children, start = _of_children(), time.perf_counter()
    with ledger() as here, compiled_apart():
        # With processes of its own, whose time is known when they have ended.
        benchmark(wanted, folder, replace(means, workers=None).also(landed))
    wall = time.perf_counter() - start
    spent = Counter[str](total)
    if means.jobs > 1:
        spent.update({STARTING: max(0.0, _of_children() - children - sum(total.values()))})
    spent.update({HANDING_OUT if name == OTHER else name: s for name, s in here.items()})
    spent.update({WAITING: max(0.0, wall * means.jobs - sum(spent.values()))})
    return Campaign(wall, means.jobs, dict(spent.most_common()), cases, records)


def _of_children() -> float:
    """Return the processor time of all processes that were started here and have ended [s]."""
    try:
        import resource
    except ImportError:  # Windows: that share of it is then with what is waited for
        return 0.0
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
