"""The page of an estimator on a record: its estimates over time, the residual, the load angle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.curves import gaps, line, thinned
from flexaxis.experiments.logs.log_page import LogPage, Remark, capital
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table
from flexaxis.experiments.reporting.thinning import extremes

Array = NDArray[np.float64]

LAGS = 60  # samples back, to which the correlation of the residual is drawn
LEAST = 0.01  # of nominal: less is not worth a word
BEFORE, AFTER = 1.0, 5.0  # s about the first change, that is shown beside the whole
COLUMNS = (
    Column("parameter", kind="text"),
    Column("last estimate [SI]"),
    Column("nominal [SI]"),
    Column("over nominal"),
)


def track_page(
    found: Tracked,
    period: float,
    estimator: str,
    *,
    remarks: Sequence[Remark],
    problems: Sequence[str],
    log: str,
    command: str,
) -> LogPage:
    """Return the page.

    Parameters
    ----------
    found : Tracked
    period : float
        [s].
    estimator : str
        As typed.
    remarks : sequence of (kind, text)
        What was found, the most important first.
    problems : sequence of str
        What spoils estimates from this log.
    log, command : str
        Name of the log, and the line that makes this again.
    """
    said = [*(("problem", f"the log: {text}") for text in problems), *remarks]
    rows = [
        Row([Cell(name), *(Cell(f"{v:.5g}", v) for v in (last, nominal, last / nominal))])
        for name, last, nominal in zip(
            found.names, found.last.tolist(), found.nominal.tolist(), strict=True
        )
    ]
    charts = [estimates_chart(found, estimator), residual_chart(found, period)]
    charts += [load_chart(found)] if found.load is not None else []
    return LogPage(
        title=f"{estimator} on {log}",
        command=command,
        finding=_finding(found, remarks, problems),
        remarks=said,
        charts=charts,
        tables=[Table("Last estimates", COLUMNS, rows, "Median of the last fifth of the log.")],
    )


def _finding(found: Tracked, said: Sequence[Remark], problems: Sequence[str]) -> Remark:
    """Return the worst of what was found, all changes where several parameters changed."""
    kind = next((kind for kind in ("problem", "note") if said[0][0] == kind), "ok")
    changes = [text for each, text in said if each == kind and " changed by " in text]
    text = "; ".join(changes) if changes else said[0][1]
    if kind == "ok":
        over = zip(found.names, found.last / found.nominal, strict=True)
        text += f"; last over nominal: {', '.join(f'{n} {v:.3f}' for n, v in over)}"
        text += _off(found)
    text = capital(text)
    if problems:
        return "problem", f"{text} But the log itself spoils estimates, see below."
    return kind, text


def _off(found: Tracked) -> str:
    """Return what was another than nominal all along, by more than its claimed two deviations."""
    if found.deviations is None or not found.usable.any():
        return ""
    spread = 2 * found.deviations[np.flatnonzero(found.usable)[-1]]
    told = [
        f"{name} is {abs(off):.0%} {'above' if off > 0 else 'below'}".replace("%", " %")
        for name, off, by in zip(
            found.names,
            (found.last - found.nominal) / np.abs(found.nominal),
            np.abs(found.last - found.nominal) - spread,
            strict=True,
        )
        if by > 0 and abs(off) >= LEAST
    ]
    return f"; no change within this log, but {', '.join(told)} what was identified" if told else ""


def estimates_chart(found: Tracked, estimator: str) -> Chart:
    """Return the estimates over time with a ±2σ band, over nominal."""
    marks = [(c.time, f"{c.name} {100 * c.relative:+.1f} %") for c in found.changes]
    claimed = ", with what the estimator claims as ±2σ" if found.deviations is not None else ""
    return Chart(
        title="Estimates",
        words=f"Over nominal{claimed}. Shaded: not used. Vertical: changes that were found, and "
        f"alarms of the estimator.{thinned(found.time)}",
        x="time [s]",
        panels=[_panel(found, i, estimator) for i in range(len(found.names))],
        marks=[*marks, *((float(at), "alarm") for at in found.alarms)],
        spans=gaps(found.time, found.usable),
        windows=_windows(found),
    )


def _windows(found: Tracked) -> list[tuple[str, float, float]]:
    whole = ("whole log", float(found.time[0]), float(found.time[-1]))
    if not found.changes:
        return [whole]
    at = found.changes[0].time
    begin, end = max(at - BEFORE, whole[1]), min(at + AFTER, whole[2])
    return [("at the change", begin, end), whole] if begin < end else [whole]


def _panel(found: Tracked, i: int, estimator: str) -> Panel:
    nominal = found.nominal[i]
    values, band = found.theta[:, i] / nominal, np.zeros(len(found.time))
    if found.deviations is not None:
        band = 2 * found.deviations[:, i] / abs(nominal)
    kept = extremes(found.time, values)
    x, y = found.time[kept], values[kept]
    sides = {"low": y - band[kept], "high": y + band[kept]} if found.deviations is not None else {}
    ends = found.time[[0, -1]]
    one = Line(x=ends, y=np.ones(2), role="bound", label="nominal: as identified")
    low, high = np.nanpercentile(values[len(values) // 50 :], [0.5, 99.5])
    room = max(0.1 * (high - low), 0.02)
    return Panel(
        y=f"{found.names[i]} / nominal",
        lines=[Line(who=estimator, x=x, y=y, **sides), one],
        y_range=(float(low - room), float(high + room)),
    )


def residual_chart(found: Tracked, period: float) -> Chart:
    """Return the correlation of the residual with its past, and the band of white noise."""
    error = found.residual[found.usable]
    error = error - error.mean()
    lags = np.arange(1, LAGS + 1)
    values = np.array([error[k:] @ error[: len(error) - k] for k in lags]) / (error @ error)
    x, edge = 1e3 * period * lags, np.full(2, 2 / np.sqrt(len(error)))
    stems = Line(
        who="residual", kind="points", x=x, y=values,
        low=np.minimum(values, 0.0), high=np.maximum(values, 0.0),
    )  # fmt: skip
    white = Line(
        x=x[[0, -1]], y=np.zeros(2), low=-edge, high=edge, role="bound", label="±2σ of white noise"
    )
    height = max(1.3 * float(np.max(np.abs(values))), 0.1)
    return Chart(
        title="Residual",
        words="Correlation of the whitened residual with its past: what the model leaves.",
        x="samples before, as time [ms]",
        panels=[Panel(y="correlation", lines=[white, stems], y_range=(-height, height))],
    )


def load_chart(found: Tracked, seconds: float = 0.5) -> Chart:
    """Return a piece of the predicted load angle over the hidden encoder, and the error."""
    assert found.load is not None
    good = np.flatnonzero(found.usable)
    start = found.time[good[len(good) // 2]]
    piece = (found.time >= start) & (found.time < start + seconds)
    time, measured, predicted = (
        side[piece] for side in (found.time, found.load.measured, found.load.predicted)
    )
    return Chart(
        title="Load angle",
        words="Half a second from the middle of the log; the load encoder was hidden.",
        x="time [s]",
        panels=[
            Panel(
                y="load angle [rad]",
                lines=[
                    Line(x=time, y=measured, role="truth", label="load encoder, hidden"),
                    line(time, predicted, "from motor angle and model"),
                ],
            ),
            Panel(y="error [rad]", lines=[line(time, measured - predicted, "difference")]),
        ],
    )
