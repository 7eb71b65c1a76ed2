"""The pooled scores as a table in the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from flexaxis.experiments.report import number, settled

CAPTION = """\
lag after the fault, ± 95 % half-width over seeds; std before it [% of nominal]
score: 0 for doing nothing, 100 on the oracle Cramér–Rao bound (steps only)
x-talk: largest error caused in another parameter [% of nominal]
lost: diverged runs; open: runs never settled; µs: time per sample"""


def score_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return a line per scenario and estimator, on the parameter that changed.

    Without a fault there is one for each parameter.
    """
    table = Table(box=None, padding=(0, 1, 0, 0), caption=CAPTION, caption_justify="left")
    for heading in ("estimator", "θ"):
        table.add_column(heading, no_wrap=True)
    for heading in ("lag [s]", "t10 [s]", "score", "std %", "x-talk", "lost", "open", "µs"):
        table.add_column(heading, justify="right", no_wrap=True)
    faulted = {row["scenario"] for row in rows if row["changed"]}
    shown = [row for row in rows if row["changed"] or row["scenario"] not in faulted]
    for before, row in zip([None, *shown[:-1]], shown, strict=True):
        if before is None or before["scenario"] != row["scenario"]:
            table.add_row(f"[bold]{row['scenario']}[/]")
        cells = _cells(row, _cross_talk(rows, row))
        table.add_row(*cells, style="red" if row["diverged"] else None)
    return table


def _cells(row: Mapping[str, Any], cross_talk: float | None) -> list[str]:
    changed = row["changed"]
    return [
        "  " + escape(row["estimator"]),  # brackets are mark-up here
        row["parameter"],
        _with_half_width(row["lag"], row["lag_interval"]),
        settled(row["t10"], changed),
        _score(row.get("score")),
        number(row["std"], 2),
        number(cross_talk, 2),
        str(row["diverged"]),
        str(row["never_settled"]) if changed else "–",
        _cost(row["cost"]["us_per_sample"]),
    ]


def _with_half_width(
    value: float | None, interval: Sequence[float] | None, *, digits: int = 2
) -> str:
    if interval is None or interval[0] == interval[1]:
        return number(value, digits)
    return f"{number(value, digits)} ±{(interval[1] - interval[0]) / 2:.1g}"


def _score(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"


def _cost(microseconds: float) -> str:
    return f"{microseconds:.2f}" if microseconds < 10 else f"{microseconds:.0f}"


def _cross_talk(rows: Sequence[Mapping[str, Any]], row: Mapping[str, Any]) -> float | None:
    """Return the largest error that the fault causes in another parameter."""
    others = [
        other["cross_talk"]
        for other in rows
        if (other["scenario"], other["estimator"]) == (row["scenario"], row["estimator"])
        and other["cross_talk"] is not None
    ]
    return max(others, default=None)
