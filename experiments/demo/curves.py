"""What the demo shows: charts of estimates, of what is left to be found, of the trade-off; tables.

The page shows them as every page does (`reporting.drawing`), a recording by matplotlib
(`reporting.figures`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.history import History, HistoryLine
from flexaxis.experiments.demo.racer import NAMES, SHOWN, Racer
from flexaxis.experiments.demo.session import SPAN, Curves, DemoSession
from flexaxis.experiments.demo.tracking import LENGTH, Point
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel, Role
from flexaxis.experiments.reporting.charts_old.page import macros
from flexaxis.experiments.reporting.styles import NINE, Style, style
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]

RACERS = ("A", "B")
OTHERS = "another"
STYLES: Mapping[str, Style] = {
    **{name: style(name) for name in (*SHOWN, OTHERS)},
    **{who: replace(look, dash="") for who, look in zip(RACERS, NINE, strict=False)},
    **{
        f"{who} {name}": replace(look, marker=marker)
        for who, look in zip(RACERS, NINE, strict=False)
        for name, marker in zip(NAMES, "s^o", strict=True)
    },
}
"""Of the two racers, whoever they are; of their points in the trade-off, one for each parameter."""
KEY = ", ".join(f"{sign} {name}" for sign, name in zip("■▲●", NAMES, strict=True))
COLOURS = tuple(STYLES[who].light for who in RACERS)
THEORY = "theory allows"
TABLES = "demo/tables.html"

POINTS = np.unique(np.geomspace(1, LENGTH, 160).astype(int)) - 1
"""Samples after the change that are drawn: evenly on a logarithmic axis."""
TOP, ALIEN_TOP = 120.0, 38.0
"""Per cent of a change that is shown; of what nobody estimates, of what it is taken for."""
P_RANGE = (1e-7, 0.4)

LIKELY = 0.02  # probability from which on it is drawn when a hypothesis says that it began


def unit(name: str) -> str:
    """Return the unit of an estimated parameter."""
    parameter, exponent = physical(name)
    text = (PARAMETER_UNITS | LAW_UNITS)[parameter].replace("^2", "²")
    return text if exponent > 0 else f"1/({text})"


def estimates(curves: Curves, begin: float | None = None) -> Chart:
    """Return the last seconds: a panel a parameter, with truth and claimed bands, and diag P.

    Parameters
    ----------
    curves : Curves
    begin : float, optional
        Where the axis of time begins [s]; as late as the curves by default.
    """
    rubbing = bool(curves.truth[:, len(NAMES) :].any())
    shown = range(len(SHOWN) if rubbing else len(NAMES))
    panels = [_estimate(curves, i) for i in shown]
    if not rubbing:  # dry friction, where there is some, takes its place
        panels.append(_diagonal(curves))
    now = float(curves.time[-1]) if len(curves.time) else SPAN
    begin = now - SPAN if begin is None else begin
    return Chart(
        title="Estimates",
        words="",
        x="time [s]",
        panels=panels,
        windows=[("", max(0.0, begin), max(begin, 0.0) + SPAN)],
    )


def _estimate(curves: Curves, i: int) -> Panel:
    lines = [Line(x=curves.time, y=curves.truth[:, i], role="truth", label="truth")]
    for racer, who in enumerate(RACERS):
        theta, band = curves.theta[:, racer, i], 2 * np.nan_to_num(curves.deviation[:, racer, i])
        lines.append(Line(who=who, x=curves.time, y=theta, low=theta - band, high=theta + band))
    truth = curves.truth[:, i]
    low, high = (float(truth.min()), float(truth.max())) if len(truth) else (0.0, 0.0)
    room = max(high - low, 0.1 * high) or 1.0  # a burst may leave, and noise does not fill it
    shown = low - room, high + room
    return Panel(y=f"{SHOWN[i]} [{unit(SHOWN[i])}]", lines=lines, y_range=shown)


def _diagonal(curves: Curves) -> Panel:
    dashes: Sequence[Role] = ("estimate", "truth", "bound")
    lines = [
        Line(who=who, x=curves.time, y=curves.P[:, racer, i], role=role, label=f"{who}: {name}")
        for racer, who in enumerate(RACERS)
        for i, (name, role) in enumerate(zip(NAMES, dashes, strict=True))
    ]
    return Panel(y="diag P", lines=lines, y_log=True, y_range=P_RANGE)


def bank(racer: Racer) -> Chart:
    """Return what a bank of hypotheses has thought since the last change: what jumped, and when."""
    time = np.arange(1.0, len(racer.thoughts) + 1) * PERIOD
    shown = {name: np.array([thought.get(name, (0.0, np.nan)) for thought in racer.thoughts])
             for name in (*SHOWN, OTHERS)}  # fmt: skip
    shown[OTHERS] = np.array([_others(thought) for thought in racer.thoughts])
    what, when = [], []
    for name, rows in ((n, r.reshape(-1, 2)) for n, r in shown.items()):
        line = Line(who=name, label=name, role="data", x=time, y=100 * rows[:, 0])
        begun = np.where(rows[:, 0] > LIKELY, time - (rows[:, 1] + 1) * PERIOD, np.nan)
        what.append(line)
        when.append(replace(line, y=begun, kind="points" if len(time) < 2 else "line"))
    found = [(len(time) - ago, words) for ago, words in racer.findings]
    return Chart(
        title=f"The bank of {racer.text}: what has jumped",
        words="",
        x="time since the change [s]",
        panels=[
            Panel(y="probability [%]", lines=what, y_range=(0.0, 103.0)),
            Panel(y="when [s]", lines=when, y_range=(-0.5, 1.5)),
        ],
        marks=[(at * PERIOD, f"found: {words}") for at, words in found if at > 0],
        windows=[("", PERIOD, WINDOW)],
        x_log=True,
    )


def _others(thought: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    """Return the most likely of what is not shown by name."""
    return max((t for name, t in thought.items() if name not in SHOWN), default=(0.0, np.nan))


OWN: Mapping[str, Callable[[Racer], Chart]] = {"glr": bank}
"""What an estimator shows of itself, by its name: a function from the racer, as it stands, to a
chart. It is drawn below the curves."""


def left(entry: HistoryLine | None) -> Chart:
    """Return how much of the last change each racer has still to find, and what theory allows."""
    tracking = entry.tracking if entry else None
    known = tracking is None or tracking.changed is not None
    lines = []
    if tracking is not None and len(tracking.error) > 1:
        rows = POINTS[: np.searchsorted(POINTS, len(tracking.error))]
        time = tracking.time[rows]
        if (allowed := tracking.allowed) is not None:
            single, unknown = 100 * allowed.error[rows].T
            lines.append(
                Line(x=time, y=unknown, low=single, high=unknown, role="bound", label=THEORY)
            )
        errors = 100 * np.minimum(tracking.error[rows], TOP / 100)
        lines += [Line(who=who, x=time, y=y) for who, y in zip(RACERS, errors.T, strict=True)]
    what = "left of the fault [%]" if known else "what it is taken for [%]"
    return Chart(
        title=_title(entry),
        words="",
        x="time since the change [s]",
        panels=[Panel(y=what, lines=lines, y_range=(0.0, TOP if known else ALIEN_TOP))],
        windows=[("", PERIOD, WINDOW)],
        x_log=True,
    )


def _title(entry: HistoryLine | None) -> str:
    if entry is None or entry.tracking is None:
        return "break it: what is left to be found over time"
    what = entry.what.partition(" (")[0]
    meant = "left to be found" if entry.tracking.changed else "what it is taken for"
    return f"{what}: {meant}"


def tradeoff(points: Sequence[Point], allowed: tuple[float | None, float | None]) -> Chart:
    """Return how late each fault was followed, over how noisy the estimate was before it."""
    lines = []
    single, unknown = allowed
    if single is not None and unknown is not None:
        ends = np.array([0.01, 80.0])
        sides = (np.full(2, value) for value in (unknown, single, unknown))
        y, low, high = sides
        lines.append(Line(x=ends, y=y, low=low, high=high, role="bound", label=THEORY))
    for racer, who in enumerate(RACERS):
        for name in NAMES:
            mine = [p for p in points if (p.racer, p.parameter) == (racer, name)]
            if mine:
                x, y = np.array([[p.std, p.lag] for p in mine]).T
                lines.append(Line(who=f"{who} {name}", x=x, y=y, kind="points"))
    return Chart(
        title="A point a fault",
        words="",
        x="std before the fault [% of nominal]",
        panels=[
            Panel(y="lag after it [s]", title=KEY, lines=lines, y_log=True, y_range=(0.01, 8.0))
        ],
        windows=[("", 0.01, 80.0)],
        x_log=True,
    )


GREY = "#777777"
"""The colour of what theory allows."""
ROWS = 40
"""Entries that the page shows; a file has them all."""


def estimates_table(session: DemoSession) -> str:
    """Return truth, estimates and the lags of the last change, as HTML."""
    truth = session.axis.theta(SHOWN)
    columns = [truth, *(racer.shown(racer.theta) for racer in session.racers)]
    rows = dict(zip(SHOWN, np.transpose(columns).tolist(), strict=True))
    if not truth[-1]:
        del rows[SHOWN[-1]]
    return str(macros(TABLES).estimates(session, rows))


def history_table(history: History) -> str:
    """Return what was done, the last on top, as HTML."""
    return str(macros(TABLES).history(list(history.entries)[: -ROWS - 1 : -1]))
