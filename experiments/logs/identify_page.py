"""The page of an identification: estimates, the frequency response, another log."""

from __future__ import annotations

from collections.abc import Sequence

from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.identify_words import UNITS, facts, rows, warnings
from flexaxis.experiments.logs.log_charts import bode_chart, validation_chart
from flexaxis.experiments.logs.log_page import LogPage, Remark
from flexaxis.experiments.logs.validate import Validation
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, texts

TOLD = 3  # estimates in the sentence that the page begins with
COLUMNS = (
    Column("parameter", kind="text"),
    Column("estimate [SI]"),
    Column("standard deviation [SI]"),
    Column("of the value [%]"),
    Column("of noise alone [SI]", more=True),
    Column("over pieces [SI]", more=True),
)


def identification_page(
    found: Identification, period: float, tried: Validation | None, title: str, command: str
) -> LogPage:
    """Return the page of it."""
    charts: list[Chart] = [] if found.response is None else [bode_chart(found, period)]
    charts += [] if tried is None else [validation_chart(tried)]
    against = warnings(found, tried)
    return LogPage(
        title=title,
        command=command,
        finding=_finding(found, against),
        remarks=[
            *(("problem", text) for text in against),
            *(("ok", text) for text in found.remarks),
        ],
        charts=charts,
        tables=[
            Table("Estimates", COLUMNS, [_row(*row) for row in rows(found)]),
            texts("How far to trust them", ("what", "here"), facts(found, tried)),
        ],
    )


def _finding(found: Identification, against: Sequence[str]) -> Remark:
    """Return what was identified, how well, and how many doubts there are, in a sentence."""
    sure = [
        (sd / abs(value), f"{name} = {value:.4g} ± {sd:.1g}")
        for name, value, sd, *_ in rows(found)
        if sd and name in found.names and value
    ]
    best = [text for _, text in sorted(sure)]
    told = ", ".join(best[:TOLD]) + (f" and {len(best) - TOLD} more" if len(best) > TOLD else "")
    known = f"; surest: {told}" if told else ""
    text = f"The model simulates {found.fit:.1f} % of the log from its torque alone{known}."
    if against:
        count = "One thing speaks" if len(against) == 1 else f"{len(against)} things speak"
        return "problem", f"{text} {count} against it, first: {against[0].rstrip('.')}."
    return "ok", text


def _row(name: str, *values: float) -> Row:
    value, sd, noise, pieces = values
    share = 100 * sd / abs(value) if abs(value) > sd else None
    return Row([
        Cell(name + UNITS.get(name, ""), name),
        Cell(f"{value:.5g}", value),
        Cell(f"{sd:.2g}" if sd else "–", sd or ""),
        Cell(f"{share:.2g}" if share else "–", share or ""),
        *(Cell(f"{v:.2g}", v) for v in (noise, pieces)),
    ])  # fmt: skip
