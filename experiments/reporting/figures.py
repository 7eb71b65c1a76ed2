"""Every figure of flexaxis: a function each, which returns a matplotlib Figure.

Pages, `.plot()` in Python, notebooks, docs and the paper draw with these. A page hides an
estimator, and shows a value on hover, by the tags that `styles.tag` gives to artists. Figures are
430 px wide: letters are readable on a telephone, and a screen shows several side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.reporting.styles import (
    BACK,
    MUTED,
    SOFT,
    TEXT,
    Style,
    look,
    styled,
    symbols,
    tag,
)
from flexaxis.experiments.reporting.tables import between, number, short

if TYPE_CHECKING:
    import pandas as pd

Looks = Mapping[str, Style]
USUAL: Looks = MappingProxyType({})
MARKERS = "oD^sv<"  # of faults, where estimators have a row each
OTHER: dict[str, Any] = {"color": MUTED, "marker": "o", "ms": 4}
ROLES: dict[str, dict[str, Any]] = {
    "truth": {"color": TEXT, "lw": 1.1, "ls": (0, (5, 3)), "zorder": 5},
    "bound": {"color": TEXT, "lw": 1.1, "ls": (0, (1.5, 2))},
    "single": {"color": MUTED, "lw": 1.1, "ls": (0, (6, 2, 1, 2))},
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
        Decides the look.
    label : str
        For the legend, where the estimator's name will not do.
    role : {"", "truth", "bound", "single", "data"}
        What is of no estimator; `single` is the bound of a parameter that changes alone.
    kind : {"line", "steps", "points", "both"}
    tips : sequence of str
        What is shown on hover, of each point or of the curve.
    """

    x: Any
    y: Any
    low: Any = None
    high: Any = None
    estimator: str = ""
    label: str = ""
    role: str = ""
    kind: Literal["line", "steps", "points", "both"] = "line"
    tips: Sequence[str] = ()


PLAIN: Any = "none"  # no layout engine


def new(height: float) -> Axes:
    """Return axes in a figure of their own, of a height [px]."""
    return Figure(figsize=(430 / 96, height / 96)).subplots()


@styled
def curves(
    panels: Mapping[str, Sequence[Series]],
    *,
    x: str,
    logs: Sequence[str] = (),
    limits: Mapping[str, Any] = MappingProxyType({}),
    marks: Sequence[tuple[float, str]] = (),
    spans: Sequence[tuple[float, float, str]] = (),
    titles: Sequence[str] = (),
    height: float = 190,
    axes: Any = None,
    looks: Looks = USUAL,
) -> Figure:
    """Draw curves over a common abscissa, a panel below the other.

    Parameters
    ----------
    panels : mapping of str to sequence of Series
        By the label of the ordinate, with its unit.
    x : str
        Label of the abscissa, with its unit.
    logs : sequence of str
        Labels of the axes with a logarithmic scale.
    limits : mapping of str to (float, float)
        By the labels of axes.
    marks : sequence of (float, str)
        Where something happens, and what.
    spans : sequence of (float, float, str)
        What is shaded, such as burn-in.
    titles : sequence of str
        One for each panel, or none.
    height : float
        Of a panel [px].
    axes : sequence of Axes, optional
        Where to draw, one for each panel; a new figure by default.
    looks : mapping of str to Style
        Of the estimators of a page, which names them above all figures; else panels have legends.
    """
    if axes is None:
        high = 60 + height * len(panels)
        # Margins are the same in all figures: a layout engine would take half of the time.
        room = {"left": 0.15, "right": 0.97, "bottom": 44 / high, "top": 1 - 18 / high}
        figure = Figure(figsize=(430 / 96, high / 96), layout=PLAIN)
        axes = figure.subplots(len(panels), sharex=True, squeeze=False, gridspec_kw=room)[:, 0]
    for ax, title, (label, series) in zip(
        axes, titles or [""] * len(panels), panels.items(), strict=True
    ):
        for begin, end, text in spans:
            tag(ax.axvspan(begin, end, color=MUTED, alpha=0.12, lw=0), tip=text)
        for at, text in marks:
            tag(ax.axvline(at, color=MUTED, lw=0.9), tip=text)
        for place, one in enumerate(series):
            _draw(ax, one, looks, place / len(series))
        ax.set(ylabel=symbols(label), title=symbols(title))
        for axis, name in ((ax.xaxis, x), (ax.yaxis, label)):
            if name in logs and any(np.size(one.x) for one in series):
                logarithmic(axis)
        ax.autoscale()  # the axes may have limits from an earlier call
        ax.set(ylim=limits.get(label) or _limits(ax), xlim=limits.get(x))
        if not looks and ax.get_legend_handles_labels()[0]:
            ax.legend()
    axes[-1].set_xlabel(symbols(x))
    return _of(axes[0])


def _of(ax: Axes) -> Figure:
    figure = ax.get_figure(root=True)
    assert figure is not None
    return figure


def _draw(ax: Axes, one: Series, looks: Looks, phase: float) -> None:
    """Draw a series; its first marker stands at a share of their distance."""
    who, own, x = one.estimator, dict(ROLES.get(one.role, OTHER)), np.asarray(one.x, float)
    if who:
        usual = look(who, looks)
        own = own | {"color": usual["color"]} if one.role else usual
    label, tips = one.label or who or one.role or "_", one.tips
    pointed = one.kind in ("points", "both")
    if one.low is not None:
        draw, faint = (ax.vlines, 0.5) if pointed else (ax.fill_between, 0.14)
        tag(draw(x, one.low, one.high, color=own["color"], alpha=faint, lw=0.9 * pointed), who)
    if pointed:
        ax.plot([], [], **own, label=label)
        for u, v, tip in zip(x, one.y, tips or cycle([label]), strict=False):
            tag(ax.plot(u, v, **own | {"ls": ""})[0], who, tip)
        own["marker"] = label = ""
        if one.kind == "points":
            return
    elif not one.role:
        every = max(1, len(x) // 5)
        own["markevery"] = (int(phase * every), every)
    steps = "steps-post" if one.kind == "steps" else "default"
    line = ax.plot(x, one.y, **own, label=label or "_", drawstyle=steps)
    tag(line[0], who, (*tips, label)[0])


def logarithmic(axis: Any) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5, or at the decades of many."""
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 2e3 * low else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _limits(ax: Axes) -> tuple[float, float]:
    """Return limits that show all curves of some axes; a burst does not set the scale."""
    lines = [np.asarray(line.get_ydata(), float) for line in ax.get_lines()]
    usual = [np.nanpercentile(y, (2, 98)) for y in lines if np.isfinite(y).sum() > 20]
    low, high = ax.get_ylim()
    if not usual or ax.get_yscale() == "log":
        return low, high
    room = 0.6 * np.ptp(usual) + 1e-12
    return max(low, np.min(usual) - room), min(high, np.max(usual) + room)


@styled
def over_bound(
    matched: pd.DataFrame, order: Sequence[str], faults: Mapping[str, str], *, looks: Looks = USUAL
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
    looks : mapping of str to Style
    """
    ax, count = new(44 * len(order) + 95), len(faults)
    small: dict[str, Any] = {"color": MUTED, "fontsize": 8.5, "ha": "right", "va": "center"}
    for place, who in enumerate(order):
        ax.axhspan(place - 0.5, place + 0.5, color=BACK if place % 2 else SOFT, lw=0)
        own, colour = matched[matched["estimator"] == who], look(who, looks)["color"]
        for i, (fault, text) in enumerate(faults.items()):
            for row in own[own["fault"] == fault].dropna(subset="lag").to_dict("records"):
                y, lag = place + 0.5 * (i + 0.5) / count - 0.25, row["lag_interval"] or [np.nan] * 2
                tip = f"{who}, {text}: lag {short(row['lag'])} s ({between(lag)} s), "
                tip += f"{short(row['over_bound'])} × bound"
                ends = ax.hlines(y, *np.divide(lag, row["bound"]), color=colour, alpha=0.65)
                dot = ax.plot(row["over_bound"], y, MARKERS[i % 6], color=colour, mec=BACK, ms=6)
                tag(ends, who, tip), tag(dot[0], who, tip)
        text = f"{between(own['over_bound'])} ×"
        tag(ax.text(1, place, text, transform=ax.get_yaxis_transform(), **small), who)
    ax.axvline(1, color=TEXT, lw=1.2)
    logarithmic(ax.xaxis)
    ax.set(xlabel="lag / Cramér–Rao bound (1)", ylim=(len(order) - 0.5, -0.5))
    ax.set_xlim(min(0.72, ax.get_xlim()[0]), 3 * ax.get_xlim()[1])
    ax.set_yticks(range(len(order)), order, parse_math=False)
    ax.grid(axis="y", visible=False)
    for marker, text in zip(MARKERS, faults.values(), strict=False):
        ax.plot([], [], marker, color=MUTED, label=text)
    _of(ax).legend(loc="outside upper left", ncols=2, handletextpad=0.1, columnspacing=1)
    return _of(ax)


def speed_noise(
    swept: pd.DataFrame, order: Sequence[str], faults: Mapping[str, str], *, looks: Looks = USUAL
) -> Figure:
    """Draw lag against the noise before the fault, a line an estimator, and both bounds.

    Parameters
    ----------
    swept : DataFrame
        ``fault, estimator, setting, factor, lag, lag_interval, std, lag_bound,
        lag_bound_single``, a row a setting.
    order : sequence of str
    faults : mapping of str to str
        What each fault is called; a panel each.
    looks : mapping of str to Style
    """
    panels: dict[str, list[Series]] = {}
    for fault in faults:
        own = swept[(swept["fault"] == fault) & (swept["lag"] > 0) & (swept["std"] > 0)]
        usual = own[(own["estimator"] == REFERENCE) & (own["factor"] == 1)]
        own = own.assign(x=own["std"] / (usual if len(usual) else own)["std"].median())
        own = own.sort_values("factor")
        series = [points(own[own["estimator"] == who], "x", "lag", who) for who in order[::-1]]
        for role, name in (("bound", "lag_bound"), ("single", "lag_bound_single")):
            bound = own[name].astype(float).median()
            series.append(Series(x=own["x"].agg(["min", "max"]), y=[bound] * 2, role=role))
        panels[f"lag [s]{' ' * len(panels)}"] = series
    x = f"noise before the fault / that of {REFERENCE}"
    return curves(panels, x=x, logs=[x, *panels], titles=list(faults.values()), height=165,
                  marks=[(1.0, "read off in the table")], looks=looks)  # fmt: skip


def points(rows: pd.DataFrame, x: str, y: str, estimator: str, **options: Any) -> Series:
    """Return columns of rows as points with the intervals of the second, on a line."""
    rows = rows.dropna(subset=y)
    names = rows.get("setting", rows["estimator"])
    tips = [f"{name}: {y} {short(v)} at {short(u)}"
            for name, u, v in zip(names, rows[x], rows[y], strict=True)]  # fmt: skip
    ends = rows.get(f"{y}_interval", rows[y]).map(lambda each: np.nan if each is None else each)
    low, high = (ends.map(lambda each, i=i: np.ravel(each)[i]).astype(float) for i in (0, -1))
    return Series(x=rows[x], y=rows[y], low=low, high=high, estimator=estimator, tips=tips,
                  **{"kind": "both"} | options)  # fmt: skip


def lag_against_noise(rows: pd.DataFrame, order: Sequence[str], **options: Any) -> Figure:
    """Draw lag against noise, a point a row: single runs, or faults at default settings.

    Parameters
    ----------
    rows : DataFrame
        ``estimator, setting, lag, std``; `setting` is what is shown on hover.
    order : sequence of str
    **options
        As of `curves`.
    """
    able, x = rows[(rows["lag"] > 0) & (rows["std"] > 1e-9)], "std before the fault [% of nominal]"
    series = [points(able[able["estimator"] == w], "std", "lag", w, kind="points") for w in order]
    return curves({"lag [s]": series}, x=x, logs=[x, "lag [s]"], height=280, **options)


def shares(ratios: Mapping[str, Any], problems: int, **options: Any) -> Figure:
    """Draw the share of runs with a lag of at most so many times the bound.

    Parameters
    ----------
    ratios : mapping of str to ndarray
        lag / bound of the runs that reached anything, increasing, by estimator.
    problems : int
        Number of runs, those that reached nothing among them.
    **options
        As of `curves`.
    """
    end, series = 1.1 * max([2.0, *map(max, filter(len, ratios.values()))]), []
    for who, each in ratios.items():
        x, y = np.r_[each, end], np.r_[1 : len(each) + 1, len(each)] / problems
        part = slice(None, None, max(1, len(x) // 240))
        near = 100 * np.sum(each <= 2) / problems
        tip = f"{who}: {near:.0f} % of the runs within twice the bound"
        series.append(Series(x=x[part], y=y[part], estimator=who, kind="steps", tips=[tip]))
    x, y = "lag / Cramér–Rao bound", "share of runs"
    return curves({y: series}, x=x, logs=[x], limits={y: (0.0, 1.02)}, marks=[(1.0, "bound")],
                  height=280, **options)  # fmt: skip


@styled
def score_map(
    cells: pd.DataFrame, *, title: str, x: str, y: str, limits: tuple[float, float]
) -> Figure:
    """Draw a score of an estimator over two axes of a study, its value in each cell.

    Parameters
    ----------
    cells : DataFrame
        Values of the ordinate down, those of the abscissa across.
    title, x, y : str
    limits : (float, float)
        Of the colours, the same in maps that are compared.
    """
    ax, values = new(90 + 32 * len(cells)), cells.to_numpy(float)
    norm = LogNorm(limits[0], 1.001 * limits[1])
    ax.pcolormesh(np.ma.masked_invalid(values), norm=norm, cmap="cividis")
    for (row, column), value in np.ndenumerate(values):
        letters = "#000000" if norm(value) > 0.47 else "#fffffe"  # from there black reads easier
        ax.text(column + 0.5, row + 0.5, short(value), color=letters, ha="center", va="center")
    ax.set_xticks(np.arange(cells.shape[1]) + 0.5, map(number, cells.columns))
    ax.set_yticks(np.arange(cells.shape[0]) + 0.5, map(number, cells.index))
    ax.set(xlabel=symbols(x), ylabel=symbols(y))
    ax.set_title(title, parse_math=False)
    ax.grid(visible=False)
    return _of(ax)


VERDICTS = {"worse": "#b3261e", "better": "#1b7f4d", "undecided": "#b26b00"}


@styled
def verdict_intervals(rows: Sequence[Mapping[str, Any]], *, axes: Axes | None = None) -> Figure:
    """Draw changes with their intervals and margins, a line a score, the first thirty.

    Parameters
    ----------
    rows : sequence of mapping
        Of a verdict, as `flexaxis compare --json` prints them; those without interval are left out.
    axes : Axes, optional
        Where to draw; a new figure by default.
    """
    shown = [row for row in rows if None not in (row["change"], *row["interval"])][:30]
    ax, names = axes or new(60 + 24 * len(shown)), []
    for place, row in enumerate(shown):
        parts = np.array([row["change"], *row["interval"], row["margin"] or 0])
        # A difference may be less than all of the base: it ends at the edge of the scale.
        change, *ends, margin = np.maximum(1 + parts / (row["scale"] or 1), 0.01)
        name = f"{row['metric']} of {row['parameter']}, {row['scenario']}: {row['verdict']}"
        names.append(symbols(name))
        colour = VERDICTS.get(row["verdict"], MUTED)
        ax.hlines(place, 1 / margin, margin, color=MUTED, lw=7, alpha=0.25)
        ax.hlines(place, *ends, color=colour, lw=2)
        tip = f"{name}, × {short(change)} ({between(ends)})"
        tag(ax.plot(change, place, "o", color=colour)[0], tip=tip)
    ax.axvline(1.0, color=TEXT, lw=0.9)
    ax.set(ylim=(len(shown) - 0.4, -0.6), xlabel="candidate / base: less is better")
    ax.set_yticks(range(len(names)), names)
    logarithmic(ax.xaxis)
    ax.grid(axis="y", visible=False)
    return _of(ax)
