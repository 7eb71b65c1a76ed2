"""Figures: curves over an abscissa, maps, verdicts; a function each, which returns a Figure.

Pages, `.plot()` in Python, notebooks, docs and the paper draw with these, and with `run_figures`.
A page hides an estimator, and shows a value on hover, by the tags that `styles.tag` gives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.reporting.styles import (
    MUTED,
    TEXT,
    Style,
    look,
    styled,
    tag,
)
from flexaxis.experiments.reporting.tables import SYMBOL, short

if TYPE_CHECKING:
    import pandas as pd

    from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Looks = Mapping[str, Style]

WIDE, NARROW = 650, 366  # px of a figure on a screen, and on that of a telephone
POINTS = 240  # of a curve at the most: a pixel holds no more
USUAL: Looks = MappingProxyType({})
_ROLES: dict[str, dict[str, Any]] = {
    "truth": {"color": TEXT, "lw": 1.1, "ls": (0, (5, 3)), "zorder": 5},
    "bound": {"color": TEXT, "lw": 1.1, "ls": (0, (1.5, 2))},
    "data": {"color": MUTED, "lw": 1.0},
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Series:
    """A curve, or points.

    Attributes
    ----------
    x, y : (M,) array
    low, high : (M,) array, optional
        A band about a curve; whiskers of points.
    estimator : str
        Decides the look; empty for truth, bounds and data.
    label : str
        For the legend, where the estimator's name will not do.
    kind : {"line", "steps", "points", "both"}
    role : {"estimate", "truth", "bound", "data"}
    tips : sequence of str
        What is shown on hover of each point, or of the curve.
    """

    x: ArrayLike
    y: ArrayLike
    low: ArrayLike | None = None
    high: ArrayLike | None = None
    estimator: str = ""
    label: str = ""
    kind: Literal["line", "steps", "points", "both"] = "line"
    role: Literal["estimate", "truth", "bound", "data"] = "estimate"
    tips: Sequence[str] = ()


@styled
def curves(
    panels: Mapping[str, Sequence[Series]],
    *,
    x: str,
    x_log: bool = False,
    y_log: Sequence[str] = (),
    limits: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    window: tuple[float, float] | None = None,
    marks: Sequence[tuple[float, str]] = (),
    spans: Sequence[tuple[float, float, str]] = (),
    titles: Sequence[str] = (),
    width: float = WIDE,
    height: float = 180,
    axes: Sequence[Axes] | None = None,
    looks: Looks = USUAL,
    legend: bool = True,
) -> Figure:
    """Draw curves over a common abscissa, a panel below the other.

    Parameters
    ----------
    panels : mapping of str to sequence of Series
        By the label of the ordinate, with its unit.
    x : str
        Label of the abscissa, with its unit.
    x_log : bool
    y_log : sequence of str
        Panels with a logarithmic ordinate.
    limits : mapping of str to (float, float)
        Of the ordinates of some panels.
    window : (float, float), optional
        Of the abscissa.
    marks : sequence of (float, str)
        Where something happens, and what.
    spans : sequence of (float, float, str)
        What is shaded, such as burn-in.
    titles : sequence of str
        One for each panel, or none.
    width, height : float
        Of the figure, and of a panel [px].
    axes : sequence of Axes, optional
        Where to draw, one for each panel; a new figure by default.
    looks : mapping of str to Style
        Of the estimators of a page.
    legend : bool
        Whether there is one in each panel, of what no earlier panel names.
    """
    if axes is None:
        figure = Figure(figsize=(width / 96, (45 + height * len(panels)) / 96))
        axes = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
    named: set[str] = set()
    for place, (ax, (label, series)) in enumerate(zip(axes, panels.items(), strict=True)):
        for begin, end, text in spans:
            tag(ax.axvspan(begin, end, color=MUTED, alpha=0.12, lw=0), tip=text)
        for at, text in marks:
            tag(ax.axvline(at, color=MUTED, lw=0.9), tip=text)
        for order, one in enumerate(series):
            _draw(ax, one, looks, order / max(1, len(series)))
        ax.set_ylabel(symbols(label))
        ax.set_title(symbols(titles[place]) if titles else "")
        _scales(ax, x_log, label in y_log)
        ax.set(xlim=window or ax.get_xlim(), ylim=limits.get(label) or _limits(ax))
        lines, labels = ax.get_legend_handles_labels()
        fresh = {text: line for line, text in zip(lines, labels, strict=True) if text not in named}
        if legend and fresh:
            _unparsed(ax.legend(fresh.values(), fresh.keys()))
            named |= fresh.keys()
    axes[-1].set_xlabel(symbols(x))
    figure = axes[0].get_figure(root=True)
    assert figure is not None
    return figure


def _draw(ax: Axes, one: Series, looks: Looks, phase: float) -> None:
    """Draw a series; its first marker stands at a share of their distance."""
    x, y = np.asarray(one.x, float), np.asarray(one.y, float)
    low, high = (None if side is None else np.asarray(side, float) for side in (one.low, one.high))
    own = _ROLES.get(one.role) or {}
    if one.estimator:
        own = look(one.estimator, looks) | {k: v for k, v in own.items() if k != "color"}
    label = one.label or one.estimator or ("truth" if one.role == "truth" else "_")
    if one.kind in ("points", "both"):
        return _points(ax, one, own or {"color": MUTED, "marker": "o", "markersize": 4}, label)
    if low is not None and high is not None:
        tag(ax.fill_between(x, low, high, color=own["color"], alpha=0.14, lw=0), one.estimator)
    if "marker" in own:
        every = max(1, len(x) // 5)
        own |= {"markevery": (int(phase * every), every) if one.role == "estimate" else []}
    steps = {"drawstyle": "steps-post"} if one.kind == "steps" else {}
    line = ax.plot(x, y, label=label, **own | steps)[0]
    tag(line, one.estimator, one.tips[0] if one.tips else label.removeprefix("_"))
    return None


def _points(ax: Axes, one: Series, own: Mapping[str, Any], label: str) -> None:
    """Draw points with whiskers; one artist a point, so that each shows its value."""
    x, y = np.asarray(one.x, float), np.asarray(one.y, float)
    thin = {"color": own["color"], "lw": 0.9, "alpha": 0.5}
    dots = dict(own) | {"linestyle": ""}
    if one.kind == "both":
        tag(ax.plot(x, y, **dict(own) | {"marker": "", "lw": 1.4})[0], one.estimator)
    if one.low is not None and one.high is not None:
        for at, *ends in np.stack([x, np.asarray(one.low), np.asarray(one.high)], axis=1):
            tag(ax.plot([at, at], ends, **thin)[0], one.estimator)
    for place, (u, v) in enumerate(zip(x, y, strict=True)):
        usual = f"{label.removeprefix('_')}: {short(v)} at {short(u)}"
        tag(ax.plot(u, v, **dots)[0], one.estimator, one.tips[place] if one.tips else usual)
    ax.plot([], [], label=label, **own)


def _scales(ax: Axes, x_log: bool, y_log: bool) -> None:
    """Set logarithmic scales with plain numbers at 1, 2 and 5."""
    for axis, wanted in ((ax.xaxis, x_log), (ax.yaxis, y_log)):
        if wanted:
            plain_log(axis)


def plain_log(axis: Any) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5 or at the decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 2e3 * low else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _limits(ax: Axes) -> tuple[float, float]:
    """Return limits that show all curves of some axes; a burst does not set the scale."""
    lines = [
        np.asarray(line.get_ydata(), float)
        for line in ax.get_lines()
        if line.get_transform() == ax.transData
    ]
    spread = [np.nanpercentile(y, (2, 98)) for y in lines if len(y) > 2 and np.isfinite(y).any()]
    low, high = ax.get_ylim()
    if not spread or ax.get_yscale() == "log":
        return low, high
    room = 0.6 * (np.max(spread) - np.min(spread)) + 1e-12
    return max(low, float(np.min(spread) - room)), min(high, float(np.max(spread) + room))


def around(scenario: Scenario) -> dict[str, Any]:
    """Return what a figure over the time of a scenario marks, as options of `curves`."""
    events = {event.parameter: event for event in reversed(scenario.events())}.values()
    spans = [(0.0, scenario.burn_in, "burn-in")] if scenario.burn_in else []
    still = np.flatnonzero(np.diff(np.r_[1, scenario.excited(), 1])) * scenario.period
    spans += [(a, b, "no excitation") for a, b in zip(still[::2], still[1::2], strict=True)]
    marks = [(e.index * scenario.period, f"{e.parameter} changes") for e in events]
    return {"marks": marks, "spans": spans}


def symbols(text: str) -> str:
    """Return a text with its symbols, such as f_m, as matplotlib sets them.

    Examples
    --------
    >>> symbols("1/J_a / nominal")
    '1/$J_{a}$ / nominal'
    """
    return SYMBOL.sub(r"$\1_{\2}$", text)


def _unparsed(legend: Any) -> Any:
    """Return a legend whose labels are shown as typed: a name may hold a dollar sign."""
    for text in legend.get_texts():
        text.set_parse_math(False)
    return legend


@styled
def lag_maps(
    maps: Mapping[str, pd.DataFrame],
    *,
    x: str,
    y: str,
    value: str = "lag [s]",
    width: float = WIDE,
) -> Figure:
    """Draw a score over two axes of a study, a map an estimator, its value in each cell.

    Parameters
    ----------
    maps : mapping of str to DataFrame
        By estimator: values of the ordinate down, those of the abscissa across.
    x, y, value : str
        Labels.
    width : float
        [px]
    """
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    columns = 1 if width < 500 else min(3, len(maps))
    lines = -(-len(maps) // columns)
    high = 70 + 30 * max(len(each) for each in maps.values())
    figure = Figure(figsize=(width / 96, (high * lines + 20) / 96))
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    known = np.concatenate([each.to_numpy(float).ravel() for each in maps.values()])
    known = known[np.isfinite(known) & (known > 0)]
    norm, colours = LogNorm(known.min(), 1.001 * known.max()), colormaps["cividis"]
    for ax, (name, cells) in zip(axes, maps.items(), strict=False):
        values = np.ma.masked_invalid(cells.to_numpy(float))
        ax.pcolormesh(values, norm=norm, cmap=colours)
        for (row, column), cell in np.ndenumerate(values.filled(np.nan)):
            light = np.isfinite(cell) and norm(cell) > 0.47  # from there black is easier to read
            own = {"color": "#000000" if light else "#fffffe", "ha": "center", "va": "center"}
            tip = f"{name}: {value} {short(cell)}"
            if np.isfinite(cell):
                tag(ax.text(column + 0.5, row + 0.5, short(cell), **own), name, tip)
        ax.set_xticks(np.arange(cells.shape[1]) + 0.5, [f"{v:.4g}" for v in cells.columns])
        ax.set_yticks(np.arange(cells.shape[0]) + 0.5, [f"{v:.4g}" for v in cells.index])
        ax.grid(visible=False)
        ax.set_title(name, parse_math=False)
    for ax in axes[len(maps) :]:
        ax.set_axis_off()
    figure.supxlabel(symbols(x), fontsize=9)
    figure.supylabel(symbols(y), fontsize=9)
    return figure


VERDICTS = {"worse": "#b3261e", "better": "#1b7f4d", "undecided": "#b26b00"}


@styled
def verdict_intervals(
    rows: Sequence[Mapping[str, Any]],
    *,
    names: tuple[str, str] = ("base", "candidate"),
    width: float = WIDE,
    axes: Axes | None = None,
) -> Figure:
    """Draw changes with their intervals and margins, a line a score, the worst on top.

    Parameters
    ----------
    rows : sequence of mapping
        ``name, verdict, change, interval, margin``; changes as shares, -0.1 is 10 % less.
    names : (str, str)
        Base and candidate.
    width : float
        [px]
    axes : Axes, optional
        Where to draw; a new figure by default.
    """
    if axes is None:
        figure = Figure(figsize=(width / 96, (60 + 24 * max(1, len(rows))) / 96))
        axes = figure.subplots()
    for place, row in enumerate(rows):
        # A difference may be less than all of the base: it ends at the edge of the scale.
        change, low, high = (max(1 + end, 0.01) for end in (row["change"], *row["interval"]))
        colour = VERDICTS.get(row["verdict"], MUTED)
        tip = f"{row['name']}: {row['verdict']}, × {short(change)} ({short(low)}–{short(high)})"
        margin = [1 / (1 + row["margin"]), 1 + row["margin"]]
        axes.plot(margin, [place, place], color=MUTED, lw=7, alpha=0.25, solid_capstyle="butt")
        tag(axes.plot([low, high], [place, place], color=colour, lw=2)[0], tip=tip)
        tag(axes.plot(change, place, "o", color=colour)[0], tip=tip)
    axes.axvline(1.0, color=TEXT, lw=0.9)
    labels = [symbols(f"{row['name']}: {row['verdict']}") for row in rows]
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlabel=f"{names[1]} / {names[0]}: less is better")
    axes.set_yticks(range(len(rows)), labels)
    plain_log(axes.xaxis)
    axes.grid(axis="y", visible=False)
    found = axes.get_figure(root=True)
    assert found is not None
    return found
