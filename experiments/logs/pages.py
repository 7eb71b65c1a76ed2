"""Build HTML pages about an import, an identification, a tracking run, or many logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from markupsafe import Markup

from flexaxis.experiments.files import write_text
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.findings import MARKS, Finding, ordered, texts_of
from flexaxis.experiments.logs.fit import Fit
from flexaxis.experiments.logs.identify import Identification, Many
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.signals import Array, Flags, gaps_of, liveliest
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.logs.verdict import unlike
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.figures import Series, curves
from flexaxis.experiments.running.progress import LINE

MOST = 4000  # maximum number of points of a curve
GAPS = 200  # maximum number of gaps that are shaded
PIECE = 500  # number of samples of a simulation in a figure
TIMED: dict[str, Any] = {"x": "time [s]"}


class Chart(NamedTuple):
    """A figure with a title, a caption (`words`), series for each panel, and plot options."""

    title: str
    words: str
    panels: Mapping[str, Sequence[Series]]
    options: Mapping[str, Any]


class LogPage(NamedTuple):
    """The content of an HTML page about a log.

    Attributes
    ----------
    title : str
        Title of the page.
    finding : Finding
        Main result, in one sentence.
    remarks : sequence of Finding
        Further findings.
    charts : sequence of Chart
        Figures on the page.
    table : DataFrame or None
        Table of the page, if any.
    """

    title: str
    finding: Finding
    remarks: Sequence[Finding]
    charts: Sequence[Chart]
    table: Any = None

    def write(self, path: Path) -> None:
        """Write the page as one HTML file that needs no network connection."""
        content = self._asdict() | {
            "figures": [
                (page.drawn(curves, one.title, one.panels, **one.options), one.words)
                for one in self.charts
            ],
            "marks": MARKS, "version": version("flexaxis"), "command": LINE.get(),
        }  # fmt: skip
        if self.table is not None:
            html = self.table.to_html(border=0, float_format="{:.5g}".format)
            content["table"] = Markup(html)
        write_text(path, page.render("logs/templates/log.html", looks={}, **content))


def _line(x: Array, y: Array, label: str, role: Any = "data") -> Series:
    """Return a curve that is thinned to about `MOST` points and keeps the extremes of each bin."""
    bins = pd.Series(y).groupby(np.arange(len(y)) // -(-2 * len(y) // MOST))
    k = np.unique([bins.idxmin(), bins.idxmax()])
    return Series(x=x[k], y=y[k], label=label, role=role)


def _gaps(time: Array, ok: Flags) -> list[tuple[float, float, str]]:
    """Return the time spans of unused samples, for shading in a figure."""
    return [(time[a], time[b - 1], "not used") for a, b in gaps_of(ok)[:GAPS]]


def import_page(result: Imported, log: str) -> LogPage:
    """Return the page that reports the import of a log."""
    checks, record = ordered(result.checks), result.record
    finding = Finding("ok", "The checks found no problem in this log.")
    if bad := ", ".join(one.name for one in checks if one.kind == "problem"):
        finding = Finding("problem", f"This log would give wrong estimates. Failed checks: {bad}.")
    panels = {
        "torque [as logged]": [_line(record.time, record.torque, "log")],
        "speed [rad/s]": [_line(record.time, output_of(record)[1], "log")],
    }
    words = "Torque and speed in the log. Missing samples and the burn-in are shaded."
    chart = Chart("The log", words, panels, TIMED | {"spans": _gaps(record.time, usable(record))})
    return LogPage(f"Import of {log}", finding, checks, [chart])


def identification_page(result: Identification, other: Fit | None, title: str) -> LogPage:
    """Return the page of an identification. If a validation log was simulated, show it as well."""
    charts, findings = [_compared("Simulation from the torque", result.answer)], [*result.findings]
    if other is not None:
        charts.append(_compared("Simulation of the validation log", other))
        fits = f"a simulation explains {other.percent:.1f} % of the validation log"
        findings.append(Finding("info", fits))
        if text := unlike(other, result.axis.error):
            findings.append(Finding("problem", f"on the validation log, {text}"))
    problems = texts_of(findings, "problem")
    text = f"A simulation from the torque alone explains {result.fit:.1f} % of the held-out pieces."
    text += f" The estimates cannot be used: {problems[0]}." if problems else ""
    finding = Finding("problem" if problems else "ok", text)
    return LogPage(title, finding, ordered(findings), charts, result.estimates.T)


def content(result: Identification, findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the content of the JSON file of an identification."""
    return {
        "estimates": result.estimates.to_dict(),
        "units": result.units,
        "fit": result.fit,
        "friction": result.friction,
        "warnings": texts_of(findings, "problem"),
        "remarks": texts_of(findings, "note", "info", "ok"),
    }


def _compared(title: str, fit: Fit) -> Chart:
    """Return a figure of the part with the most motion: log, simulation and simulation error."""
    log = fit.setup.log
    piece = liveliest(log.y, PIECE)
    t = log.period * np.arange(piece.start, piece.stop)
    y, simulated = log.y[piece], fit.simulated[piece]
    panels = {
        "speed [rad/s]": [_line(t, y, "log"), _line(t, simulated, "simulation", "truth")],
        "error [rad/s]": [_line(t, y - simulated, "error")],
    }
    return Chart(title, "The part of the log with the most motion.", panels, TIMED)


def track_page(result: Tracked, estimator: str, log: str) -> LogPage:
    """Return the page about a run of an estimator on a record, with the estimates over time.

    Parameters
    ----------
    result : Tracked
        Estimates and findings.
    estimator : str
        Name and options of the estimator, as the user typed them.
    log : str
        Name of the log.
    """
    columns = {
        "last": result.last, "nominal": result.nominal, "ratio": result.last / result.nominal,
    }  # fmt: skip
    table = pd.DataFrame(columns, result.names)
    part = slice(None, None, max(len(result.time) // MOST, 1))
    two = 0.0 if result.deviations is None else 2 * result.deviations
    sides = (result.theta - two, result.theta, result.theta + two)
    low, y, high = (side[part].T / result.nominal[:, None] for side in sides)
    t, panels = result.time[part], {}
    same = Series(x=t[[0, -1]], y=np.ones(2), role="bound", label="as identified")
    for i, name in enumerate(result.names):
        estimate = Series(x=t, y=y[i], low=low[i], high=high[i], estimator=estimator)
        panels[f"{name} / nominal"] = [estimate, same]
    marks = [(one.time, one.text) for one in result.changes if one.kind == "step"]
    marks += [(at, "alarm") for at in result.alarms.tolist()]
    words = "Estimates divided by nominal values, ±2σ. Vertical lines mark steps and alarms."
    options = TIMED | {"marks": marks, "spans": _gaps(result.time, result.usable)}
    chart = Chart("Estimates", words, panels, options)
    return LogPage(f"{estimator} on {log}", result.findings[0], result.findings[1:], [chart], table)


def many_page(result: Many, title: str) -> LogPage:
    """Return the page about many logs, with one figure and one table."""
    table, k = result.table, np.arange(1.0, len(result.table) + 1)
    panels = {}
    for name, one in result.explained.items():
        y, band = table[name].to_numpy(), 2 * table[f"{name}_sd"].to_numpy()
        points = Series(x=k, y=y, low=y - band, high=y + band, kind="points", label="log, ±2σ")
        panels[name] = [points, Series(x=k, y=one.fitted, role="truth", label="explained")]
    words = (
        "Estimates from each log, ±2σ. The line is the sum of the level, the effects of the "
        "covariates and the change."
    )
    chart = Chart("Estimates over the logs", words, panels, {"x": "log"})
    return LogPage(title, result.findings[0], result.findings[1:], [chart], table)
