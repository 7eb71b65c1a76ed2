"""What became of an axis over many logs: estimates from each, and a verdict on each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.covariates import Clock, clock, covariates_of
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.own import find_logs
from flexaxis.experiments.logs.trend import Source, check_folder, estimate_all, plan_for, tasks
from flexaxis.experiments.logs.wear import CHANGED, OPEN, Verdict, fewest_logs, verdicts
from flexaxis.experiments.running.progress import progress


@dataclass(frozen=True)
class Trend:
    """What became of an axis over many logs.

    Attributes
    ----------
    rows : list of dict
        Of all logs, also of those that could not be used.
    clock : Clock
        Of those that could.
    covariates : dict of str to ndarray
    verdicts : list of Verdict
        Empty where there are too few logs.
    why : str
        Why there are no verdicts.
    false_alarms : float
        Probability that any parameter of an axis that does not change is said to.
    """

    rows: list[dict[str, Any]]
    clock: Clock
    covariates: Mapping[str, NDArray[np.float64]]
    verdicts: list[Verdict]
    why: str = ""
    false_alarms: float = 0.01

    @property
    def good(self) -> list[dict[str, Any]]:
        """Rows of logs that have estimates, in the order of the clock."""
        good = [row for row in self.rows if not row["problem"]]
        return [good[i] for i in self.clock.order]

    @property
    def first(self) -> str:
        """When the first of them was by ISO 8601, where all have a date; else empty."""
        begun = datetime.fromisoformat(self.good[0]["date"]) if self.clock.dated else None
        return "" if begun is None else begun.replace(tzinfo=None).isoformat(timespec="seconds")

    @property
    def changed(self) -> bool:
        """Whether a parameter changed."""
        return any(one.kind in {CHANGED, OPEN} for one in self.verdicts)


def trend_of(
    given: Sequence[Path],
    axis: Axis,
    source: Source,
    folder: Path,
    *,
    free: Sequence[str] = (),
    covariates: Sequence[str] = (),
    false_alarms: float = 0.01,
    smallest: float = 0.01,
    jobs: int = 1,
) -> Trend:
    """Estimate from many logs what is not estimated yet, and judge.

    Parameters
    ----------
    given : sequence of Path
        Logs, or folders of them.
    axis, source, folder
        As for `plan_for` and `estimate_all`.
    free : sequence of str
        Parameters to estimate; by default those that the first log tells.
    covariates, false_alarms, smallest
        As for `flexaxis.experiments.logs.wear.verdicts`.
    jobs : int
        Processes.

    Raises
    ------
    LogError
        If there are no logs, or too few of them.
    """
    if not axis.known:
        raise LogError("the model has no values; give what `flexaxis identify` wrote")
    axis.having(dict.fromkeys(free, 1.0))  # raises for unknown names
    check_folder(folder, given)
    logs, fewest = find_logs(given), fewest_logs(len(covariates))
    if len(logs) < fewest:
        raise LogError(f"{len(logs)} logs; a trend needs {fewest}")
    plan = plan_for(logs, axis, source, free)
    with progress(f"{len(logs)} logs", len(logs)) as advance:
        rows = estimate_all(plan, [*tasks(plan, logs)], folder, jobs=jobs, advance=advance)
    good = [row for row in rows if not row["problem"]]
    if not good:
        raise LogError(
            f"none of {len(rows)} logs can be used; {rows[0]['log']}: {rows[0]['problem']}"
        )
    when = clock(good)
    ordered = [good[i] for i in when.order]
    columns = covariates_of(ordered, covariates)
    found = Trend(rows, when, columns, [], false_alarms=false_alarms)
    try:
        options = {"false_alarms": false_alarms, "smallest": smallest}
        return replace(found, verdicts=verdicts(ordered, when.time, columns, **options))
    except LogError as error:
        return replace(found, why=str(error))
