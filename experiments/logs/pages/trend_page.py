"""The page of a trend: what changed, in words and in pictures; all parameters; what went wrong."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.pages.page import LogPage, capital
from flexaxis.experiments.logs.trend.trend import Trend, ailments
from flexaxis.experiments.logs.trend.wear import CHANGED, EXPLAINED, OPEN, STEADY, UNTOLD, Verdict
from flexaxis.experiments.logs.trend.words import log_remarks, remarks, sentences
from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, texts

Array = NDArray[np.float64]

WORDS = {
    CHANGED: "changed",
    OPEN: "changed, worn or warm",
    EXPLAINED: "follows the covariate",
    UNTOLD: "cannot be told",
    STEADY: "did not change",
}
ESTIMATE = "estimate of a log, ±2σ"


def trend_page(trend: Trend, *, title: str, command: str) -> LogPage:
    """Return the page; of too few logs the estimates alone, and why there are no verdicts."""
    if trend.why:
        told, said = Finding("problem", capital(trend.why)), log_remarks(trend.rows)
        charts, table = [], _estimates(trend)
    else:
        told, said = _finding(trend), remarks(trend)
        charts, table = [*_charts(trend)], _parameters(trend)
    tables = [table, *_of_logs(trend.rows)]
    return LogPage(title, command, told, said, charts, tables)


def _finding(trend: Trend) -> Finding:
    """Return what changed, and how many logs are unlike the others, in a sentence."""

    def told(*kinds: str) -> str:
        return "; ".join(sentences(v, trend)[0] for v in trend.verdicts if v.kind in kinds)

    if trend.changed:
        return Finding("problem", capital(told(CHANGED, OPEN)))
    text = capital(told(EXPLAINED) or "no parameter changed")
    if ailments(trend.rows):
        return Finding("problem", f"{text} But not all logs are alike, see below.")
    return Finding("ok", text)


def _charts(trend: Trend) -> Iterator[Chart]:
    loud = (v for v in trend.verdicts if v.kind != STEADY)
    for one in sorted(loud, key=lambda v: [*WORDS].index(v.kind)):
        yield _over_time(one, trend)
        for name, values in trend.covariates.items():
            yield _over_covariate(one, name, values)
    yield overview_chart(trend)
    yield logs_chart(trend)


def _over_time(found: Verdict, trend: Trend) -> Chart:
    """Return a parameter over time with what was found in it."""
    times, changes = trend.clock.time[found.logs], found.found.changes
    words = ". ".join(sentences(found, trend)) + "."
    shape = {"step": "step", "ramp": "from here on"}
    causes = " and ".join(trend.covariates)
    panels = [_panel(found, trend, f"less what {causes} explains" if causes else "")]
    if causes:
        panels.insert(0, _panel(found, trend, "as estimated", raw=True))
    return Chart(
        title=f"{found.name}: {WORDS[found.kind]}",
        words=f"{words} Shaded: where the change can have begun, at 95 %." if changes else words,
        **_across(trend),
        panels=panels,
        marks=[(float(times[c.place]), shape.get(c.shape, c.shape)) for c in changes],
        spans=[
            (float(times[c.earliest]), float(times[c.latest]), "")
            for c in changes
            if c.latest > c.earliest
        ],
    )


def overview_chart(trend: Trend) -> Chart:
    """Return all parameters over time."""
    return Chart(
        title="All parameters",
        words="Over the value at the start and the mean of the covariates; bars are ±2σ of a log.",
        **_across(trend),
        panels=[_panel(one, trend) for one in trend.verdicts],
    )


def logs_chart(trend: Trend) -> Chart:
    """Return fit, delay, constant torque and colour of the residual of each log."""
    rows, time = trend.good, trend.clock.time
    periods = np.array([row["period"] for row in rows])

    def barred(name: str, scale: Array | float) -> Line:
        value, sd = (scale * np.array([row[name][key] for row in rows]) for key in ("value", "sd"))
        return _points(time, value, 2 * sd)

    panels = {
        "fit [%]": _points(time, [row["fit"] for row in rows]),
        "torque late [samples]": barred("late", 1 / periods),
        "constant torque [as logged]": barred("offset", 1.0),
        "residual predicted [%]": _points(time, [100 * row["colour"] for row in rows]),
    }
    return Chart(
        title="The logs",
        words="How well a simulation from the torque alone fits each, how late its torque acts, "
        "what constant torque acts besides, and how much of what is left its own past predicts: 0 "
        "if it is white noise, and more where the model leaves something out. Bars are ±2σ.",
        **_across(trend),
        panels=[Panel(y=label, lines=[line]) for label, line in panels.items()],
    )


def _across(trend: Trend) -> dict[str, Any]:
    """Return what a chart over time has across: dates, or numbers of logs."""
    return {"x": "date" if trend.first else "log", "x_from": trend.first}


def _points(x: ArrayLike, y: ArrayLike, bars: Array | None = None, who: str = ESTIMATE) -> Line:
    """Return points, with bars of a half length."""
    at, up = np.asarray(x, float), np.asarray(y, float)
    low, high = (None, None) if bars is None else (up - bars, up + bars)
    return Line(who=who, kind="points", x=at, y=up, low=low, high=high)


def _panel(found: Verdict, trend: Trend, title: str = "", *, raw: bool = False) -> Panel:
    """Return a parameter over time, without what the covariates explain unless it is `raw`."""
    times, warm = trend.clock.time[found.logs], found.found.of_covariates
    level = found.found.level + (0.0 if raw else warm)
    percent = found.percent(found.series.value - level)
    lines = [_points(times, percent, 200 * found.series.deviation)]
    if raw:
        explained = f"what {' and '.join(trend.covariates)} explains"
        lines.append(Line(who=explained, x=times, y=found.percent(warm)))
    who = "with the change found" if found.found.changes else "fitted"
    lines.append(Line(who=who, x=times, y=found.percent(found.found.fitted - level)))
    out = [outlier.place for outlier in found.found.outliers]
    if out:
        lines.append(_points(times[out], percent[out], who="out of line"))
    return Panel(y=f"{found.name} [%]", title=title, lines=lines)


def _over_covariate(found: Verdict, name: str, values: Array) -> Chart:
    """Return the estimates over a covariate, those before a change apart from those after it."""
    x = values[found.logs]
    y = found.percent(found.series.value - found.found.level)
    changes = found.found.changes
    turn = changes[0].place if changes else len(x) // 2
    words = ("before the change", "after it") if changes else ("first half", "second half")
    order = np.argsort(x)
    explained = found.percent(found.found.of_covariates)[order]
    lines = [
        _points(x[part], y[part], who=f"logs, {word}")
        for part, word in zip((slice(turn), slice(turn, None)), words, strict=True)
        if len(x[part])
    ]
    lines.append(Line(who=f"what {name} explains", x=x[order], y=explained))
    return Chart(
        title=f"{found.name} over {name}",
        words=f"What {name} explains, and what it does not.",
        x=f"{name} [its unit]",
        panels=[Panel(y=f"{found.name} [%]", lines=lines)],
    )


def _estimates(trend: Trend) -> Table:
    """Return the estimates of each log."""
    names = list(trend.good[0]["estimates"])
    lines = []
    for row in trend.good:
        each = [row["estimates"][name] for name in names]
        cells = [Cell(f"{e['value']:.5g} ± {e['sd']:.1g}", e["value"]) for e in each]
        lines.append(Row([Cell(str(row["log"])), Cell(f"{row['fit']:.3g}", row["fit"]), *cells]))
    columns = [Column("log", kind="text"), Column("fit [%]"), *map(Column, names)]
    return Table("Estimates [SI]", columns, lines)


def _of_logs(rows: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return tables of the logs with which something is wrong."""
    tables = {
        ("Logs that are not like the others", "what"): [
            (log, ", and ".join(said)) for log, said in ailments(rows).items()
        ],
        ("Logs that could not be used", "why"): [
            (str(row["log"]), str(row["problem"]))
            for row in rows
            if row["problem"] and not row.get("unlike")
        ],
    }
    return [texts(head, ("log", word), lines) for (head, word), lines in tables.items() if lines]


def _parameters(trend: Trend) -> Table:
    columns = [
        Column("parameter", kind="text"),
        Column("verdict", kind="text"),
        Column("change [%]"),
        *(Column(f"{name} [%/unit]") for name in trend.covariates),
        Column("median [SI]"),
        Column("± of a log [%]"),
        Column("scatter between logs [%]"),
    ]
    return Table("Parameters", columns, [_line(one, trend) for one in trend.verdicts])


def _line(found: Verdict, trend: Trend) -> Row:
    median = float(np.median([row["estimates"][found.name]["value"] for row in trend.good]))
    deviation, scatter = 100 * float(np.median(found.series.deviation)), 100 * found.found.scatter
    slopes = 100 * np.stack([found.found.slopes, found.found.slope_deviations], axis=1)
    sizes = [
        (float(found.percent(c.size)), found.percent_deviation(c)) for c in found.found.changes
    ]
    changes = ", ".join(f"{size:+.3g} ± {sd:.1g}" for size, sd in sizes)
    largest = max((size for size, _ in sizes), key=abs, default="")
    cells = [
        Cell(found.name),
        Cell(WORDS[found.kind]),
        Cell(changes or "–", largest),
        *(Cell(f"{slope:+.3g} ± {sd:.1g}", slope) for slope, sd in slopes.tolist()),
        Cell(f"{median:.5g}", median),
        Cell(f"{deviation:.2g}", deviation),
        Cell(f"{scatter:.2g}", scatter),
    ]
    return Row(cells, kind="changed" if found.kind in {CHANGED, OPEN} else "")
