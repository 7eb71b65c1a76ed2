"""Pages of logs: of an import, an identification, an estimator on a record, and many logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.experiments.files import write_text
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.findings import MARKS, Finding, ordered, texts_of
from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.importing import Imported
from flexaxis.experiments.logs.many import Many
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.logs.verdict import Validation
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.figures import Series, curves
from flexaxis.experiments.reporting.tables import Cell, Table
from flexaxis.experiments.running.progress import LINE
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

MOST = 4000  # points of a curve
GAPS = 200  # that are shaded: more are a pattern, and seen as one
PIECE = 500  # samples that are shown of a simulation
SUREST = 3  # estimates in the sentence that the page begins with


@dataclass(frozen=True)
class Chart:
    """A figure with a title, words below it, and the series of each panel by its label."""

    title: str
    words: str
    panels: Mapping[str, Sequence[Series]]
    options: Mapping[str, Any] = field(default_factory=dict)
    x: str = "time [s]"

    def draw(self, **options: Any) -> Figure:
        """Draw it, as `reporting.figures.curves` does."""
        return curves(self.panels, x=self.x, **self.options, **options)


@dataclass(frozen=True)
class LogPage:
    """What a page shows.

    Attributes
    ----------
    title : str
    finding : Finding
        The answer, in one sentence.
    remarks : sequence of Finding
    charts : sequence of Chart
    tables : mapping of str to DataFrame
        By their titles.
    """

    title: str
    finding: Finding
    remarks: Sequence[Finding]
    charts: Sequence[Chart]
    tables: Mapping[str, pd.DataFrame]

    def write(self, path: Path) -> None:
        """Write the page as one HTML file that needs no network."""
        content = vars(self) | {
            "figures": [(page.drawn(one.draw, one.title), one.words) for one in self.charts],
            "tables": [_table(name, frame) for name, frame in self.tables.items()],
            "marks": MARKS, "version": version("flexaxis"), "command": LINE.get(),
        }  # fmt: skip
        write_text(path, page.render("logs/templates/log.html", looks={}, **content))


def _table(name: str, frame: pd.DataFrame) -> Table:
    rows = [
        ("", [Cell(x if isinstance(x, str) else f"{x:.5g}", x) for x in row])
        for row in frame.reset_index().to_numpy()
    ]
    return Table(name, [frame.index.name or "", *frame.columns], rows)


def _line(x: Array, y: Array, label: str, role: Any = "data") -> Series:
    """Return a curve of at most `MOST` points, the extremes of each bin."""
    if len(x) > 2 * MOST:
        bins = np.array_split(np.arange(len(x)), MOST // 2)
        k = np.sort(np.ravel([(b[np.argmin(y[b])], b[np.argmax(y[b])]) for b in bins]))
        x, y = x[k], y[k]
    return Series(x=x, y=y, label=label, role=role)


def _gaps(time: Array, ok: NDArray[np.bool_]) -> list[tuple[float, float, str]]:
    """Return what is to be shaded: where samples do not count."""
    edges = np.flatnonzero(np.diff(np.r_[1, ok, 1])).reshape(-1, 2)[:GAPS]
    return [(float(time[begin]), float(time[end - 1]), "not used") for begin, end in edges]


def import_page(result: Imported, log: str) -> LogPage:
    """Return the page of an import."""
    checks = ordered(result.checks)
    finding = Finding("ok", "Nothing speaks against this log.")
    if bad := ", ".join(one.name for one in checks if one.kind == "problem"):
        finding = Finding("problem", f"As it is, this log spoils estimates: {bad}.")
    rows = {one.name: (one.measured, MARKS[one.kind], one.text, one.command) for one in checks}
    heads = ["measured", "", "in words", "what to type"]
    frame = pd.DataFrame.from_dict(rows, "index", columns=heads).rename_axis("checked")
    remarks = [one for one in checks if one.kind in ("problem", "note")]
    return LogPage(
        f"Import of {log}", finding, remarks, [log_chart(result.record)], {"Checks": frame}
    )


def log_chart(record: Record) -> Chart:
    """Return torque and motion over time."""
    motion = np.asarray(getattr(record, output_of(record)))
    panels = {
        "torque [as logged]": [_line(record.time, record.torque, "log")],
        "speed [rad/s]": [_line(record.time, motion, "log")],
    }
    words = "The log. Shaded: missing, or before the end of the burn-in."
    return Chart("The log", words, panels, {"spans": _gaps(record.time, usable(record))})


def identification_page(
    result: Identification, period: float, other: Validation | None, title: str
) -> LogPage:
    """Return the page of an identification, with its simulation of another log if there is one."""
    findings = findings_of(result, other)
    every = zip(result.names, result.theta, result.deviations, strict=True)
    sure = sorted((sd / abs(v), f"{name} = {v:.4g} ± {sd:.1g}") for name, v, sd in every if v)
    problems = texts_of(findings, "problem")
    text = (
        f"The model simulates {result.fit:.1f} % of what it was not fitted to from the torque "
        f"alone; surest: {', '.join(text for _, text in sure[:SUREST])}."
    )
    text += f" These numbers cannot be used: {problems[0]}." if problems else ""
    log = result.answer.setup.log
    time = period * np.arange(float(len(log.y)))
    charts = [_compared("Simulation from the torque", time, log.y, log.y - result.residual)]
    if other is not None:
        title_of = "Simulation of the other log"
        charts.append(_compared(title_of, other.time, other.measured, other.simulated))
    estimates = pd.DataFrame(result.estimates, ["estimate", "± sd"]).T.rename_axis("parameter")
    tables = {
        "Estimates": estimates,
        "Trust": pd.DataFrame({"value": facts(result, other)}).rename_axis("what"),
    }
    return LogPage(title, Finding("problem" if problems else "ok", text), findings, charts, tables)


def findings_of(result: Identification, other: Validation | None) -> list[Finding]:
    """Return the findings on both logs, the gravest first."""
    unlike = "" if other is None else other.unlike
    more = [Finding("problem", f"on the other log, {unlike}")] if unlike else []
    return ordered([*more, *result.findings])


def facts(result: Identification, other: Validation | None) -> dict[str, str]:
    """Return how far to trust an identification: names and values."""
    told = {
        "units": result.units,
        "law of friction": result.friction,
        "simulation of held-out pieces from the torque alone": f"{result.fit:.1f} %",
        "simulation of the whole log": f"{result.whole.percent:.1f} %",
        "correlation of white residuals": f"{result.correlation:.3f}",
    }
    if other is not None:
        told["simulation of the other log"] = f"{other.fit.percent:.1f} %"
    return told


def content(result: Identification, other: Validation | None) -> dict[str, Any]:
    """Return an identification as JSON has it."""
    every = findings_of(result, other)
    return {
        "estimates": {n: {"value": value, "sd": sd} for n, (value, sd) in result.estimates.items()},
        "units": result.units,
        "fit": result.fit,
        "friction": result.friction,
        "compared": [vars(one) for one in result.tried],
        "residual": {"std": result.axis.noise, "correlation": result.correlation},
        "warnings": texts_of(every, "problem"),
        "remarks": texts_of(every, "note", "info", "ok"),
        "validation": None if other is None else {"simulation": other.fit.percent},
    }


def _compared(title: str, time: Array, y: Array, simulated: Array) -> Chart:
    """Return the liveliest piece of a log with its simulation, and the error."""
    power = np.cumsum(np.r_[0.0, np.nan_to_num(y) ** 2])
    length = min(PIECE, len(y))
    begin = int(np.argmax(power[length:] - power[:-length]))
    piece = slice(begin, begin + length)
    t, y, simulated = time[piece], y[piece], simulated[piece]
    panels = {
        "speed [rad/s]": [_line(t, y, "log"), _line(t, simulated, "simulation", "truth")],
        "error [rad/s]": [_line(t, y - simulated, "error")],
    }
    return Chart(title, "The liveliest piece, simulated from the torque alone.", panels)


def track_page(result: Tracked, estimator: str, *, problems: Sequence[str], log: str) -> LogPage:
    """Return the page of an estimator on a record.

    Parameters
    ----------
    result : Tracked
    estimator : str
        As typed.
    problems : sequence of str
        What spoils estimates from this log.
    log : str
        Name of the log.
    """
    first, *more = result.findings
    remarks = [*(Finding("problem", f"the log: {text}") for text in problems), *more]
    finding = Finding("problem" if problems else first.kind, first.text)
    last = {"last estimate": result.last, "nominal": result.nominal}
    frame = pd.DataFrame(last, result.names).rename_axis("parameter")
    frame["over nominal"] = result.last / result.nominal
    chart = estimates_chart(result, estimator)
    return LogPage(f"{estimator} on {log}", finding, remarks, [chart], {"Last estimates": frame})


def estimates_chart(result: Tracked, estimator: str) -> Chart:
    """Return the estimates over time with a ±2σ band, over nominal."""
    panels, step = {}, max(len(result.time) // MOST, 1)
    t = result.time[::step]
    for i, (name, nominal) in enumerate(zip(result.names, result.nominal, strict=True)):
        y, sides = result.theta[::step, i] / nominal, dict[str, Array]()
        if result.deviations is not None:
            band = 2 * result.deviations[::step, i] / abs(nominal)
            sides = {"low": y - band, "high": y + band}
        one = Series(x=t[[0, -1]], y=np.ones(2), role="bound", label="as identified")
        panels[f"{name} / nominal"] = [Series(x=t, y=y, estimator=estimator, **sides), one]  # type: ignore[arg-type]
    marks = [(change.time, change.text) for change in result.changes]
    marks += [(float(at), "alarm") for at in result.alarms]
    words = "Estimates over nominal, ±2σ as the estimator claims. Vertical: changes and alarms."
    spans = _gaps(result.time, result.usable)
    return Chart("Estimates", words, panels, {"marks": marks, "spans": spans})


def many_page(result: Many, title: str) -> LogPage:
    """Return the page of many logs: one figure, one table."""
    table, k = result.table, np.arange(1.0, len(result.table) + 1)
    panels = {}
    for name, one in result.explained.items():
        y, band = table[name].to_numpy(), 2 * table[f"{name}_sd"].to_numpy()
        points = Series(x=k, y=y, low=y - band, high=y + band, kind="points", label="log, ±2σ")
        panels[name] = [points, Series(x=k, y=one.fitted, role="truth", label="explained")]
    words = "Each log with ±2σ; the line is what covariates and a change explain."
    chart = Chart("Estimates over the logs", words, panels, x="log")
    return LogPage(
        title, result.findings[0], result.findings[1:], [chart],
        {"Estimates": table.rename_axis("log")},
    )  # fmt: skip
