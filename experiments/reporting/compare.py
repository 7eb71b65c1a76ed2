"""The page of a comparison: the verdict first, then changes with intervals, then all scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.figures import Series, curves, verdict_intervals
from flexaxis.experiments.reporting.tables import Cell, Table

Row = Mapping[str, Any]
SIDES = ("base", "candidate")


def render(verdict: Row, worst: Row | None = None) -> str:
    """Return the page of a comparison as HTML.

    Parameters
    ----------
    verdict : mapping
        As `flexaxis compare --json` prints it.
    worst : mapping, optional
        Both runs where the candidate compares worst: ``time`` (M,) [s], ``truth``, ``base`` and
        ``candidate`` (M,) over nominal, and ``parameter``.
    """
    looks, rows, figures = page.looks_of(SIDES), verdict["rows"], []
    if any(row["interval"] for row in rows):
        figures.append(page.drawn(verdict_intervals, "change of each score", rows))
    if worst:
        series = [Series(x=worst["time"], y=worst[side], estimator=side) for side in SIDES]
        series.append(Series(x=worst["time"], y=worst["truth"], role="truth"))
        panels = {f"{worst['parameter']} / nominal": series}
        figures.append(page.drawn(curves, "worst run", panels, x="time [s]", height=300))
    lines = [("", [Cell(text) for text in row["text"]]) for row in rows]
    return page.render(
        "reporting/templates/compare.html",
        title=verdict["headline"],
        verdict=verdict,
        looks=looks if worst else {},
        figures=figures,
        table=Table("all scores", verdict["columns"], lines, verdict["legend"]),
    )
