"""What figures drawn with matplotlib share: colours, symbols, marks, the trade-off.

Truth is dashed black, an estimator has the same colour everywhere, a fault is a thin vertical line,
burn-in is shaded. Pages have charts of their own (`charts`); these are for notebooks and papers.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexaxis.experiments.reporting import looks
from flexaxis.experiments.scoring.theta import physical
from flexaxis.sim.scenario import Scenario

LONGEST = 40  # characters of a name in a legend


def colour(estimator: str) -> str:
    """Return the colour of an estimator, the same in every figure; see `looks`."""
    return looks.look(estimator).light


def marker(estimator: str) -> str:
    """Return the marker of an estimator, the same in every figure of points."""
    return looks.look(estimator).marker


def dash(estimator: str) -> Any:
    """Return the line style of an estimator, as matplotlib takes it."""
    lengths = [float(part) for part in looks.look(estimator).dash.split()]
    return (0, lengths) if lengths else "-"


def symbol(name: str) -> str:
    """Return the mathematical symbol of a parameter, for an axis."""
    parameter, exponent = physical(name)
    letter, _, index = parameter.partition("_")
    text = f"{letter}_{index}" if index else letter
    return f"$1/{text}$" if exponent < 0 else f"${text}$"


def mark(ax: Axes, scenario: Scenario) -> None:
    """Mark burn-in, pauses of the excitation and faults."""
    ax.axvspan(0, scenario.burn_in, color="0.5", alpha=0.12, lw=0)
    still = np.flatnonzero(np.diff(np.r_[1, scenario.excited(), 1]))
    for begin, end in zip(still[::2], still[1::2], strict=True):
        ax.axvspan(
            begin * scenario.period, end * scenario.period, color="#E69F00", alpha=0.12, lw=0
        )
    for event in scenario.events():
        ax.axvline(event.index * scenario.period, color="0.3", lw=0.8)


def draw_speed_variance(ax: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    """Draw it on given axes, with its legends beside them."""
    shown = [row for row in rows if row["changed"] and row["lag"] is not None and row["std"]]
    scenarios = list(dict.fromkeys(row["scenario"] for row in shown))
    markers = dict(zip(scenarios, "osD^vP*X<>phd8H" * 4, strict=False))
    for row in shown:
        ax.errorbar(
            row["std"],
            row["lag"],
            xerr=_bars(row["std"], row["std_interval"]),
            yerr=_bars(row["lag"], row["lag_interval"]),
            color=colour(row["estimator"]),
            marker=markers[row["scenario"]],
            markersize=7,
            capsize=2,
            lw=1,
        )
    ax.axhline(5.0, color="0.5", lw=0.8, ls=":")
    ax.annotate(
        "an estimator that never moves",
        (0.99, 5.0),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        fontsize=8,
        color="0.4",
    )
    ax.set(xscale="log", yscale="log")
    ax.grid(alpha=0.25, which="both")
    ax.set_xlabel("standard deviation before the fault [% of nominal]")
    ax.set_ylabel("lag after the fault [s]")
    _legends(ax, list(dict.fromkeys(row["estimator"] for row in shown)), markers)


def _bars(value: float, interval: Sequence[float] | None) -> list[list[float]] | None:
    if interval is None:
        return None
    return [[max(0.0, value - interval[0])], [max(0.0, interval[1] - value)]]


def _shortened(text: str) -> str:
    """Return a text for a legend: of a long one, such as a command, beginning and end.

    Else nothing would be left of the figure beside it.
    """
    rest = LONGEST // 2 - 1
    return text if len(text) <= LONGEST else f"{text[:rest]} … {text[-rest:]}"


def _legends(ax: Axes, estimators: Sequence[str], markers: Mapping[str, str]) -> None:
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=colour(e), lw=3, label=_shortened(e)) for e in estimators]
    points = [Line2D([], [], color="0.3", marker=m, lw=0, label=s) for s, m in markers.items()]
    figure = ax.get_figure()
    assert figure is not None
    figure.legend(handles=lines + points, loc="outside right upper", frameon=False, fontsize=8)


def svg(figure: Figure) -> str:
    """Return a figure as SVG to put inside a page, the same text for the same figure."""
    import matplotlib

    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "flexaxis", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
