"""The page of an identification: estimates, the frequency response, another log."""

from __future__ import annotations

from collections.abc import Sequence

from flexaxis.experiments.logs.findings import texts_of
from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.identify_words import UNITS, facts, findings, rows
from flexaxis.experiments.logs.log_charts import (
    bode_chart,
    map_charts,
    simulation_chart,
    validation_chart,
)
from flexaxis.experiments.logs.log_page import LogPage, Remark
from flexaxis.experiments.logs.validate import Validation
from flexaxis.experiments.logs.ways import Way
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, texts

TOLD = 3  # estimates in the sentence that the page begins with
COLUMNS = (
    Column("parameter", kind="text"),
    Column("estimate [SI]"),
    Column("standard deviation [SI]"),
    Column("of the value [%]"),
)


def identification_page(
    found: Identification, period: float, tried: Validation | None, title: str, command: str
) -> LogPage:
    """Return the page of it."""
    charts = identification_charts(found, period)
    charts += [] if tried is None else [validation_chart(tried)]
    every = findings(found, tried)
    names = [f"{name}{UNITS.get(name, '')}" for name in found.names]
    fits = [(way.name, _of_way(way, names)) for way in found.ways]
    return LogPage(
        title=title,
        command=command,
        finding=_finding(found, texts_of(every, "problem")),
        remarks=[(each.kind, each.text) for each in every],
        charts=charts,
        tables=[
            Table("Estimates", COLUMNS, [_row(*row) for row in rows(found)]),
            texts("Three fits, one answer", ("fit", "its estimates"), fits),
            texts("How far to trust them", ("what", "here"), facts(found, tried)),
        ],
    )


def identification_charts(found: Identification, period: float) -> list[Chart]:
    """Return the motion with its simulation, the friction map, and the frequency response."""
    charts: list[Chart] = [simulation_chart(found, period)]
    charts += [] if found.map is None else map_charts(found)
    return charts + ([] if found.response is None else [bode_chart(found, period)])


def _of_way(way: Way, names: Sequence[str]) -> str:
    told = zip(names, way.fitted.z, way.deviations, strict=False)
    values = ", ".join(f"{name} {value:.4g} ± {sd:.1g}" for name, value, sd in told)
    return f"{values}; error of a simulation of held-out pieces {way.error:.4g}"


def _finding(found: Identification, against: Sequence[str]) -> Remark:
    """Return what was identified, how well, and how many doubts there are, in a sentence."""
    sure = [
        (sd / abs(value), f"{name} = {value:.4g} ± {sd:.1g}")
        for name, value, sd in rows(found)
        if sd and name in found.names and value
    ]
    best = [text for _, text in sorted(sure)]
    told = ", ".join(best[:TOLD]) + (f" and {len(best) - TOLD} more" if len(best) > TOLD else "")
    known = f"; surest: {told}" if told else ""
    text = (
        f"The model simulates {found.fit:.1f} % of what it was not fitted to from the torque "
        f"alone{known}."
    )
    if against:
        count = "One thing speaks" if len(against) == 1 else f"{len(against)} things speak"
        return "problem", f"{text} {count} against it, first: {against[0].rstrip('.')}."
    return "ok", text


def _row(name: str, value: float, sd: float) -> Row:
    share = 100 * sd / abs(value) if abs(value) > sd else None
    return Row([
        Cell(name + UNITS.get(name, ""), name),
        Cell(f"{value:.5g}", value),
        Cell(f"{sd:.2g}" if sd else "–", sd or ""),
        Cell(f"{share:.2g}" if share else "–", share or ""),
    ])  # fmt: skip
