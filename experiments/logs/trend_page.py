"""The page of a trend: what changed, in words and in pictures; all parameters; what went wrong."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.covariates import Clock
from flexaxis.experiments.logs.log_health import ailments
from flexaxis.experiments.logs.log_page import LogPage, Remark, capital, write_page
from flexaxis.experiments.logs.trend_charts import logs_chart, overview_chart, parameter_charts
from flexaxis.experiments.logs.trend_words import log_remarks, remarks, sentences
from flexaxis.experiments.logs.wear import CHANGED, EXPLAINED, OPEN, STEADY, UNTOLD, Verdict
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, texts

Array = NDArray[np.float64]

WORDS = {
    CHANGED: "changed",
    OPEN: "changed, worn or warm",
    EXPLAINED: "follows the covariate",
    UNTOLD: "cannot be told",
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
    said = remarks(found, clock, [*covariates], rows, false_alarms)
    page = LogPage(
        title=title,
        command=command,
        finding=_finding(found, clock, [*covariates], rows),
        remarks=said,
        charts=list(_charts(found, clock, covariates, good, first)),
        tables=[_parameters(found, good, covariates), *_of_logs(rows)],
    )
    write_page(page, path)


def _finding(
    found: Sequence[Verdict], clock: Clock, covariates: Sequence[str], rows: Sequence[Any]
) -> Remark:
    """Return what changed, and how many logs are unlike the others, in a sentence."""
    changed = [v for v in found if v.kind in {CHANGED, OPEN}]
    told = "; ".join(sentences(v, clock, covariates)[0] for v in changed)
    if changed:
        return "problem", capital(told)
    explained = [v for v in found if v.kind == EXPLAINED]
    text = "; ".join(sentences(v, clock, covariates)[0] for v in explained)
    text = capital(text or "no parameter changed")
    return (
        ("problem", f"{text} But not all logs are alike, see below.")
        if ailments(rows)
        else ("ok", text)
    )


def _charts(
    found: Sequence[Verdict],
    clock: Clock,
    covariates: Mapping[str, Array],
    good: Sequence[Mapping[str, Any]],
    first: datetime | None,
) -> Iterator[Chart]:
    loud = sorted((v for v in found if v.kind != STEADY), key=lambda v: [*WORDS].index(v.kind))
    for one in loud:
        words = ". ".join(sentences(one, clock, [*covariates])) + "."
        yield from parameter_charts(one, clock, covariates, first, title=_heading(one), words=words)
    yield overview_chart(found, clock, first)
    yield logs_chart([good[i] for i in clock.order], clock, first)


def write_values(
    path: Path, rows: Sequence[Mapping[str, Any]], *, command: str, title: str, why: str
) -> None:
    """Write a page of the estimates alone, and `why` there are no verdicts."""
    good = [row for row in rows if not row["problem"]]
    names = list(good[0]["estimates"])
    lines = [
        Row([
            Cell(str(row["log"])),
            Cell(f"{row['fit']:.3g}", row["fit"]),
            *(_estimate(row["estimates"][name]) for name in names),
        ])
        for row in good
    ]  # fmt: skip
    columns = [Column("log", kind="text"), Column("fit [%]"), *map(Column, names)]
    page = LogPage(
        title=title,
        command=command,
        finding=("problem", capital(why)),
        remarks=log_remarks(rows),
        charts=[],
        tables=[Table("Estimates [SI]", columns, lines), *_of_logs(rows)],
    )
    write_page(page, path)


def _estimate(told: Mapping[str, float]) -> Cell:
    return Cell(f"{told['value']:.5g} ± {told['sd']:.1g}", told["value"])


def _of_logs(rows: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return tables of the logs with which something is wrong."""
    ill = ailments(rows)
    strange = [(log, ", and ".join(said)) for log, said in ill.items()]
    bad = [
        (str(row["log"]), str(row["problem"]))
        for row in rows
        if row["problem"] and not row.get("unlike")
    ]
    tables = []
    if strange:
        tables.append(texts("Logs that are not like the others", ("log", "what"), strange))
    if bad:
        tables.append(texts("Logs that could not be used", ("log", "why"), bad))
    return tables


def _heading(found: Verdict) -> str:
    return f"{found.name}: {WORDS[found.kind]}"


def _parameters(
    found: Sequence[Verdict],
    rows: Sequence[Mapping[str, Any]],
    covariates: Mapping[str, Array],
) -> Table:
    columns = [
        Column("parameter", kind="text"),
        Column("verdict", kind="text"),
        Column("change [%]"),
        *(Column(f"{name} [%/unit]") for name in covariates),
        Column("median [SI]"),
        Column("± of a log [%]"),
        Column("scatter between logs [%]"),
    ]
    lines = [_line(one, rows) for one in found]
    return Table("Parameters", columns, lines)


def _line(found: Verdict, rows: Sequence[Mapping[str, Any]]) -> Row:
    median = float(np.median([row["estimates"][found.name]["value"] for row in rows]))
    deviation, scatter = 100 * float(np.median(found.series.deviation)), 100 * found.found.scatter
    slopes = zip(
        (100 * found.found.slopes).tolist(),
        (100 * found.found.slope_deviations).tolist(),
        strict=True,
    )
    cells = [
        Cell(found.name),
        Cell(WORDS[found.kind]),
        _changes(found),
        *(Cell(f"{slope:+.3g} ± {sd:.1g}", slope) for slope, sd in slopes),
        Cell(f"{median:.5g}", median),
        Cell(f"{deviation:.2g}", deviation),
        Cell(f"{scatter:.2g}", scatter),
    ]
    return Row(cells, kind="changed" if found.kind in {CHANGED, OPEN} else "")


def _changes(found: Verdict) -> Cell:
    """Return the sizes of all changes, to be sorted by the largest."""
    sizes = [
        (float(found.percent(c.size)), found.percent_deviation(c)) for c in found.found.changes
    ]
    if not sizes:
        return Cell("–", "")
    text = ", ".join(f"{size:+.3g} ± {sd:.1g}" for size, sd in sizes)
    return Cell(text, max((size for size, _ in sizes), key=abs))
