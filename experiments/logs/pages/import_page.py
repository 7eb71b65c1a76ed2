"""The page of an import: what to doubt first, each with what to type and a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from flexaxis.experiments.logs.findings import Finding, ordered
from flexaxis.experiments.logs.identification.visibility import Seen
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.pages.charts import log_chart, spectrum_chart
from flexaxis.experiments.logs.pages.page import LogPage
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, texts

COLUMNS = (
    Column("what was looked at", kind="text"),
    Column("measured", kind="text"),
    Column("verdict", kind="text"),
    Column("in words", kind="text"),
    Column("what to type", kind="command"),
)


def import_page(found: Imported, seen: Mapping[str, Seen], log: Path, command: str) -> LogPage:
    """Return the page of an import.

    Parameters
    ----------
    found : Imported
    seen : mapping of str to Seen
        What the excitation tells of each parameter, if a model was named.
    log : Path
    command : str
        That made it.
    """
    doubts = ordered(found.checks)
    said = [replace(c, text=f"{c.name}: {c.sentence}") for c in doubts if c.kind != "ok"]
    charts, title = [log_chart(found.record), spectrum_chart(found.record)], f"Import of {log.name}"
    return LogPage(title, command, _finding(doubts), said, charts, _tables(doubts, seen))


def _finding(doubts: Sequence[Finding]) -> Finding:
    """Return what comes of all looks, in a sentence."""
    kinds = ("problem", "note")
    bad, known = (", ".join(d.name for d in doubts if d.kind == kind) for kind in kinds)
    if bad:
        return Finding("problem", f"As it is, this log spoils estimates: {bad}.")
    if known:
        return Finding("note", f"Nothing spoils estimates from this log; to be known: {known}.")
    return Finding("ok", f"Nothing speaks against this log, in {len(doubts)} looks at it.")


def _tables(checks: Sequence[Finding], seen: Mapping[str, Seen]) -> list[Table]:
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
    tables = [Table("Plausibility", COLUMNS, rows)]
    if seen:
        lines = [(name, one.words) for name, one in seen.items()]
        head = ("parameter", "in words")
        tables.append(texts("What the excitation tells of each parameter", head, lines))
    return tables
