"""What estimators found in the cases of a study: how soon, how often wrongly, and by which name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.intervals import mean_interval

Row = Mapping[str, Any]
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


@dataclass
class _Count:
    delays: list[float] = field(default_factory=list)
    missed: int = 0
    faults: int = 0
    false: int = 0
    seconds: float = 0.0


def alarms(rows: Iterable[Row]) -> list[Alarms]:
    """Return the alarms of each estimator that reports findings.

    Parameters
    ----------
    rows : iterable of mapping
        From `Results.rows`.
    """
    counts: dict[tuple[str, str], _Count] = {}
    for row in _cases(rows):
        count = counts.setdefault((row["method"], row["estimator"]), _Count())
        found = row["detection"]
        if found["delay"] is not None:
            count.delays.append(found["delay"])
        count.missed += found["missed"]
        count.faults += len(row["isolation"])
        count.false += found["false_alarms"]
        count.seconds += row["seconds"]
    return [
        Alarms(
            method,
            estimator,
            delay=float(np.mean(count.delays)) if count.delays else None,
            delay_interval=mean_interval(count.delays),
            missed=count.missed / max(1, count.faults),
            false_per_hour=3600 * count.false / count.seconds,
        )
        for (method, estimator), count in counts.items()
    ]


def confusion(rows: Iterable[Row]) -> dict[str, Counter[tuple[str, str]]]:
    """Count for each method what each fault was taken for, by (fault, named).

    Parameters
    ----------
    rows : iterable of mapping
        From `Results.rows`.
    """
    found: dict[str, Counter[tuple[str, str]]] = {}
    for row in _cases(rows):
        pairs = [(entry["fault"], _named(entry["named"])) for entry in row["isolation"]]
        if pairs:
            found.setdefault(row["method"], Counter()).update(pairs)
    return found


def _cases(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield one row of each case with findings: they stand in all its rows."""
    last = None
    for row in rows:
        if row["case"] != last and row["detection"] is not None:
            yield row
        last = row["case"]


def _named(names: Sequence[str] | None) -> str:
    if names is None:
        return MISSED
    return names[0] if len(names) == 1 else SEVERAL if names else UNMODELLED
