"""What estimators found in the cases of a study: how soon, how often wrongly, and by which name."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexaxis.experiments.results.results import Results
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.pools import Columns, values

MISSED, UNMODELLED, SEVERAL = "missed", "unmodelled", "several"


@dataclass(frozen=True)
class Alarms:
    """The alarms of an estimator at one setting, over all its cases.

    Attributes
    ----------
    method, estimator : str
    delay : float or None
        From a fault to the first finding, mean over the cases that found one [s].
    delay_interval : list of float or None
        Its 95 % interval.
    missed : float
        Share of the faults without a finding.
    false_per_hour : float
        Findings outside the windows of all faults, in an hour of simulated time.
    """

    method: str
    estimator: str
    delay: float | None
    delay_interval: list[float] | None
    missed: float
    false_per_hour: float


def alarms(results: Results) -> list[Alarms]:
    """Return the alarms of each estimator that reports findings."""
    groups = results.grouped(["method", "estimator"], cases=True)
    each = ((key, groups.columns(i)) for i, key in enumerate(groups.keys))
    return [
        _alarms(columns, **key) for key, columns in each if values(columns, "detection.alarms").size
    ]


def _alarms(columns: Columns, *, method: str, estimator: str) -> Alarms:
    delays = values(columns, "detection.delay")
    missed, faults, false, seconds = (
        float(np.nansum(columns[name]))
        for name in ("detection.missed", "detection.faults", "detection.false_alarms", "seconds")
    )
    return Alarms(
        method,
        estimator,
        delay=float(delays.mean()) if delays.size else None,
        delay_interval=mean_interval(delays),
        missed=missed / max(1.0, faults),
        false_per_hour=3600 * false / seconds,
    )


def confusion(results: Results) -> dict[str, Counter[tuple[str, str]]]:
    """Count for each method what each fault was taken for, by (fault, named)."""
    found: dict[str, Counter[tuple[str, str]]] = {}
    groups = results.grouped(["method", "isolation"], cases=True)
    for i, key in enumerate(groups.keys):
        span = groups.span(i)
        for entry in json.loads(key["isolation"] or "[]"):
            counter = found.setdefault(key["method"], Counter())
            counter[entry["fault"], _named(entry["named"])] += span.stop - span.start
    return found


def _named(names: Sequence[str] | None) -> str:
    if names is None:
        return MISSED
    return names[0] if len(names) == 1 else SEVERAL if names else UNMODELLED
