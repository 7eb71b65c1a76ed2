"""Figures of a run: how close to the bound, how fast at which noise, what the estimates do.

Rows are DataFrames, of which `words.matched` and `words.swept` tell the columns. An estimator has
its colour and marker in all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.reporting.figures import (
    NARROW,
    POINTS,
    USUAL,
    WIDE,
    Looks,
    Series,
    curves,
    plain_log,
)
from flexaxis.experiments.reporting.styles import BACK, MUTED, SOFT, TEXT, look, styled, tag
from flexaxis.experiments.reporting.tables import between, short

Array = NDArray[np.float64]
Row = Mapping[str, Any]
MARKERS = "oD^sv<"  # of faults, where estimators have rows
NONE = (np.nan, np.nan)
SMALL = {"color": MUTED, "fontsize": 8.5}


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width / 96, height / 96))


@styled
def over_bound(
    matched: pd.DataFrame,
    order: Sequence[str],
    faults: Mapping[str, str],
    *,
    width: float = WIDE,
    looks: Looks = USUAL,
) -> Figure:
    """Draw lag over bound: a row an estimator, a dot a fault, 95 % intervals, the bound at 1.

    Parameters
    ----------
    matched : DataFrame
        ``fault, estimator, lag, lag_interval, bound, over_bound``, at equal noise.
    order : sequence of str
        Estimators from top to bottom.
    faults : mapping of str to str
        What each fault is called.
    width : float
        [px]
    looks : mapping of str to Style
    """
    narrow = width < 500
    figure = _figure(width, (46 if narrow else 53) * len(order) + 78)
    ax, top = figure.subplots(), max(matched["over_bound"].fillna(1).max(), 2)
    few = len(faults) <= len(MARKERS)
    shape = {
        fault: {"marker": MARKERS[i] if few else "o", "ls": "", "ms": 6, "mec": BACK, "mew": 0.6}
        for i, fault in enumerate(faults)
    }
    for place, who in enumerate(order):
        if place % 2 == 0:
            ax.axhspan(place - 0.5, place + 0.5, color=SOFT, lw=0)
        own = matched[matched["estimator"] == who].set_index("fault")
        colour = look(who, looks)["color"]
        known = [fault for fault in faults if fault in own.index]
        for step, fault in zip(np.linspace(-0.24, 0.24, len(known)), known, strict=True):
            row, y = own.loc[fault], place + (step if len(known) > 1 else 0.0)
            span = row["lag_interval"] or NONE
            tip = f"{who}, {faults[fault]}: lag {short(row['lag'])} s ({between(span)} s), "
            tip += f"{short(row['over_bound'])} × bound"
            ends = np.divide(span, row["bound"])
            tag(ax.plot(ends, [y, y], color=colour, lw=1.4, alpha=0.65)[0], who, tip)
            tag(ax.plot(row["over_bound"], y, color=colour, **shape[fault])[0], who, tip)
        right = SMALL | {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center"}
        tag(ax.text(1, place, f"{between(own['over_bound'])} ×", **right), who)
    ax.axvline(1, color=TEXT, lw=1.2)
    ax.set(xscale="log", xlabel="lag / Cramér–Rao bound", ylim=(len(order) - 0.5, -0.5))
    ax.set_xlim(min(0.72, 0.8 * matched["over_bound"].min()), top * (4.6 if narrow else 2.1))
    ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200) if t <= top * 1.3]
    ax.set_xticks(ticks, ["1\nbound", *map(str, ticks[1:])])
    ax.set_yticks(range(len(order)), order, fontsize=9, parse_math=False)
    ax.minorticks_off()
    for label, who in zip(ax.get_yticklabels(), order, strict=True):
        tag(label, who)
    ax.grid(axis="y", visible=False)
    ax.spines["left"].set_visible(False)
    if few:
        for fault, text in faults.items():
            ax.plot([], [], color=MUTED, label=text, **shape[fault])
        anchor = (-0.3, 1) if narrow else (-0.01, 1)
        ax.legend(
            loc="lower left",
            bbox_to_anchor=anchor,
            ncols=1 if narrow else 3,
            handletextpad=0.1,
            columnspacing=1.2,
            borderpad=0.2,
        )
    return figure


@styled
def at_fault(
    runs: Mapping[str, Array],
    time: Array,
    truth: Array,
    *,
    label: str,
    first: Sequence[str],
    width: float = WIDE,
    looks: Looks = USUAL,
) -> Figure:
    """Draw estimates around a fault: half a second beside five; medians, the truth dashed.

    Parameters
    ----------
    runs : mapping of str to ndarray (n, M)
        Estimates over nominal of n runs, by estimator, the best first.
    time : (M,) array
        From the fault on [s].
    truth : (M,) array
        Over nominal.
    label : str
        What is estimated.
    first : sequence of str
        The fastest: with the reference they have bands of 10 to 90 % of the runs.
    width : float
        [px]
    looks : mapping of str to Style
    """
    narrow, change = width < 500, truth[-1] - 1
    figure = _figure(width, 500 if narrow else 480)
    axes = figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True)
    windows = (((-0.1, 0.5), "The first half second"), ((-1.0, 5.0), "Five seconds"))
    for ax, (window, title) in zip(axes, windows, strict=True):
        inside = np.flatnonzero((time >= window[0]) & (time <= window[1]))
        inside = inside[:: max(1, len(inside) // POINTS)]
        ax.set_xlim(window)
        noted = REFERENCE if window[1] > 1 else (*first, "")[0]
        for place, (who, values) in reversed(list(enumerate(runs.items()))):
            part = np.percentile(values[:, inside], [10, 50, 90], axis=0)
            band = who in first or who == REFERENCE
            own = look(who, looks)
            own["markersize"] = 6.5 if own["marker"] == "*" else 4
            every = max(1, len(inside) // 5)
            own |= {"markevery": (place * every // len(runs), every), "zorder": 3 + band}
            _median(ax, time[inside], (part, change), own, who, band)
            if who == noted:
                _note(ax, time[inside], (part[1], change), own["color"], who)
        ax.plot(time[inside], truth[inside], color=TEXT, lw=1.1, ls=(0, (5, 3)), zorder=5)
        ax.set_title(title, color=MUTED, weight="normal")
    axes[0].set_ylim(*sorted((1 - 0.12 * change, 1 + 1.22 * change)))
    axes[0].annotate("truth", (-0.1, 1), (3, 4), textcoords="offset points", fontsize=8.5)
    for ax in axes[: 1 + narrow]:
        ax.set_ylabel(f"{label} / nominal")
    for ax in axes[narrow:]:
        ax.set_xlabel("time after the fault [s]")
    return figure


def _median(
    ax: Axes, time: Array, runs: tuple[Array, float], own: Row, who: str, band: bool
) -> None:
    """Draw the median of some runs, and their band."""
    (low, middle, high), change = runs
    if band:
        tag(ax.fill_between(time, low, high, color=own["color"], alpha=0.14, lw=0), who)
    tag(ax.plot(time, middle, **own)[0], who, f"{who}, median: {_reached(time, middle, change)[1]}")


def _reached(time: Array, middle: Array, change: float) -> tuple[Array, str]:
    """Return the first sample at which 90 % of a change are reached, if any, and words."""
    first = np.flatnonzero((middle - 1) / change > 0.9)[:1]
    return first, f"90 % after {short(time[first[0]])} s" if len(first) else "not there yet"


def _note(ax: Axes, time: Array, median: tuple[Array, float], colour: str, who: str) -> None:
    """Write beside a curve when it has covered 90 % of the fault."""
    first, words = _reached(time, *median)
    if not len(first):
        return
    x, y = time[first[0]], median[0][first[0]]
    place: dict[str, Any] = {"xytext": (14, -46), "textcoords": "offset points"}
    if time[-1] > 1:
        share = ("data", "axes fraction")
        place = {"xytext": (x, 0.3), "textcoords": share, "ha": "center"}
    arrow = {"arrowstyle": "-", "color": MUTED, "lw": 0.8}
    place |= {"parse_math": False, "color": colour, "fontsize": 8.5, "arrowprops": arrow}
    text = ax.annotate(f"{who}:\n{words}", (x, y), **place)
    text.set_in_layout(False)  # or the layout makes room for it
    tag(text, who)


@styled
def speed_noise(
    swept: pd.DataFrame,
    order: Sequence[str],
    faults: Mapping[str, str],
    noise: Mapping[str, float],
    *,
    width: float = WIDE,
    looks: Looks = USUAL,
) -> Figure:
    """Draw lag against the noise before the fault, a line an estimator, and both bounds.

    Parameters
    ----------
    swept : DataFrame
        ``fault, estimator, setting, factor, lag, lag_interval, std, std_interval, lag_bound,
        lag_bound_single``, a row a setting.
    order : sequence of str
    faults : mapping of str to str
        What each fault is called; a panel each.
    noise : mapping of str to float
        The std that is 1 on the abscissa, by fault [% of nominal].
    width : float
        [px]
    looks : mapping of str to Style
    """
    figure = _figure(width, 160 * len(faults) + 40)
    axes = figure.subplots(len(faults), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (fault, words) in zip(axes, faults.items(), strict=True):
        own = swept[(swept["fault"] == fault) & (swept["lag"] > 0) & (swept["std"] > 0)]
        for who in reversed(order):
            _settings(ax, own[own["estimator"] == who], who, noise[fault], looks)
        bounds = _bounds(ax, own)
        ax.axvline(1, color=MUTED, lw=1, zorder=0)
        ax.set_title(words, pad=3)
        ax.set(ylabel="lag [s]", xscale="log")
        plain_log(ax.yaxis)
        ax.set_ylim(0.75 * min([*bounds, own["lag"].min()]), 1.25 * own["lag"].max())
        plain_log(ax.xaxis)
        if ax is axes[0]:
            top = {"textcoords": "offset points"} | SMALL
            ax.annotate("table", (1, 1), (3, -8), ("data", "axes fraction"), **top)
            if bounds:
                ax.annotate("bound", (0, max(bounds)), (4, 3), ("axes fraction", "data"), **top)
    short_label = f"noise / that of {REFERENCE}"
    whole = f"noise before the fault / that of {REFERENCE}"
    axes[-1].set_xlabel(short_label if width < 500 else whole)
    return figure


def _settings(ax: Axes, line: pd.DataFrame, who: str, unit: float, looks: Looks) -> None:
    """Draw the settings of an estimator with whiskers, the slowest first."""
    line, own = line.sort_values("factor"), look(who, looks)
    thin = {"color": own["color"], "lw": 0.9, "alpha": 0.45}
    tag(ax.plot(line["std"] / unit, line["lag"], **own | {"marker": "", "lw": 1.4})[0], who)
    for row in line.to_dict("records"):
        x, y = row["std"] / unit, row["lag"]
        tag(ax.plot([x, x], row["lag_interval"] or NONE, **thin)[0], who)
        tag(ax.plot(np.divide(row["std_interval"] or NONE, unit), [y, y], **thin)[0], who)
        tip = f"{row['setting']}: lag {short(y)} s, noise {short(row['std'])} % of nominal"
        tag(ax.plot(x, y, **own | {"linestyle": ""})[0], who, tip)


def _bounds(ax: Axes, own: pd.DataFrame) -> list[float]:
    """Draw the lags of both bounds, and return those that are defined."""
    kinds = (
        ("lag_bound", (1.5, 2), TEXT, "it is unknown which parameter changed"),
        ("lag_bound_single", (6, 2, 1, 2), MUTED, "it is known which parameter changed"),
    )
    values = []
    for name, dash, colour, words in kinds:
        value = own[name].astype(float).median()
        if np.isfinite(value):
            line = ax.axhline(value, color=colour, lw=1.1, ls=(0, dash))
            tag(line, tip=f"bound: {short(value)} s, if {words}")
            values.append(float(value))
    return values


@styled
def lag_against_noise(
    rows: pd.DataFrame,
    order: Sequence[str],
    *,
    width: float = WIDE,
    axes: Axes | None = None,
    looks: Looks = USUAL,
    legend: bool = True,
) -> Figure:
    """Draw lag against noise, a point a row: single runs, or faults at default settings.

    Parameters
    ----------
    rows : DataFrame
        ``estimator, lag, std``; ``lag_interval`` and ``tip`` where there are any.
    order : sequence of str
    width : float
        [px]
    axes : Axes, optional
        Where to draw; a new figure by default.
    looks : mapping of str to Style
    legend : bool
    """
    series = []
    for who in order:
        own = rows[(rows["estimator"] == who) & (rows["lag"] > 0) & (rows["std"] > 1e-9)]
        ends = [interval or NONE for interval in own.get("lag_interval", ())]
        low, high = np.array(ends, float).T if ends else (None, None)
        if len(own):
            tips = own["tip"].tolist() if "tip" in own else ()
            series.append(
                Series(
                    x=own["std"],
                    y=own["lag"],
                    estimator=who,
                    kind="points",
                    low=low,
                    high=high,
                    tips=tips,
                )
            )
    return curves(
        {"lag [s]": series},
        x="std before the fault [% of nominal]",
        x_log=True,
        y_log=["lag [s]"],
        width=width,
        height=280,
        looks=looks,
        legend=legend,
        axes=None if axes is None else [axes],
    )


@styled
def shares(
    ratios: Mapping[str, Array],
    problems: int,
    *,
    width: float = NARROW,
    looks: Looks = USUAL,
) -> Figure:
    """Draw the share of runs with a lag of at most so many times the bound.

    Parameters
    ----------
    ratios : mapping of str to ndarray
        lag / bound of the runs that reached anything, increasing, by estimator.
    problems : int
        Number of runs, those that reached nothing among them.
    width : float
        [px]
    looks : mapping of str to Style
    """
    known = np.concatenate([*ratios.values(), [0.9, 2.0]])
    ends = known.min() / 1.1, known.max() * 1.1
    series = []
    for who, each in ratios.items():
        x = np.r_[ends[0], each, ends[1]]
        y = np.r_[0.0, np.arange(1, len(each) + 1), len(each)] / problems
        kept = np.unique(np.linspace(0, len(x) - 1, POINTS).round().astype(int))
        tip = f"{who}: {100 * np.sum(each <= 2) / problems:.0f} % "
        series.append(
            Series(
                x=x[kept],
                y=y[kept],
                estimator=who,
                kind="steps",
                tips=[tip + "of the runs within twice the bound"],
            )
        )
    return curves(
        {"share of runs": series},
        x="lag / Cramér–Rao bound",
        x_log=True,
        limits={"share of runs": (0.0, 1.02)},
        marks=[(1.0, "bound")],
        window=ends,
        width=width,
        height=280,
        looks=looks,
        legend=False,
    )
