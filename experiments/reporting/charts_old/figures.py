"""Charts drawn with matplotlib, for notebooks and papers; a page has them by `drawing`.

Truth is dashed black, an estimator has the same colour everywhere, a fault is a thin vertical line,
burn-in is shaded.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator, NullFormatter

from flexaxis.experiments.reporting import styles
from flexaxis.experiments.reporting.charts_old.charts import Array, Chart, Line
from flexaxis.experiments.reporting.charts_old.scales import across, upward
from flexaxis.experiments.reporting.charts_old.tables import SYMBOL

LONGEST = 40  # characters of a name in a legend


def colour(estimator: str) -> str:
    """Return the colour of an estimator, the same in every figure; see `styles`."""
    return styles.style(estimator).light


def _dash(style: styles.Style) -> Any:
    """Return a line style as matplotlib takes it."""
    lengths = [float(part) for part in style.dash.split()]
    return (0, lengths) if lengths else "-"


def _mark(ax: Axes, spans: Any, marks: Any) -> None:
    for begin, end, _ in spans:
        ax.axvspan(begin, end, color="0.5", alpha=0.12, lw=0)
    for at, _ in marks:
        ax.axvline(at, color="0.3", lw=0.8)


def figure(chart: Chart) -> Figure:
    """Draw a chart as a figure of its own, its panels below one another, the legend beside them."""
    count = len(chart.panels)
    found = Figure(figsize=(8.0, 0.8 + (3.6 if count == 1 else 2.6 * count)), layout="constrained")
    axes = found.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for place in range(count):
        draw(chart, axes[place], panel=place).label_outer()
    handles = {
        label: line
        for ax in axes
        for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    found.legend(
        handles.values(), handles.keys(), loc="outside right upper", frameon=False, fontsize=8
    )
    return found


def draw(
    chart: Chart,
    ax: Axes,
    *,
    panel: int = 0,
    looks: Mapping[str, styles.Style] = MappingProxyType({}),
) -> Axes:
    """Draw a panel of a chart on given axes, as pages have it.

    Parameters
    ----------
    chart : Chart
    ax : Axes
    panel : int
        Which.
    looks : mapping of str to Style, optional
        Of those that look otherwise here than in other figures.
    """
    shown = chart.panels[panel]
    for line in shown.lines:
        _draw_line(ax, line, looks.get(line.who) or styles.style(line.who))
    _mark(ax, chart.spans, chart.marks)
    x, y = across(chart)[0][1], upward(shown, across(chart)[0][1])
    ax.set(xscale="log" if x.log else "linear", yscale="log" if y.log else "linear")
    for axis, scale, limits in ((ax.xaxis, x, ax.set_xlim), (ax.yaxis, y, ax.set_ylim)):
        limits(scale.low, scale.high)
        axis.set_major_locator(FixedLocator([value for value, _ in scale.ticks]))
        axis.set_major_formatter(FixedFormatter([text for _, text in scale.ticks]))
        axis.set_minor_formatter(NullFormatter())
    ax.grid(alpha=0.25)
    ax.set_xlabel(typeset(chart.x))
    ax.set_ylabel(typeset(shown.y))
    ax.set_title(typeset(shown.title), fontsize=10, loc="left")
    return ax


def _draw_line(ax: Axes, line: Line, style: styles.Style) -> None:
    """Draw a curve or points as `drawing` does: truth dashed, bounds dotted, others in style."""
    role = _ROLES.get(line.role, {})
    own = {"color": style.light} if line.who else {}
    solid = {"color": "0.4", "lw": 1.3, "ls": _dash(style) if line.who else "-"}
    look: dict[str, Any] = {**solid, **role, **own, "label": _shortened(line.label or line.who)}
    if line.kind == "steps":
        look["drawstyle"] = "steps-post"
    if line.kind in {"points", "both"}:
        look |= {"marker": style.marker if line.who else "o", "ms": 5, "capsize": 2}
        look |= {"ls": "none"} if line.kind == "points" else {}
        bars = [_bars(line.x, line.x_low, line.x_high), _bars(line.y, line.low, line.high)]
        ax.errorbar(line.x, line.y, xerr=bars[0], yerr=bars[1], **look)
        return
    if line.low is not None and line.high is not None:
        ax.fill_between(line.x, line.low, line.high, color=look["color"], alpha=0.18, lw=0)
    ax.plot(line.x, line.y, **look)


_ROLES: dict[str, dict[str, Any]] = {
    "truth": {"color": "k", "ls": "--", "lw": 1.0},
    "bound": {"color": "k", "ls": ":", "lw": 1.0},
    "data": {"color": "0.4", "ls": "-"},
}


def _bars(values: Array, low: Array | None, high: Array | None) -> Any:
    """Return how far intervals reach below and above some values (2, n)."""
    if low is None or high is None:
        return None
    return np.maximum(0.0, np.nan_to_num([values - low, high - values]))


def _shortened(text: str) -> str:
    """Return a text for a legend: of a long one, such as a command, beginning and end.

    Else nothing would be left of the figure beside it.
    """
    rest = LONGEST // 2 - 1
    return text if len(text) <= LONGEST else f"{text[:rest]} … {text[-rest:]}"


def typeset(text: str) -> str:
    """Return a text with its symbols as matplotlib sets them."""
    return SYMBOL.sub(r"$\1_{\2}$", text)


def svg(figure: Figure) -> str:
    """Return a figure as SVG to put inside a page, the same text for the same figure."""
    import matplotlib

    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "flexaxis", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
