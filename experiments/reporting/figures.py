"""Figures: each function returns a matplotlib Figure.

Truth is dashed black, an estimator has the same colour everywhere, bands are 10–90 % of the runs,
a fault is a thin vertical line, burn-in is shaded. A lost run never squashes the others: the axes
are those of the truth and the medians near it.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexaxis.experiments.reporting import looks
from flexaxis.experiments.scoring.curves import Curve
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


def trajectories(
    curves: Sequence[Curve], scenario: Scenario, *, labels: Mapping[str, str] | None = None
) -> Figure:
    """Draw the estimates of all estimators over time on one scenario, a panel a parameter.

    Parameters
    ----------
    curves : sequence of Curve
        Those of the scenario.
    scenario : Scenario
        For faults, pauses and burn-in.
    labels : mapping of str to str, optional
        What the legend says instead of the name of an estimator.
    """
    names = list(dict.fromkeys(name for curve in curves for name in curve.names))
    said = labels or {}
    fig = Figure(figsize=(8.0, 1.2 + 1.55 * len(names)), layout="constrained")
    axes = fig.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(axes, names, strict=True):
        mine = [(curve, curve.names.index(name)) for curve in curves if name in curve.names]
        for curve, i in mine:
            shade = colour(curve.estimator)
            ax.fill_between(
                curve.time, curve.low[:, i], curve.high[:, i], color=shade, alpha=0.18, lw=0
            )
            label = said.get(curve.estimator, _shortened(curve.estimator))
            style = dash(curve.estimator)
            ax.plot(curve.time, curve.median[:, i], color=shade, ls=style, lw=1.3, label=label)
        first, i = mine[0]
        ax.plot(first.time, first.truth[:, i], "k--", lw=1.0, label="truth")
        mark(ax, scenario)
        ax.grid(alpha=0.25)
        ax.set_ylim(*_limits(mine))
        ax.set_ylabel(f"{symbol(name)} / nominal")
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(0, scenario.duration)
    # From all panels: an estimator need not be in the first one.
    shown = {
        text: line
        for ax in axes
        for line, text in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    fig.legend(
        shown.values(),
        shown.keys(),
        loc="outside upper center",
        ncols=4 if not labels else 1,
        frameon=False,
    )
    return fig


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


def _limits(mine: Sequence[tuple[Curve, int]]) -> tuple[float, float]:
    """Cover the truth and what lies near it, at most twice its range away."""
    truth = np.concatenate([curve.truth[:, i] for curve, i in mine] + [[1.0]])
    drawn = np.concatenate(
        [side[:, i] for curve, i in mine for side in (curve.low, curve.median, curve.high)]
    )
    drawn = drawn[np.isfinite(drawn)]
    low, high = truth.min(), truth.max()
    # Most of what is drawn, but a burst or a run at its bound may not set the scale.
    room = max(high - low, 0.04)
    if drawn.size:
        low = max(min(low, np.percentile(drawn, 0.5)), low - 2 * room)
        high = min(max(high, np.percentile(drawn, 99.5)), high + 2 * room)
    margin = 0.08 * (high - low) + 0.005
    return low - margin, high + margin


def speed_variance(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw lag against std of the changed parameter: the trade-off, one point an estimator.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows; those without a lag are left out.
    """
    fig = Figure(figsize=(8.0, 4.0), layout="constrained")
    draw_speed_variance(fig.subplots(), rows)
    return fig


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


def img(figure: Figure, *, dpi: int = 100) -> str:
    """Return a figure as dots to put inside a page: smaller than `svg` where much is drawn."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    text = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="" src="data:image/png;base64,{text}">'


def svg(figure: Figure) -> str:
    """Return a figure as SVG to put inside a page, the same text for the same figure."""
    import matplotlib

    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "flexaxis", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
