"""The page of a trend: what changed, in words and in pictures; all parameters; what went wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.pages.page import LogPage, capital, line
from flexaxis.experiments.logs.trend.trend import Trend, ailments
from flexaxis.experiments.logs.trend.wear import (
    CHANGED,
    EXPLAINED,
    OPEN,
    STEADY,
    UNTOLD,
    WearVerdict,
)
from flexaxis.experiments.logs.trend.words import remarks, sentences
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.charts_old.tables import Cell, Column, Row, Table, texts

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
    """Return the page."""
    bad = {str(r["log"]): [r["problem"]] for r in trend.rows if r["problem"] and "unlike" not in r}
    tables = [
        texts(heading, ("log", "what"), [(log, ", and ".join(said)) for log, said in ill.items()])
        for heading, ill in (
            ("Logs that are not like the others", ailments(trend.rows)),
            ("Logs that could not be used", bad),
        )
        if ill
    ]
    tables.insert(0, _parameters(trend))
    return LogPage(title, command, _finding(trend), remarks(trend), [*_charts(trend)], tables)


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


def _over_time(found: WearVerdict, trend: Trend) -> Chart:
    """Return a parameter over time with what was found in it."""
    times, changes = trend.clock.time[found.logs], found.found.changes
    causes = " and ".join(trend.covariates)
    panels = [_panel(found, trend, f"less what {causes} explains" if causes else "")]
    if causes:
        panels.insert(0, _panel(found, trend, "as estimated", raw=True))
    return Chart(
        title=f"{found.name}: {WORDS[found.kind]}",
        words=". ".join(sentences(found, trend))
        + (". Shaded: where the change can have begun, at 95 %." if changes else "."),
        **_across(trend),
        panels=panels,
        marks=[(float(times[c.place]), c.shape) for c in changes],
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


def _across(trend: Trend) -> dict[str, Any]:
    """Return what a chart over time has across: dates, or numbers of logs."""
    return {"x": "date" if trend.clock.first else "log", "x_from": trend.clock.first}


def _panel(found: WearVerdict, trend: Trend, title: str = "", *, raw: bool = False) -> Panel:
    """Return estimates and what was found in them [%]; less what covariates explain, or `raw`."""
    times, warm = trend.clock.time[found.logs], found.found.of_covariates
    level = found.found.level + (0.0 if raw else warm)
    percent, bars = found.percent(found.series.value - level), 200 * found.series.deviation
    lines = [line(times, percent, ESTIMATE, kind="points", low=percent - bars, high=percent + bars)]
    if raw:
        explained = f"what {' and '.join(trend.covariates)} explains"
        lines.append(Line(who=explained, x=times, y=found.percent(warm)))
    lines.append(Line(who="as found", x=times, y=found.percent(found.found.fitted - level)))
    out = [outlier.place for outlier in found.found.outliers]
    if out:
        lines.append(line(times[out], percent[out], "out of line", kind="points"))
    return Panel(y=f"{found.name} [%]", title=title, lines=lines)


def _over_covariate(found: WearVerdict, name: str, values: Array) -> Chart:
    """Return the estimates over a covariate, those before a change apart from those after it."""
    x, turn = values[found.logs], [c.place for c in found.found.changes[:1]]
    y = found.percent(found.series.value - found.found.level)
    parts = zip(("before the change" if turn else "logs", "after it"),
                *(np.split(side, turn) for side in (x, y)), strict=False)  # fmt: skip
    order = np.argsort(x)
    explained = found.percent(found.found.of_covariates)[order]
    lines = [line(across, up, who, kind="points") for who, across, up in parts]
    lines.append(Line(who=f"what {name} explains", x=x[order], y=explained))
    return Chart(
        title=f"{found.name} over {name}",
        words=f"What {name} explains, and what it does not.",
        x=f"{name} [its unit]",
        panels=[Panel(y=f"{found.name} [%]", lines=lines)],
    )


def _parameters(trend: Trend) -> Table:
    columns = [Column(name, kind="text") for name in ("parameter", "verdict")]
    numbers = ("change [%]", *(f"{name} [%/unit]" for name in trend.covariates), "median [SI]",
               "± of a log [%]", "scatter between logs [%]")  # fmt: skip
    rows = [_line(one, trend) for one in trend.verdicts]
    return Table("Parameters", [*columns, *map(Column, numbers)], rows)


def _line(found: WearVerdict, trend: Trend) -> Row:
    slopes = zip(100 * found.found.slopes, 100 * found.found.slope_deviations, strict=True)
    sizes = [
        (float(found.percent(c.size)), found.percent_deviation(c)) for c in found.found.changes
    ]
    last = (
        (float(np.median([row["estimates"][found.name]["value"] for row in trend.good])), 5),
        (100 * float(np.median(found.series.deviation)), 2),
        (100 * found.found.scatter, 2),
    )
    cells = [
        Cell(found.name),
        Cell(WORDS[found.kind]),
        Cell(_signed(sizes) or "–", max((size for size, _ in sizes), key=abs, default="")),
        *(Cell(_signed([each]), each[0]) for each in slopes),
        *(Cell(f"{value:.{digits}g}", value) for value, digits in last),
    ]
    return Row(cells, kind="changed" if found.kind in {CHANGED, OPEN} else "")


def _signed(each: Sequence[tuple[float, float]]) -> str:
    return ", ".join(f"{value:+.3g} ± {sd:.1g}" for value, sd in each)
