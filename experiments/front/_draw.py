"""Figures of the front door: matplotlib axes in, axes out, in the style of the reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.experiments.reporting import figures
from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.run.over_time import around as over_time_of
from flexaxis.experiments.reporting.scales import Scale, upward
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexaxis.sim.scenario import Scenario

FAR = 1.0
"""Peaks up to so many heights beyond what is covered anyway are shown; farther, all else would be
less than half of the panel, and they are marked at its edge."""
UNITS = {**LAW_UNITS, **PARAMETER_UNITS}


def panels(given: Any, count: int) -> list[Axes]:
    """Return axes to draw on, one below the other: those given, or new ones.

    Raises
    ------
    FlexaxisError
        If others than `count` were given.
    """
    if given is None:
        from matplotlib import pyplot

        size = (8.0, max(4.0, 1.0 + 1.6 * count))
        figure, found = pyplot.subplots(
            count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained"
        )
        del figure
        return list(found[:, 0])
    axes = list(np.ravel(np.asarray(given, object)))
    if len(axes) != count:
        raise FlexaxisError(
            f"{len(axes)} axes were given for {count} panels: give as many "
            f"(plt.subplots({count})), name fewer panels, or give none"
        )
    return axes


def returned(axes: Sequence[Axes]) -> Any:
    """Return one axes as it is, several as an array (n,)."""
    if len(axes) == 1:
        return axes[0]
    found = np.empty(len(axes), object)
    found[:] = axes
    return found


def drawn(chart: Chart, given: Any) -> Any:
    """Draw the panels of a chart, each name in the legend of the first that has it."""
    found, told = panels(given, len(chart.panels)), set[str]()
    for place, ax in enumerate(found):
        figures.draw(chart, ax, panel=place)
        known = dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
        if new := {label: line for label, line in known.items() if label not in told}:
            ax.legend(new.values(), new.keys(), frameon=False, fontsize=8)
            told |= new.keys()
    for ax in found[:-1]:
        ax.set_xlabel("")
    return returned(found)


def over_time(curves: Mapping[str, Sequence[Line]], given: Any, scenario: Scenario | None) -> Any:
    """Draw lines over time, a panel each, on axes that may have some already.

    Parameters
    ----------
    curves : mapping of str to sequence of Line
        By the label of their panel, the last of each the one that its panel is for; where there is
        something on its axes the truth is not drawn again.
    given : axes or several, optional
        Where to draw.
    scenario : Scenario, optional
        For faults, pauses and burn-in.
    """
    axes, shown = panels(given, len(curves)), []
    fresh = not any(ax.lines for ax in axes)
    for ax, (label, lines) in zip(axes, curves.items(), strict=True):
        panel = Panel(y=label, lines=[n for n in lines if fresh or n.role != "truth"])
        shown.append(replace(panel, y_range=_limits(lines, None if fresh else ax.get_ylim())))
    around: dict[str, Any] = over_time_of(scenario) if scenario and fresh else {}
    if scenario:
        around["windows"] = [("", 0.0, scenario.duration)]
    found = drawn(Chart(title="", words="", x="time [s]", panels=shown, **around), axes)
    for ax, panel in zip(axes, shown, strict=True):
        _mark_beyond(ax, panel.lines[-1])
    return found


def changes(lines: Sequence[dict[str, Any]], ax: Any, names: tuple[str, str]) -> Axes:
    """Draw changes with their intervals, a line a score, as candidate over base.

    Parameters
    ----------
    lines : sequence of dict
        ``name, where, word, change, interval, margin``; all changes as shares.
    ax : axes, optional
    names : (str, str)
        Base and candidate.
    """
    if ax is None:
        from matplotlib import pyplot

        size = (8.0, 1.3 + 0.42 * max(1, len(lines)))
        _, ax = pyplot.subplots(figsize=size, layout="constrained")
    for place, line in enumerate(lines):
        low, high = 1 + line["interval"]
        ax.plot([low, high], [place, place], color=_WORDS.get(line["word"], "0.45"), lw=2)
        ax.plot(1 + line["change"], place, "o", color=_WORDS.get(line["word"], "0.45"))
        ax.plot([1 - line["margin"], 1 + line["margin"]], [place, place], "k", lw=7, alpha=0.12)
    ax.axvline(1.0, color="k", lw=0.8)
    ax.set_xscale("log")
    ax.set_yticks(range(len(lines)), [f"{x['name']}, {x['where']}: {x['word']}" for x in lines])
    ax.set_ylim(len(lines) - 0.4, -0.6)
    ax.set_xlabel(f"{names[1]} over {names[0]}: less is better")
    _plain(ax.xaxis)
    ax.grid(axis="x", alpha=0.25)
    return ax


_WORDS = {"worse": "#d55e00", "better": "#009e73", "undecided": "#e69f00"}


def _plain(axis: Any) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _limits(lines: Sequence[Line], before: tuple[float, float] | None) -> tuple[float, float]:
    """Cover what a page would, and peaks up to FAR beyond; a lost run sets no scale."""
    usual = upward(Panel(y="", lines=lines), Scale(-np.inf, np.inf))
    far, values = FAR * (usual.high - usual.low), np.asarray(lines[-1].y)
    inside = values[(values >= usual.low - far) & (values <= usual.high + far)]
    ends = np.r_[usual.low, usual.high, inside, before or ()]
    return float(ends.min()), float(ends.max())


def _mark_beyond(ax: Axes, line: Line) -> None:
    """Mark at the edge, with its value, the largest peak that a panel does not show."""
    there, limits = np.where(np.isfinite(line.y), line.y, np.nan), ax.get_ylim()
    colour = figures.colour(line.who)
    if not np.isfinite(there).any():
        return
    for k, edge, marker in ((np.nanargmin(there), 0, "v"), (np.nanargmax(there), 1, "^")):
        if limits[0] <= there[k] <= limits[1]:
            continue
        across = ax.get_xaxis_transform()  # time, and share of the height
        ax.plot(line.x[k], edge, marker, color=colour, ms=5, transform=across, clip_on=False,
                label="_beyond")  # fmt: skip
        ax.annotate(
            f"{there[k]:.3g}", (line.x[k], edge), xycoords=across, color=colour, fontsize=7,
            xytext=(5, 5 - 12 * edge), textcoords="offset points",
        )  # fmt: skip


def unit_of(name: str) -> str:
    """Return the unit of an estimated parameter."""
    if not name.startswith("1/"):
        return UNITS.get(name, "1")
    return f"1/({UNITS.get(name[2:], '1')})"
