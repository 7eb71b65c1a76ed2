"""Draw the figures of flexaxis. Each function draws one figure and returns a matplotlib Figure.

Report pages, notebooks, the documentation and the `.plot()` methods use this module. The function
`styles.tag` adds tags to the curves, so that a page can hide the curves of an estimator and show
the values under the pointer. Figures are 430 px wide, so several figures fit side by side on a
screen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.reporting import styles
from flexaxis.experiments.reporting.styles import MUTED, TEXT, look, styled, symbols, tag
from flexaxis.experiments.reporting.tables import between, number, short
from flexaxis.experiments.scoring.curves import estimates, truth
from flexaxis.sim.scenario import Scenario

Looks = Mapping[str, styles.Style]
USUAL: Looks = {}
MARKERS = "oD^sv<"  # markers of the faults in figures with one row per estimator
ROLES: dict[str, dict[str, Any]] = {
    "truth": {"color": TEXT, "lw": 1.1, "ls": (0, (5, 3)), "marker": "", "zorder": 5},
    "bound": {"color": TEXT, "ls": (0, (1.5, 2)), "marker": ""},
    "data": {"color": MUTED, "ls": "-", "marker": ""},
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Series:
    """The data of one curve or one set of points in a figure.

    Attributes
    ----------
    x, y : (M,) array
        Horizontal and vertical coordinates of all points.
    low, high : (M,) array, optional
        Lower and upper limits of a band around a curve, or of the error bars of points.
    estimator : str
        Name of the estimator, which determines the drawing style.
    label : str
        Label in the legend (default: the name of the estimator).
    role : {"", "truth", "bound", "data"}
        Type of the data: estimator data (""), true values, a bound, or other data ("data").
    kind : {"line", "steps", "points", "both"}
        Drawing type: a line, a staircase line, points, or points joined by a line ("both").
    """

    x: Any
    y: Any
    low: Any = None
    high: Any = None
    estimator: str = ""
    label: str = ""
    role: str = ""
    kind: Literal["line", "steps", "points", "both"] = "line"


def new(height: float, count: int = 1) -> list[Any]:
    """Create a figure that is `height` pixels high, and return its `count` stacked axes."""
    figure = Figure(figsize=(430 / 96, height / 96))
    return list(figure.subplots(count, sharex=True, squeeze=False)[:, 0])


@styled
def curves(
    panels: Mapping[str, Sequence[Series]],
    *,
    x: str,
    logs: Sequence[str] = (),
    limits: Mapping[str, Any] = USUAL,
    marks: Sequence[tuple[float, str]] = (),
    spans: Sequence[tuple[float, float, str]] = (),
    axes: Any = None,
    looks: Looks = USUAL,
) -> Figure:
    """Draw curves in vertically stacked panels with a shared horizontal axis.

    Parameters
    ----------
    panels : mapping of str to sequence of Series
        Curves of each panel, keyed by the label of its vertical axis.
    x : str
        Label of the horizontal axis.
    logs : sequence of str
        Labels of the axes that have a logarithmic scale.
    limits : mapping of str to (float, float)
        Axis limits, keyed by axis label.
    marks : sequence of (float, str)
        Vertical lines that mark events, each with a horizontal position and a description.
    spans : sequence of (float, float, str)
        Shaded intervals, each with a start, an end, and a description such as "burn-in".
    axes : sequence of Axes, optional
        Matplotlib axes, one for each panel (default: axes of a new figure).
    looks : mapping of str to Style
        Styles of the estimators on a page, keyed by estimator name. Without `looks`, the function
        adds a legend to each panel.
    """
    axes = new(60 + 200 * len(panels), len(panels)) if axes is None else axes
    for ax, (label, series) in zip(axes, panels.items(), strict=True):
        for begin, end, text in spans:
            tag(ax.axvspan(begin, end, color=MUTED, alpha=0.1, lw=0), tip=text)
        for at, text in marks:
            tag(ax.axvline(at, color=MUTED), tip=text)
        for one in series:
            _draw(ax, one, looks)
        for axis, name in ((ax.xaxis, x), (ax.yaxis, label)):
            if name in logs:
                logarithmic(axis)
        ax.autoscale()  # an earlier call may have set limits for these axes
        usual = None if label in logs else _usual(ax)
        ends = {"ylim": limits.get(label, usual), "xlim": limits.get(x)}
        ax.set(ylabel=symbols(label), **{key: pair for key, pair in ends.items() if pair})
        if not looks and ax.get_legend_handles_labels()[0]:
            ax.legend()
    axes[-1].set_xlabel(symbols(x))
    return axes[0].figure


def _usual(ax: Axes) -> tuple[float, float] | None:
    """Return limits of the vertical axis that leave out outliers, or None for default limits."""
    values = np.concatenate([line.get_ydata() for line in ax.get_lines()] or [[]])
    if len(values) < 100:
        return None
    low, high = np.nanpercentile(values, (2, 98))
    room = 0.6 * (high - low) + 0.05 * abs(high)
    return (low - room, high + room) if 0 < room < np.inf else None


def _draw(ax: Axes, one: Series, looks: Looks) -> None:
    """Draw one data series, with about five markers on a continuous line."""
    who, usual = one.estimator, look(one.estimator or "another", looks)
    own = usual | ROLES.get(one.role, {}) | ({"color": usual["color"]} if who else {})
    label, pointed = one.label or who or one.role, one.kind in ("points", "both")
    if one.low is not None:
        band, shade = (ax.vlines, 0.5) if pointed else (ax.fill_between, 0.2)
        tag(band(one.x, one.low, one.high, color=own["color"], alpha=shade, lw=0.9 * pointed), who)
    for u, v in zip(one.x, one.y, strict=True) if pointed else ():
        tag(ax.plot(u, v, **own | {"ls": ""})[0], who, f"{label}: {short(v)} at {short(u)}")
    own["ls"] = "" if one.kind == "points" else own["ls"]
    steps = "steps-post" if one.kind == "steps" else "default"
    every: Any = [] if pointed else len(one.x) // 5 or 1
    line = ax.plot(one.x, one.y, **own, label=label, drawstyle=steps, markevery=every)
    tag(line[0], who, label)


def logarithmic(axis: Any) -> None:
    """Make an axis logarithmic; label 1, 2 and 5 of each decade (only 1 if the range is wide)."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 2e3 * low else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def _interval(ax: Axes, place: float, parts: Any, who: str, tip: str, **own: Any) -> None:
    """Draw a value as a dot, and its interval as a line, at the vertical position `place`."""
    value, *ends = parts
    tag(ax.hlines(place, *ends, color=own["color"]), who, tip)
    tag(ax.plot(value, place, ls="", mec=styles.BACK, ms=6, **own)[0], who, tip)


def _rows(ax: Any, names: Sequence[str], label: str, **options: Any) -> Figure:
    """Label the rows of a figure, make the horizontal axis logarithmic, and return the figure."""
    ax.axvline(1, color=TEXT)
    logarithmic(ax.xaxis)
    ax.set(xlabel=label, ylim=(max(len(names), 1) - 0.5, -0.5))
    ax.set_yticks(range(len(names)), names, **options)
    return ax.figure


@styled
def over_bound(
    matched: pd.DataFrame, order: Sequence[str], faults: Mapping[str, str], *, looks: Looks = USUAL
) -> Figure:
    """Draw the ratios of lag to Cramér–Rao bound, with a row per estimator and a dot per fault.

    Horizontal lines are 95 % confidence intervals. The vertical line at 1 is the Cramér–Rao bound.

    Parameters
    ----------
    matched : DataFrame
        Scores at equal noise in the columns ``fault, estimator, lag, lag_interval, bound,
        over_bound``.
    order : sequence of str
        Names of the estimators in the order of the rows.
    faults : mapping of str to str
        Descriptions of the faults, keyed by fault name.
    looks : mapping of str to Style
        Styles of the estimators, keyed by estimator name.
    """
    (ax,), known = new(44 * len(order) + 95), list(faults)
    for row in matched[matched["lag"] > 0].to_dict("records"):
        who, i, ends = row["estimator"], known.index(row["fault"]), row["lag_interval"]
        place = order.index(who) + (i + 0.5) / len(known) / 2 - 0.25
        tip = f"{who}, {faults[row['fault']]}: lag {short(row['lag'])} s ({between(ends)} s)"
        parts = np.divide([row["lag"], *(ends or [np.nan] * 2)], row["bound"])
        colour = look(who, looks)["color"]
        _interval(ax, place, parts, who, tip, color=colour, marker=MARKERS[i % 6])
    for marker, text in zip(MARKERS, faults.values(), strict=False):
        ax.plot([], [], marker, color=MUTED, label=text)
    ax.figure.legend(loc="outside upper left", ncols=2)
    return _rows(ax, order, "lag / Cramér–Rao bound (1)", parse_math=False)


def around(scenario: Scenario) -> dict[str, Any]:
    """Return options that make `curves` mark the events, burn-in and pauses of a scenario."""
    edges = np.flatnonzero(np.diff(np.r_[1, scenario.excited(), 1])) * scenario.period
    still = [(*pair, "no excitation") for pair in edges.reshape(-1, 2)]
    return {
        "marks": [(e.index * scenario.period, f"{e.parameter} changes") for e in scenario.events()],
        "spans": [(0.0, scenario.burn_in, "burn-in"), *still],
    }


def medians(
    traces: Mapping[str, Mapping[int, Any]], scenario: Scenario, name: str,
    window: tuple[float, float], *, banded: Sequence[str],
) -> list[Series]:  # fmt: skip
    """Return curves of the true parameter value and of each estimator's median estimates.

    Parameters
    ----------
    traces : mapping of str to mapping
        Estimates over time, keyed first by estimator and then by seed.
    scenario : Scenario
        Scenario of the runs.
    name : str
        Name of the estimated parameter.
    window : (float, float)
        Start and end of the displayed time window [s].
    banded : sequence of str
        Names of the estimators whose curves have a band from the 10 % to the 90 % quantile.
    """
    series = []
    for who, own in traces.items():
        runs = estimates(own, scenario, name).loc[slice(*window)]
        runs = runs.iloc[:: max(1, len(runs) // 130)]  # one point per 2 px
        low, middle, high = runs.quantile([0.1, 0.5, 0.9], axis=1).to_numpy()
        band = {"low": low, "high": high} if who in banded else {}
        series.append(Series(x=runs.index, y=middle, estimator=who, **band))
    true = truth(scenario, name).loc[slice(*window)]
    return [*series, Series(x=true.index, y=true, role="truth", kind="steps")]


def speed_noise(swept: pd.DataFrame, faults: Mapping[str, str], *, looks: Looks = USUAL) -> Figure:
    """Plot the lag against the noise, with a line per estimator and a line for the lag bound.

    Parameters
    ----------
    swept : DataFrame
        Scores with one row per setting, in the columns ``fault, estimator, factor, lag,
        lag_interval, std, lag_bound``.
    faults : mapping of str to str
        Descriptions of the faults, keyed by fault name. The figure has one panel for each fault.
    looks : mapping of str to Style
        Styles of the estimators, keyed by estimator name.
    """
    panels = {}
    for fault, text in faults.items():
        own = swept[(swept["fault"] == fault) & (swept["lag"] > 0) & (swept["std"] > 0)]
        usual = own[(own["estimator"] == REFERENCE) & (own["factor"] == 1)]
        own = own.assign(x=own["std"] / usual["std"].median())
        panels[f"{text}\nlag [s]"] = lines(own, "x", "lag")
    x = f"noise before the fault, relative to {REFERENCE}"
    marks = [(1.0, "noise level used in the table")]
    return curves(panels, x=x, logs=[x, *panels], marks=marks, looks=looks)


def lines(rows: pd.DataFrame, x: str, y: str, kind: Any = "both") -> list[Series]:
    """Return a curve with error bars for each estimator, and the lag bound if `y` is the lag.

    Parameters
    ----------
    rows : DataFrame
        Scores with the columns `x`, `y` and ``estimator``. The column ``lag_bound`` and the
        interval of `y` are optional.
    x, y : str
        Names of the columns for the horizontal and the vertical axis.
    kind : str
        Drawing type of the curves (see `Series`).
    """
    rows, series = rows.dropna(subset=y).sort_values(x), []
    for who, own in rows.groupby("estimator", sort=False):
        ends = pd.Series(own.get(f"{y}_interval"), own.index, dtype=object).str
        low, high = ends[0].astype(float), ends[1].astype(float)
        series.append(Series(x=own[x], y=own[y], low=low, high=high, estimator=str(who), kind=kind))
    if y == "lag" and kind == "both" and rows["lag_bound"].notna().any():
        bound = rows["lag_bound"].astype(float).groupby(rows[x]).median()
        series.append(Series(x=bound.index, y=bound, role="bound"))
    return series


def lag_against_noise(rows: pd.DataFrame, **options: Any) -> Figure:
    """Plot the lag against the noise, with one point for each row of `rows`.

    Parameters
    ----------
    rows : DataFrame
        Scores of single runs, or pooled scores, in the columns ``estimator, lag, std``.
    **options
        Options of `curves`.
    """
    able, x = rows[(rows["lag"] > 0) & (rows["std"] > 1e-9)], "std before the fault [% of nominal]"
    panels = {"lag [s]": lines(able, "std", "lag", kind="points")}
    return curves(panels, x=x, logs=[x, "lag [s]"], **options)


def shares(runs: pd.DataFrame, **options: Any) -> Figure:
    """Draw, for each estimator, the cumulative distribution of the lag divided by the lag bound.

    The lag is regarded as infinite if a run diverged, or if the estimator does not estimate the
    changed parameter.

    Parameters
    ----------
    runs : DataFrame
        Scores with one row per run, in the columns ``scenario, parameter, seed, estimator, lag,
        lag_bound, over_bound, diverged``. The function ignores runs without a Cramér–Rao bound.
    **options
        Options of `curves`.
    """
    x, y, series = "lag / Cramér–Rao bound", "fraction of runs", []
    runs = runs[runs["lag_bound"] > 0].sort_values("over_bound")
    count = len(runs.drop_duplicates(["scenario", "parameter", "seed"]))
    reached = runs[~runs["diverged"].astype(bool) & runs["lag"].notna()]
    for who, own in reached.groupby("estimator")["over_bound"]:
        up = np.arange(1, len(own) + 1) / count
        series.append(Series(x=own, y=up, estimator=str(who), kind="steps"))
    marks = [(1.0, "bound")]
    return curves({y: series}, x=x, logs=[x], limits={y: (0, 1.02)}, marks=marks, **options)


@styled
def score_map(
    cells: pd.DataFrame, *, title: str, x: str, y: str, limits: tuple[float, float]
) -> Figure:
    """Draw a map of a score as a function of two swept settings of a study.

    Each cell of the map contains the score at one combination of the two settings.

    Parameters
    ----------
    cells : DataFrame
        Values of the score. The index contains the values on the vertical axis, and the column
        labels are the values on the horizontal axis.
    title, x, y : str
        Title and axis labels.
    limits : (float, float)
        Limits of the colour scale. To compare several maps, use the same limits for all maps.
    """
    (ax,), (low, high) = new(90 + 60 * len(cells)), limits
    # the colour scale ends at 10 × high, so that all cells are light and black text is readable
    ax.pcolormesh(cells, norm=LogNorm(low, 10 * high), cmap="Blues")
    for (row, column), value in np.ndenumerate(cells):
        ax.text(column + 0.5, row + 0.5, short(value), color="#000000", ha="center", va="center")
    ax.set_xticks(np.arange(cells.shape[1]) + 0.5, map(number, cells.columns))
    ax.set_yticks(np.arange(cells.shape[0]) + 0.5, map(number, cells.index))
    ax.set(xlabel=symbols(x), ylabel=symbols(y))
    ax.set_title(title, parse_math=False)
    return ax.figure


VERDICTS = {"worse": "#b3261e", "better": "#1b7f4d", "undecided": "#b26b00"}


@styled
def verdict_intervals(rows: Sequence[Mapping[str, Any]], *, axes: Axes | None = None) -> Figure:
    """Draw the change in each score with its confidence interval and margin, one line per score.

    Parameters
    ----------
    rows : sequence of mapping
        Score rows of a comparison, from the output of `flexaxis compare --json`. The function
        ignores rows without a confidence interval.
    axes : Axes, optional
        Matplotlib axes for the figure (default: axes of a new figure).
    """
    shown = [row for row in rows if None not in (row["change"], *row["interval"])]
    ax, names = axes or new(60 + 24 * len(shown))[0], []
    for place, row in enumerate(shown):
        parts = np.array([row["change"], *row["interval"], row["margin"] or 0])
        # The logarithmic scale cannot show a ratio of 0 or below. Such a ratio is drawn at 0.01.
        *ratios, margin = np.maximum(1 + parts / (row["scale"] or 1), 0.01)
        name = f"{row['metric']} of {row['parameter']}, {row['scenario']}: {row['verdict']}"
        tip = f"{name}, × {short(ratios[0])} ({between(ratios[1:])})"
        names.append(symbols(name))
        ax.hlines(place, 1 / margin, margin, color=MUTED, lw=7, alpha=0.2)
        colour = VERDICTS.get(row["verdict"], MUTED)
        _interval(ax, place, ratios, "", tip, color=colour, marker="o")
    return _rows(ax, names, "ratio of candidate to base (smaller is better)")
