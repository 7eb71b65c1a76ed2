"""Figures of the front door: matplotlib axes in, axes out, in the style of the reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.experiments.reporting.figures import mark, typeset
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.law_parameters import LAW_UNITS
from flexaxis.sim.parameters import PARAMETER_UNITS

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

        size = (8.0, 1.0 + 1.6 * count)
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


def signals(time: Any, values: dict[str, tuple[Any, str]], axes: Any, scenario: Any) -> Any:
    """Draw signals over time, a panel each; `values` gives the samples and the unit of each."""
    found = panels(axes, len(values))
    for ax, (name, (samples, unit)) in zip(found, values.items(), strict=True):
        ax.plot(time, samples, lw=0.8)
        ax.set_ylabel(f"{name.replace('_', ' ')} [{unit}]")
        _finish(ax, scenario)
    found[-1].set_xlabel("time [s]")
    return returned(found)


def estimates(
    time: Any,
    curves: dict[str, tuple[Any, Any, Any]],
    axes: Any,
    *,
    label: str,
    colour: str,
    scenario: Scenario | None,
) -> Any:
    """Draw estimates over time, a panel a parameter, the truth dashed black.

    Parameters
    ----------
    time : ndarray (N,)
    curves : dict of str to (ndarray, ndarray or None, ndarray or None)
        Estimate, standard deviation and truth (N,) of each parameter.
    axes : axes or several, optional
        Where to draw; on axes that have the truth already it is not drawn again.
    label, colour : str
    scenario : Scenario, optional
        For faults, pauses and burn-in.
    """
    found = panels(axes, len(curves))
    for ax, (name, (theta, deviation, truth)) in zip(found, curves.items(), strict=True):
        fresh = not ax.lines
        ax.plot(time, theta, color=colour, lw=1.3, label=label)
        if deviation is not None:
            ax.fill_between(
                time, theta - 2 * deviation, theta + 2 * deviation, color=colour, alpha=0.18, lw=0
            )
        if fresh and truth is not None:
            ax.plot(time, truth, "k--", lw=1.0, label="truth")
        ax.set_ylabel(f"{typeset(name)} [{_unit(name)}]")
        limits = _limits(ax, theta, truth, fresh=fresh)
        ax.set_ylim(*limits)
        _mark_beyond(ax, time, theta, limits, colour)
        if fresh:
            _finish(ax, scenario)
    found[0].legend(loc="best", frameon=False, fontsize=8)
    found[-1].set_xlabel("time [s]")
    return returned(found)


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


def _finish(ax: Axes, scenario: Scenario | None) -> None:
    if scenario is not None:
        mark(ax, scenario)
        ax.set_xlim(0, scenario.duration)
    ax.grid(alpha=0.25)


def _limits(ax: Axes, theta: Any, truth: Any, *, fresh: bool) -> tuple[float, float]:
    """Cover the truth and the estimate, but for peaks beyond FAR; a lost run sets no scale."""
    there = theta[np.isfinite(theta)]
    near = np.percentile(there, (0.5, 99.5)) if there.size else np.zeros(2)
    low, high = near
    if truth is not None:
        least, most = float(np.min(truth)), float(np.max(truth))
        room = 2 * max(most - least, 0.04 * abs(most))
        low, high = max(min(low, least), least - room), min(max(high, most), most + room)
    far = FAR * (high - low)
    inside = there[(there >= low - far) & (there <= high + far)]
    if inside.size:
        low, high = min(low, float(inside.min())), max(high, float(inside.max()))
    margin = 0.08 * (high - low) or 0.01 * abs(high) or 1.0
    low, high = low - margin, high + margin
    if not fresh:
        before = ax.get_ylim()
        low, high = min(low, before[0]), max(high, before[1])
    return float(low), float(high)


def _mark_beyond(ax: Axes, time: Any, theta: Any, limits: tuple[float, float], colour: str) -> None:
    """Mark at the edge, with its value, the largest peak that a panel does not show."""
    there = np.where(np.isfinite(theta), theta, np.nan)
    if not np.isfinite(there).any():
        return
    for k, edge, marker in ((np.nanargmin(there), 0, "v"), (np.nanargmax(there), 1, "^")):
        if limits[0] <= there[k] <= limits[1]:
            continue
        across = ax.get_xaxis_transform()  # time, and share of the height
        ax.plot(time[k], edge, marker, color=colour, ms=5, transform=across, clip_on=False,
                label="_beyond")  # fmt: skip
        ax.annotate(
            f"{there[k]:.3g}", (time[k], edge), xycoords=across, color=colour, fontsize=7,
            xytext=(5, 5 - 12 * edge), textcoords="offset points",
        )  # fmt: skip


def _unit(name: str) -> str:
    if not name.startswith("1/"):
        return UNITS.get(name, "1")
    return f"1/({UNITS.get(name[2:], '1')})"
