"""The demo in words: the table of estimates, and the table of what was done."""

from __future__ import annotations

from html import escape
from math import isnan

import numpy as np

from flexaxis.experiments.demo.charts import COLOURS, THEORY
from flexaxis.experiments.demo.history import Entry, History
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.demo.session import DemoSession

ROWS = 40
"""Entries that the page shows; a file has them all."""


def estimates_table(session: DemoSession) -> str:
    """Return truth, estimates and the lags of the last change, as Markdown."""
    lines = [
        "| | truth | " + " | ".join(_heads(session)) + f" | {_grey('theory allows')} |",
        "|---|---|---|---|---|",
    ]
    truth = session.axis.theta(SHOWN)
    estimates = [racer.shown(racer.theta) for racer in session.racers]
    for i, name in enumerate(SHOWN):
        if i < len(NAMES) or truth[i]:
            cells = [truth[i], *(estimate[i] for estimate in estimates)]
            lines.append(f"| {name} | " + " | ".join(map(_value, cells)) + " | |")
    if (last := session.history.last) is not None and last.pursuit and last.pursuit.changed:
        cells = [_seconds(lag) for lag in last.lags]
        lines.append(f"| **lag** [s] | | {' | '.join(cells)} | {_grey(_range(last))} |")
    return "\n".join(lines)


def history_table(history: History) -> str:
    """Return what was done, the last on top, as HTML."""
    if not history.entries:
        return "<p>Nothing has been done yet: break it.</p>"
    rows = "".join(map(_row, list(history.entries)[: -ROWS - 1 : -1]))
    heads = ("t [s]", "what", "A says", "B says", "lag A", "lag B", "allowed")
    cells = "".join(
        f'<th style="text-align:left;padding:2px 3px;white-space:nowrap;color:{colour}">{head}</th>'
        for head, colour in zip(
            heads, ("inherit", "inherit", *COLOURS, *COLOURS, THEORY), strict=True
        )
    )
    return (
        '<div style="overflow-x:auto">'
        '<table class="history" style="font-size:12px;border-collapse:collapse;width:100%">'
        f"<tr>{cells}</tr>{rows}</table></div>"
    )


def _row(entry: Entry) -> str:
    cells = [f"{entry.time:.1f}", entry.what]
    if entry.pursuit is None:
        cells += 5 * [""]
    else:
        cells += [_says(entry, racer) for racer in range(len(entry.racers))]
        cells += [_seconds(lag) for lag in entry.lags] + [_range(entry)]
    style = "padding:2px 4px;border-top:1px solid #ddd;vertical-align:top"
    return "<tr>" + "".join(f'<td style="{style}">{escape(cell)}</td>' for cell in cells) + "</tr>"


def _says(entry: Entry, racer: int) -> str:
    """Return what an estimator said of a change: what it found and when, or where it got to."""
    found = entry.found[racer] if racer < len(entry.found) else []
    if found:
        after, what = found[0]
        return f"{what} after {after:.2g} s"
    if not entry.estimates or entry.pursuit is None:
        return "nothing"
    value = entry.estimates[racer]
    if isnan(value):
        return f"has no {entry.pursuit.changed}"
    return f"{entry.pursuit.changed} = {value:.3g}"


def _range(entry: Entry) -> str:
    single, unknown = entry.allowed
    if single is None or unknown is None:
        return "–"
    low, high = f"{single:.2g}", f"{unknown:.2g}"
    return low if low == high else f"{low}–{high}"


def _heads(session: DemoSession) -> list[str]:
    return [
        f'<span style="color:{colour}">{letter}: {racer.text}</span>'
        for colour, letter, racer in zip(COLOURS, "AB", session.racers, strict=True)
    ]


def _grey(text: str) -> str:
    return f'<span style="color:{THEORY}">{text}</span>'


def _value(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.4g}"


def _seconds(lag: float | None) -> str:
    return "–" if lag is None else f"{lag:.2g}"
