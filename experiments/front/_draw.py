"""Where `.plot()` draws: matplotlib axes in, axes out, in the style of all figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.experiments.reporting import figures, styles
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexaxis.sim.scenario import Scenario

UNITS = {**LAW_UNITS, **PARAMETER_UNITS}


@styles.styled
def panels(axes: Any, count: int) -> list[Axes]:
    """Return axes to draw on, one below the other: those of the caller, or new ones.

    Raises
    ------
    FlexaxisError
        If the caller has others than `count`.
    """
    if axes is None:
        from matplotlib import pyplot

        size = (8.0, max(4.0, 1.0 + 1.6 * count))
        _, grid = pyplot.subplots(count, 1, sharex=True, squeeze=False, figsize=size)
        return list(grid[:, 0])
    found = list(np.ravel(np.asarray(axes, object)))
    if len(found) != count:
        raise FlexaxisError(
            f"{len(found)} axes for {count} panels: give as many (plt.subplots({count})), "
            "name fewer panels, or give none"
        )
    return found


def returned(axes: Sequence[Axes]) -> Any:
    """Return one axes as it is, several as an array (n,)."""
    if len(axes) == 1:
        return axes[0]
    found = np.empty(len(axes), object)
    found[:] = axes
    return found


def over_time(
    series: Mapping[str, Sequence[figures.Series]], axes: Any, scenario: Scenario | None
) -> Any:
    """Draw curves over time, a panel each, on axes that may have some already.

    Parameters
    ----------
    series : mapping of str to sequence of Series
        By the label of their panel. Where the axes have curves, the truth is not drawn again.
    axes : axes or several, optional
        Where to draw.
    scenario : Scenario, optional
        For faults and burn-in.
    """
    found = panels(axes, len(series))
    fresh = not any(ax.lines for ax in found)
    shown = {
        label: [s for s in each if fresh or s.role != "truth"] for label, each in series.items()
    }
    marked = figures.around(scenario) if scenario and fresh else {}
    figures.curves(shown, x="time [s]", axes=found, **marked)
    return returned(found)


def unit_of(name: str) -> str:
    """Return the unit of an estimated parameter."""
    if not name.startswith("1/"):
        return UNITS.get(name, "1")
    return f"1/({UNITS.get(name[2:], '1')})"
