"""What became of an axis over many logs: estimates from each, and a verdict on each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import find_logs
from flexaxis.experiments.logs.trend.covariates import Clock, check_columns, clock, covariates_of
from flexaxis.experiments.logs.trend.estimates import (
    Source,
    check_folder,
    estimate_all,
    plan_for,
)
from flexaxis.experiments.logs.trend.wear import CHANGED, OPEN, WearVerdict, fewest_logs, verdicts
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
    verdicts : list of WearVerdict
    false_alarms : float
        Probability that any parameter of an axis that does not change is said to.
    """

    rows: list[dict[str, Any]]
    clock: Clock
    covariates: Mapping[str, NDArray[np.float64]]
    verdicts: list[WearVerdict]
    false_alarms: float = 0.01

    @property
    def good(self) -> list[dict[str, Any]]:
        """Rows of logs that have estimates, in the order of the clock."""
        good = [row for row in self.rows if not row["problem"]]
        return [good[i] for i in self.clock.order]

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
        As for `flexaxis.experiments.logs.trend.wear.verdicts`.
    jobs : int
        Processes.

    Raises
    ------
    LogError
        If there are no logs, or too few of them, or none has the column of a covariate.
    """
    axis.check_known()
    axis.having(dict.fromkeys(free, 1.0))  # raises for unknown names
    check_folder(folder, given)
    logs, fewest = find_logs(given), fewest_logs(len(covariates))
    if len(logs) < fewest:
        raise LogError(f"{len(logs)} logs; a trend needs {fewest}")
    check_columns(logs, covariates)
    plan = plan_for(logs, axis, source, free)
    with progress(f"{len(logs)} logs", len(logs)) as advance:
        rows = estimate_all(plan, logs, folder, jobs=jobs, advance=advance)
    good = [row for row in rows if not row["problem"]]
    if len(good) < fewest:
        why = [f": {row['log']}: {row['problem']}" for row in rows if row["problem"]]
        raise LogError(f"{len(good)} logs have estimates; a trend needs {fewest}{''.join(why[:1])}")
    when = clock(good)
    ordered = [good[i] for i in when.order]
    columns = covariates_of(ordered, covariates)
    options = {"false_alarms": false_alarms, "smallest": smallest}
    found = verdicts(ordered, when.time, columns, **options)
    return Trend(rows, when, columns, found, false_alarms)


Array = NDArray[np.float64]

WORSE = 1.5  # times what the better half of the logs leaves unexplained
POINTS = 1.0  # per cent of the fit that are worth a word
FAR = 8.0  # robust standard deviations of the better half of the logs
SURE = 5.0  # claimed standard deviations of a delay
LATE = 0.25  # samples of a delay that is worth a word
UNFINISHED = 1.0  # standard deviations: logs further from their end say less than they claim


def ailments(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return what is wrong with which logs.

    Parameters
    ----------
    rows : sequence of mapping
        Of all logs, some of which have estimates.

    Returns
    -------
    dict of str to list of str
        Name of the log, and sentences. A log is compared with the better half of all, so that a
        delay that all logs have is not among them: `common` tells that.
    """
    found = {row["log"]: [row["problem"]] for row in rows if row.get("unlike")}
    rows = [row for row in rows if not row["problem"]]
    unexplained = np.array([100 - row["fit"] for row in rows])
    usual, far = _better(unexplained)
    errors = np.array([row["error"] for row in rows])
    # less motion is a poorer fit by the same errors
    worse = (unexplained > max(WORSE * usual, usual + POINTS)) & far
    worse &= errors > WORSE * _better(errors)[0]
    late = _late(rows)
    usual_late, far = _better(late)
    moved = late - usual_late
    claimed = np.array([row["late"]["sd"] / row["period"] for row in rows])
    shifted = (abs(moved) > np.maximum(LATE, SURE * claimed)) & far
    for i, row in enumerate(rows):
        said = [
            f"is fitted by {row['fit']:.3g} % only, others by {100 - usual:.3g} %: something acts "
            "that the model does not know"
        ] * bool(worse[i])
        if shifted[i]:
            said.append(f"its torque acts {_shift(moved[i])} than in others")
        if row["left"] > UNFINISHED:
            said.append("its estimates did not settle: the axis is far from what is known of it")
        if said:
            found[row["log"]] = said
    return found


def common(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what is wrong with the logs altogether, in sentences."""
    late, _ = _better(_late(rows))
    return [
        f"the torque acts {_shift(late)} than the axis has it in most logs: identify it again, "
        "from one of them"
    ] * (abs(late) > 2 * LATE)


def _shift(late: float) -> str:
    return f"about {abs(late):.1g} samples {'later' if late > 0 else 'earlier'}"


def _late(rows: Sequence[Mapping[str, Any]]) -> Array:
    return np.array([row["late"]["value"] / row["period"] for row in rows])


def _better(values: Array) -> tuple[float, NDArray[np.bool_]]:
    """Return the median of the half that is nearest to 0, and which are far from it."""
    half = values[np.argsort(abs(values))[: max(len(values) // 2, 1)]]
    middle = float(np.median(half))
    scatter = 1.4826 * float(np.median(abs(half - middle)))
    return middle, abs(values - middle) > FAR * scatter
