"""The page of an import: what to doubt first, each with what to type and a chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.findings import Finding, ordered
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.pages.page import LogPage, gaps, line, panel
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.reporting.charts_old.charts import Chart
from flexaxis.experiments.reporting.charts_old.tables import Cell, Column, Row, Table
from flexaxis.sim.record import Record

COLUMNS = (
    Column("what was looked at", kind="text"),
    Column("measured", kind="text"),
    Column("verdict", kind="text"),
    Column("in words", kind="text"),
    Column("what to type", kind="command"),
)


def import_page(found: Imported, log: Path, command: str) -> LogPage:
    """Return the page of an import.

    Parameters
    ----------
    found : Imported
    log : Path
    command : str
        That made it.
    """
    doubts = ordered(found.checks)
    said = [replace(c, text=f"{c.name}: {c.sentence}") for c in doubts if c.kind != "ok"]
    charts, title = [log_chart(found.record), spectrum_chart(found.record)], f"Import of {log.name}"
    return LogPage(title, command, _finding(doubts), said, charts, [_table(doubts)])


def _finding(doubts: Sequence[Finding]) -> Finding:
    """Return what comes of all looks, in a sentence."""
    kinds = ("problem", "note")
    bad, known = (", ".join(d.name for d in doubts if d.kind == kind) for kind in kinds)
    if bad:
        return Finding("problem", f"As it is, this log spoils estimates: {bad}.")
    if known:
        return Finding("note", f"Nothing spoils estimates from this log; to be known: {known}.")
    return Finding("ok", f"Nothing speaks against this log, in {len(doubts)} looks at it.")


def _table(checks: Sequence[Finding]) -> Table:
    rows = [
        Row([
            Cell(c.name),
            Cell(c.measured, c.value),
            Cell(c.kind),
            Cell(c.text),
            Cell(c.command),
        ])
        for c in checks
    ]  # fmt: skip
    return Table("Plausibility", COLUMNS, rows)


def log_chart(record: Record) -> Chart:
    """Return torque and motion over time."""
    motion = np.asarray(getattr(record, output_of(record)))
    return Chart(
        title="The log",
        words="Shaded: missing, or before the end of the burn-in.",
        x="time [s]",
        panels=[
            panel("torque [as logged]", line(record.time, record.torque)),
            panel("speed [rad/s]", line(record.time, motion)),
        ],
        spans=gaps(record.time, usable(record)),
    )


def spectrum_chart(record: Record) -> Chart:
    """Return the spectrum of the torque."""
    seen = spectra(record.torque, record.torque, record.period)
    density = line(seen.frequency[1:], np.sqrt(seen.torque[1:]))
    return Chart(
        title="What the torque excites",
        words="Amplitude spectral density of the torque, over segments of 4 s.",
        x="frequency [Hz]",
        panels=[panel("torque [as logged, per √Hz]", density, y_log=True)],
        x_log=True,
    )
