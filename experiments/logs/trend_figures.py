"""Figures of a trend: a parameter over time, and over what explains it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.experiments.logs.change_points import Change
from flexaxis.experiments.logs.covariates import Clock
from flexaxis.experiments.logs.wear import Verdict
from flexaxis.experiments.reporting.figures import symbol

Array = NDArray[np.float64]
BLUE, ORANGE, GREY, GREEN = "#0072B2", "#D55E00", "#7F7F7F", "#009E73"
MANY = 150  # logs, from which on bars would be a blot


def parameter_figure(
    found: Verdict, clock: Clock, covariates: Mapping[str, Array], first: datetime | None
) -> Figure:
    """Draw a parameter over time with what was found in it, and over each covariate.

    Parameters
    ----------
    found : Verdict
    clock : Clock
    covariates : mapping of str to ndarray
        Of all logs, in the order of the clock.
    first : datetime or None
        Of the first log, where logs have dates.
    """
    beside = len(covariates)
    fig = Figure(figsize=(8.0, 7.5 if beside else 3.2), layout="constrained")
    if not beside:
        _over_time(fig.subplots(), found, clock, first)
        return fig
    grid = fig.add_gridspec(3, beside)
    over_time = fig.add_subplot(grid[0, :])
    _over_time(over_time, found, clock, first, raw=True)
    over_time.set_title("as estimated", fontsize=9, loc="left")
    left = fig.add_subplot(grid[1, :], sharex=over_time)
    _over_time(left, found, clock, first)
    left.set_title(f"less what {' and '.join(covariates)} explains", fontsize=9, loc="left")
    for i, name in enumerate(covariates):
        _over_covariate(fig.add_subplot(grid[2, i]), found, name, covariates[name])
    return fig


def overview_figure(found: Sequence[Verdict], clock: Clock, first: datetime | None) -> Figure:
    """Draw all parameters over time, small."""
    columns = 2 if len(found) > 1 else 1
    lines = -(-len(found) // columns)
    fig = Figure(figsize=(8.0, 0.6 + 1.5 * lines), layout="constrained")
    axes = fig.subplots(lines, columns, squeeze=False, sharex=True).ravel()
    for ax, one in zip(axes, found, strict=False):
        _over_time(ax, one, clock, first, small=True)
    for ax in axes[len(found) :]:
        ax.set_axis_off()
    return fig


def logs_figure(rows: Sequence[Mapping[str, Any]], clock: Clock, first: datetime | None) -> Figure:
    """Draw fit, delay, constant torque and colour of the residual of each log.

    Parameters
    ----------
    rows : sequence of mapping
        In the order of the clock.
    clock : Clock
    first : datetime or None
    """
    fig = Figure(figsize=(8.0, 7.0), layout="constrained")
    fits, lates, offsets, colours = fig.subplots(4, 1, sharex=True)
    times, periods = _times(clock.time, first), np.array([row["period"] for row in rows])
    fits.plot(times, [row["fit"] for row in rows], "o", color=BLUE, ms=3)
    fits.set_ylabel("fit [%]")
    _bars(lates, times, rows, "late", 1 / periods)
    lates.set_ylabel("later than\nthe axis has it\n[samples]")
    _bars(offsets, times, rows, "offset", np.ones(len(rows)))
    offsets.set_ylabel("constant torque\nbesides the log's\n[N m, or its unit]")
    colours.plot(times, [100 * row["colour"] for row in rows], "o", color=BLUE, ms=3)
    colours.set_ylabel("residual that its\npast predicts [%]")
    colours.set_ylim(0, 105)
    _label_time(colours, first)
    for ax in (fits, lates, offsets, colours):
        ax.grid(alpha=0.25)
    return fig


def _bars(  # type: ignore[no-untyped-def]
    ax: Axes, times, rows: Sequence[Mapping[str, Any]], name: str, scale: Array
) -> None:
    """Draw something of each log over time, with ±2σ."""
    value, sd = (scale * np.array([row[name][key] for row in rows]) for key in ("value", "sd"))
    ax.errorbar(times, value, 2 * sd, fmt="o", color=BLUE, ms=3, elinewidth=0.7)
    ax.axhline(0.0, color="0.5", lw=0.8)


def _label_time(ax: Axes, first: datetime | None) -> None:
    if first is None:
        ax.set_xlabel("log")
        return
    locator = AutoDateLocator(minticks=3, maxticks=8)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))


def _over_time(
    ax: Axes,
    found: Verdict,
    clock: Clock,
    first: datetime | None,
    *,
    raw: bool = False,
    small: bool = False,
) -> None:
    """Draw a parameter over time, without what the covariates explain unless it is to be `raw`."""
    times = _times(clock.time[found.logs], first)
    warm = found.found.of_covariates
    level = found.found.level + (0.0 if raw or small else warm)
    percent = found.percent(found.series.value - level)
    _points(ax, times, percent, 200 * found.series.deviation, small=small)
    if raw:
        label = "what the covariate explains"
        ax.plot(times, found.percent(warm), color=GREEN, lw=1.1, label=label)
    ax.plot(
        times, found.percent(found.found.fitted - level), color=ORANGE, lw=1.5,
        label="with the change found" if found.found.changes else "fitted",
    )  # fmt: skip
    for change in found.found.changes:
        _mark(ax, found, change, times)
    for outlier in found.found.outliers:
        ax.plot(
            times[outlier.place], percent[outlier.place], "o", mfc="none", mec=ORANGE, ms=9, mew=1.3
        )
    if first is not None or not small:
        _label_time(ax, first)
    ax.set_ylabel(f"{symbol(found.name)} [%]")
    ax.grid(alpha=0.25)
    if not small:
        ax.legend(frameon=False, ncols=3, loc="upper left", fontsize=8)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.22 * (high - low))


def _times(days: Array, first: datetime | None) -> Any:
    if first is None:
        return [float(day) for day in days]
    return [first + timedelta(days=float(day)) for day in days]


def _points(ax: Axes, times, percent: Array, bars: Array, *, small: bool) -> None:  # type: ignore[no-untyped-def]
    size = 2 if small or len(percent) > MANY else 4
    if len(percent) > MANY:
        ax.plot(times, percent, ".", color=BLUE, ms=size, label="estimate of a log")
        return
    ax.errorbar(
        times, percent, bars, fmt="o", color=BLUE, ms=size, elinewidth=0.7,
        label="estimate of a log, ±2σ",
    )  # fmt: skip


def _mark(ax: Axes, found: Verdict, change: Change, times) -> None:  # type: ignore[no-untyped-def]
    ax.axvline(times[change.place], color="0.3", lw=0.9)
    if change.latest > change.earliest:
        ax.axvspan(times[change.earliest], times[change.latest], color="0.5", alpha=0.15, lw=0)


def _over_covariate(ax: Axes, found: Verdict, name: str, values: Array) -> None:
    """Draw the estimates over a covariate; the later the log, the darker."""
    x, late = values[found.logs], np.arange(len(found.logs))
    y = found.percent(found.series.value - found.found.level)
    drawn = ax.scatter(x, y, c=late, cmap="viridis_r", s=12)
    order = np.argsort(x)
    ax.plot(x[order], found.percent(found.found.of_covariates)[order], color=GREEN, lw=1.1)
    ax.set(xlabel=name, ylabel=f"{symbol(found.name)} [%]")
    ax.grid(alpha=0.25)
    bar = ax.figure.colorbar(drawn, ax=ax, ticks=[0, len(late) - 1])  # type: ignore[union-attr]
    bar.ax.set_yticklabels(["first log", "last"])
