"""The page of an estimator on a record: its estimates over time, the residual, the load angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.identification.validate import MATCHED, correlations
from flexaxis.experiments.logs.pages.page import LogPage, capital, compared, gaps, panel
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.charts_old.tables import Cell, Column, Row, Table

Array = NDArray[np.float64]

LAGS = 60  # samples back, to which the correlation of the residual is drawn
LEAST = 0.01  # of nominal: less is not worth a word
COLUMNS = (
    Column("parameter", kind="text"),
    Column("last estimate [SI]"),
    Column("nominal [SI]"),
    Column("over nominal"),
)


def findings(found: Tracked) -> list[Finding]:
    """Return what was found, the most important first."""
    lines = [Finding("problem", text) for text in found.doubts]
    lines += [
        Finding(
            "note",
            f"{c.name} changed by {100 * c.relative:+.1f} % at {c.time:.2f} s "
            f"({c.scatters:.0f} times its scatter)",
        )
        for c in found.changes
    ]
    if not lines:
        lines.append(Finding("ok", "no parameter changed"))
    if not found.doubts:
        told = f"fit of a simulation from the torque alone: {found.fit:.1f} %"
        lines.append(Finding("ok" if found.fit > MATCHED else "note", told))
    text = f"residual: correlates with its past by {found.correlation:.3f}, "
    text += "white" if found.white else "so the estimates explain not all there is"
    lines.append(Finding("ok" if found.white else "note", text))
    if found.load is not None:
        text = f"fit of the load angle, which no estimator was given: {found.load.fit:.1f} %"
        lines.append(Finding("ok" if found.load.fit > MATCHED else "note", text))
    if len(found.alarms):
        lines.append(Finding("note", f"alarms of the estimator: {len(found.alarms)}"))
    return lines


def content(found: Tracked) -> dict[str, Any]:
    """Return it as JSON has it."""
    return {
        "last": dict(zip(found.names, found.last.tolist(), strict=True)),
        "nominal": dict(zip(found.names, found.nominal.tolist(), strict=True)),
        "fit": found.fit,
        "fit_load": None if found.load is None else found.load.fit,
        "residual": {"correlation": found.correlation, "white": found.white},
        "alarms": found.alarms.tolist(),
        "changes": [vars(change) for change in found.changes],
        "doubts": found.doubts,
    }


def track_page(
    found: Tracked,
    period: float,
    estimator: str,
    *,
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
    problems : sequence of str
        What spoils estimates from this log.
    log, command : str
        Name of the log, and the line that makes this again.
    """
    said = findings(found)
    charts = [estimates_chart(found, estimator), residual_chart(found, period)]
    charts += [load_chart(found)] if found.load is not None else []
    words = "Median of the last fifth of the log."
    table = Table("Last estimates", COLUMNS, estimates_of(found), words)
    told = _finding(found, said, problems)
    said = [*(Finding("problem", f"the log: {text}") for text in problems), *said]
    return LogPage(f"{estimator} on {log}", command, told, said, charts, [table])


def estimates_of(found: Tracked) -> list[Row]:
    """Return name, last estimate, nominal value and their ratio, a row each."""
    values = zip(found.names, found.last.tolist(), found.nominal.tolist(), strict=True)
    each = ((name, (f"{x:.5g}", x), (f"{of:.5g}", of), (f"{x / of:.4f}", x / of))
            for name, x, of in values)  # fmt: skip
    return [Row([Cell(name), *(Cell(*cell) for cell in cells)]) for name, *cells in each]


def _finding(found: Tracked, said: Sequence[Finding], problems: Sequence[str]) -> Finding:
    """Return the worst of what was found, all changes where several parameters changed."""
    kind = said[0].kind
    changes = [each.text for each in said if each.kind == kind and " changed by " in each.text]
    text = "; ".join(changes) if changes else said[0].text
    if kind == "ok":
        over = zip(found.names, found.last / found.nominal, strict=True)
        text += f"; last over nominal: {', '.join(f'{n} {v:.3f}' for n, v in over)}"
        text += _off(found)
    text = capital(text)
    if problems:
        return Finding("problem", f"{text} But the log itself spoils estimates, see below.")
    return Finding(kind, text)


def _off(found: Tracked) -> str:
    """Return what was another than nominal all along, by more than its claimed two deviations."""
    if found.deviations is None or not found.usable.any():
        return ""
    sure = 2 * found.deviations[np.flatnonzero(found.usable)[-1]]
    off = (found.last - found.nominal) / np.abs(found.nominal)
    said = (abs(found.last - found.nominal) > sure) & (abs(off) >= LEAST)
    told = [
        f"{name} is {100 * abs(by):.0f} % {'above' if by > 0 else 'below'}"
        for name, by, loud in zip(found.names, off, said, strict=True)
        if loud
    ]
    return f"; no change within this log, but {', '.join(told)} what was identified" if told else ""


def estimates_chart(found: Tracked, estimator: str) -> Chart:
    """Return the estimates over time with a ±2σ band, over nominal."""
    marks = [(c.time, f"{c.name} {100 * c.relative:+.1f} %") for c in found.changes]
    marks += [(float(at), "alarm") for at in found.alarms]
    claimed = ", with what the estimator claims as ±2σ" if found.deviations is not None else ""
    return Chart(
        title="Estimates",
        words=f"Over nominal{claimed}. Shaded: not used. Vertical: changes that were found, and "
        "alarms of the estimator.",
        x="time [s]",
        panels=[_panel(found, i, estimator) for i in range(len(found.names))],
        marks=marks,
        spans=gaps(found.time, found.usable),
    )


def _panel(found: Tracked, i: int, estimator: str) -> Panel:
    nominal, sure = found.nominal[i], found.deviations
    y, band = found.theta[:, i] / nominal, 0.0 if sure is None else 2 * sure[:, i] / abs(nominal)
    sides: Any = {} if sure is None else {"low": y - band, "high": y + band}
    one = Line(x=found.time[[0, -1]], y=np.ones(2), role="bound", label="nominal: as identified")
    estimate = Line(who=estimator, x=found.time, y=y, **sides)
    return Panel(y=f"{found.names[i]} / nominal", lines=[estimate, one])


def residual_chart(found: Tracked, period: float) -> Chart:
    """Return the correlation of the residual with its past, and the band of white noise."""
    error = found.residual[found.usable]
    values, x = correlations(error)[1 : LAGS + 1], 1e3 * period * np.arange(1, LAGS + 1)
    edge, zero = np.full(2, 2 / np.sqrt(len(error))), np.zeros(LAGS)
    sides: Any = {"low": np.minimum(values, zero), "high": np.maximum(values, zero)}
    white = Line(
        x=x[[0, -1]], y=zero[:2], low=-edge, high=edge, role="bound", label="±2σ of white noise"
    )
    return Chart(
        title="Residual",
        words="Correlation of the whitened residual with its past: what the model leaves.",
        x="samples before, as time [ms]",
        panels=[
            panel("correlation", white, Line(who="residual", kind="points", x=x, y=values, **sides))
        ],
    )


def load_chart(found: Tracked) -> Chart:
    """Return a piece of the predicted load angle over the hidden encoder, and the error."""
    assert found.load is not None
    middle = found.time[found.usable][np.sum(found.usable) // 2]
    piece = slice(*np.searchsorted(found.time, [middle, middle + 0.5]))
    sides = {"from motor angle and model": found.load.predicted}
    return Chart(
        title="Load angle",
        words="Half a second from the middle of the log; the load encoder was hidden.",
        x="time [s]",
        panels=compared(found.time, found.load.measured, sides, piece, "load angle [rad]"),
    )
