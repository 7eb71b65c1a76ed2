"""The page of a trend: what changed, in words and in pictures; all parameters; what went wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.covariates import Clock
from flexaxis.experiments.logs.log_health import ailments
from flexaxis.experiments.logs.log_page import LogPage, write_page
from flexaxis.experiments.logs.trend_figures import logs_figure, overview_figure, parameter_figure
from flexaxis.experiments.logs.trend_words import log_remarks, remarks, sentences
from flexaxis.experiments.logs.wear import CHANGED, EXPLAINED, OPEN, STEADY, Verdict

Array = NDArray[np.float64]
Table = tuple[str, Sequence[str], Sequence[Sequence[str]]]

WORDS = {
    CHANGED: "changed",
    OPEN: "changed, worn or warm",
    EXPLAINED: "follows the covariate",
    STEADY: "did not change",
}


def write_trend(
    path: Path,
    found: Sequence[Verdict],
    clock: Clock,
    covariates: Mapping[str, Array],
    rows: Sequence[Mapping[str, Any]],
    *,
    command: str,
    title: str,
    false_alarms: float,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
    found : sequence of Verdict
    clock : Clock
    covariates : mapping of str to ndarray (n,)
        In the order of the clock.
    rows : sequence of mapping
        Of all logs, also of those that could not be used.
    command, title : str
    false_alarms : float
    """
    good = [row for row in rows if not row["problem"]]
    first = datetime.fromisoformat(good[clock.order[0]]["date"]) if clock.dated else None
    loud = sorted((v for v in found if v.kind != STEADY), key=lambda v: [*WORDS].index(v.kind))
    figures = [
        (
            _heading(one),
            parameter_figure(one, clock, covariates, first),
            ". ".join(sentences(one, clock, [*covariates])) + ".",
        )
        for one in loud
    ]
    figures.append(
        (
            "All parameters",
            overview_figure(found, clock, first),
            "Over the value at the start and the mean of the covariates; bars are ±2σ of a log.",
        )
    )
    ordered = [good[i] for i in clock.order]
    figures.append(
        (
            "The logs",
            logs_figure(ordered, clock, first),
            "How well a simulation from the torque alone fits each, how late its torque acts, what "
            "constant torque acts besides, and how much of what is left its own past predicts: 0 "
            "if it is white noise, and more where the model leaves something out. Bars are ±2σ.",
        )
    )
    tables: list[Table] = [
        ("Parameters", _head(covariates), [_line(one, clock, good, covariates) for one in found])
    ]
    tables += _of_logs(rows)
    page = LogPage(
        title=title,
        command=command,
        remarks=remarks(found, clock, [*covariates], rows, false_alarms),
        tables=tables,
        figures=figures,
    )
    write_page(page, path)


def write_values(
    path: Path, rows: Sequence[Mapping[str, Any]], *, command: str, title: str, why: str
) -> None:
    """Write a page of the estimates alone, and `why` there are no verdicts."""
    good = [row for row in rows if not row["problem"]]
    names = list(good[0]["estimates"])
    lines = [
        [
            str(row["log"]),
            f"{row['fit']:.3g}",
            *(
                f"{row['estimates'][name]['value']:.5g} ± {row['estimates'][name]['sd']:.1g}"
                for name in names
            ),
        ]
        for row in good
    ]
    page = LogPage(
        title=title,
        command=command,
        remarks=[("problem", why), *log_remarks(rows)],
        tables=[("Estimates (SI)", ["log", "fit [%]", *names], lines), *_of_logs(rows)],
        figures=[],
    )
    write_page(page, path)


def _of_logs(rows: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return tables of the logs with which something is wrong."""
    ill = ailments(rows)
    strange = [(log, ", and ".join(said)) for log, said in ill.items()]
    bad = [
        (str(row["log"]), str(row["problem"]))
        for row in rows
        if row["problem"] and not row.get("unlike")
    ]
    tables: list[Table] = []
    if strange:
        tables.append(("Logs that are not like the others", ("log", "what"), strange))
    if bad:
        tables.append(("Logs that could not be used", ("log", "why"), bad))
    return tables


def _heading(found: Verdict) -> str:
    return f"{found.name}: {WORDS[found.kind]}"


def _head(covariates: Mapping[str, Array]) -> list[str]:
    return [
        "parameter", "verdict", "median (SI)", "± of a log [%]", "scatter between logs [%]",
        "change [%]", *(f"{name} [%/unit]" for name in covariates),
    ]  # fmt: skip


def _line(
    found: Verdict,
    clock: Clock,
    rows: Sequence[Mapping[str, Any]],
    covariates: Mapping[str, Array],
) -> list[str]:
    values = [row["estimates"][found.name]["value"] for row in rows]
    changes = ", ".join(
        f"{float(found.percent(c.size)):+.3g} ± {found.percent_deviation(c):.1g}"
        for c in found.found.changes
    )
    slopes = zip(found.found.slopes, found.found.slope_deviations, strict=True)
    return [
        found.name,
        WORDS[found.kind],
        f"{np.median(values):.5g}",
        f"{100 * np.median(found.series.deviation):.2g}",
        f"{100 * found.found.scatter:.2g}",
        changes or "–",
        *(f"{100 * slope:+.3g} ± {100 * sd:.1g}" for slope, sd in slopes),
    ]
