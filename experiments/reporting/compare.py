"""The page of a comparison: the verdict first, then changes with intervals, then all scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.figures import verdict_intervals
from flexaxis.experiments.reporting.tables import Cell, Table

Row = Mapping[str, Any]


def render(verdict: Row) -> str:
    """Return the page of a comparison as HTML.

    Parameters
    ----------
    verdict : mapping
        As `flexaxis compare --json` prints it.
    """
    rows, figures = verdict["rows"], []
    if any(None not in row["interval"] for row in rows):
        figures.append(page.drawn(verdict_intervals, "change of each score", rows))
    lines = [("", [Cell(text) for text in row["text"]]) for row in rows]
    return page.render(
        "reporting/templates/compare.html",
        title=verdict["headline"],
        verdict=verdict,
        looks={},
        figures=figures,
        table=Table("all scores", verdict["columns"], lines, verdict["legend"]),
    )
