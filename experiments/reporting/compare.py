"""The page of a comparison: the verdict first, then changes with intervals, then all scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.figures import Series, curves, verdict_intervals
from flexaxis.experiments.reporting.tables import Cell, Table

Row = Mapping[str, Any]
SIDES = ("base", "candidate")
DRAWN = 30  # changes in the figure, the most important first


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
    looks, rows = page.looks_of(SIDES), changes(verdict)[:DRAWN]
    figures = [page.drawn(verdict_intervals, "change of each score", rows)] if rows else []
    if worst:
        series = [Series(x=worst["time"], y=worst[side], estimator=side) for side in SIDES]
        series.append(Series(x=worst["time"], y=worst["truth"], role="truth"))
        panels = {f"{worst['parameter']} / nominal": series}
        figures.append(page.drawn(curves, "worst run", panels, x="time [s]", height=300))
    lines = [("", [Cell(text) for text in row["text"]]) for row in verdict["rows"]]
    return page.render(
        "reporting/templates/compare.html",
        title=verdict["headline"],
        verdict=verdict,
        looks=looks if worst else {},
        figures=figures,
        table=Table("all scores", verdict["columns"], lines, verdict["legend"]),
    )


def changes(verdict: Row) -> list[dict[str, Any]]:
    """Return the rows that have a change, as `figures.verdict_intervals` takes them."""
    return [
        {
            "name": f"{row['metric']} of {row['parameter']}, {row['scenario']}",
            "verdict": row["verdict"],
            "change": row["change"] / (row["scale"] or 1),
            "interval": [end / (row["scale"] or 1) for end in row["interval"]],
            "margin": (row["margin"] or 0) / (row["scale"] or 1),
        }
        for row in verdict["rows"]
        if row["change"] is not None and row["interval"] is not None
    ]
