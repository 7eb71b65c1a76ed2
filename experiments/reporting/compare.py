"""The page of a comparison: the verdict first, changes with intervals, all scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

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
    looks = page.looks_of(SIDES) if worst else {}
    rows = changes(verdict)
    return page.render(
        "reporting/templates/compare.html",
        title=verdict["headline"],
        verdict=verdict,
        looks=looks,
        changes=page.drawn(verdict_intervals, "changes", rows[:DRAWN]) if rows else Markup(),
        worst=_worst(worst, looks) if worst else Markup(),
        table=_table(verdict),
    )


def changes(verdict: Row) -> list[dict[str, Any]]:
    """Return the rows that have a change, as `figures.verdict_intervals` takes them."""
    found = []
    for row in verdict["rows"]:
        if row["change"] is None or row["interval"] is None:
            continue
        scale = row["scale"] or 1.0
        found.append(
            {
                "name": f"{row['metric']} of {row['parameter']}, {row['scenario']}",
                "verdict": row["verdict"],
                "change": row["change"] / scale,
                "interval": [end / scale for end in row["interval"]],
                "margin": (row["margin"] or 0.0) / scale,
            }
        )
    return found


def _worst(worst: Row, looks: Any) -> Markup:
    series = [Series(x=worst["time"], y=worst[side], estimator=side) for side in SIDES]
    series.append(Series(x=worst["time"], y=worst["truth"], role="truth"))
    return page.drawn(
        curves,
        "worst run",
        {f"{worst['parameter']} / nominal": series},
        x="time [s]",
        height=280,
        looks=looks,
    )


def _table(verdict: Row) -> Table:
    lines: list[tuple[str, Sequence[Cell]]] = []
    for row in verdict["rows"]:
        scenario, score, base, candidate, *rest = row["text"]
        values = (Cell(base, _sorted(row["base"])), Cell(candidate, _sorted(row["candidate"])))
        change = Cell(rest[0], _sorted(row["change"]))
        lines.append(("", [Cell(scenario), Cell(score), *values, change, *map(Cell, rest[1:])]))
    return Table("all scores", verdict["columns"], lines, verdict["legend"])


def _sorted(value: float | None) -> float | str:
    return "" if value is None else value
