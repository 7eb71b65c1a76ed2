"""The chart of the last change: how much of it each estimator still has to find, and theory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.charts import COLOURS, NOWHERE, axes, theory_band, theory_series
from flexaxis.experiments.demo.history import Entry
from flexaxis.experiments.demo.pursuit import LENGTH
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]

POINTS = np.unique(np.geomspace(1, LENGTH, 160).astype(int)) - 1
"""Samples after the change that are drawn: evenly on a logarithmic axis."""

TOP = 120.0
"""Per cent of the change that the chart shows; what is more is on its upper edge."""
ALIEN_TOP = 38.0
"""The same after a change of what nobody estimates, in per cent of what it is taken for."""
WAITING = "break it: what is left to be found [%] over time [s]"


class Chase:
    """The chart of the last change.

    Parameters
    ----------
    gui : viser.GuiApi
        Where it is put.
    """

    def __init__(self, gui: Any) -> None:
        from viser import uplot

        lines = [uplot.Series(label="AB"[i], stroke=COLOURS[i], width=3) for i in (0, 1)]
        self._chart = gui.add_uplot(
            data=_nothing(),
            series=(uplot.Series(label="s"), *theory_series(), *lines),
            bands=(theory_band(),),
            scales=_scales(TOP),
            axes=axes(),
            title=WAITING,
            legend=uplot.Legend(show=False),
            height=205,
        )
        self._shown: Entry | None = None
        self._samples = -1

    def update(self, entry: Entry | None) -> None:
        """Draw the last change of the truth."""
        if entry is None or entry.pursuit is None:
            return
        if entry is not self._shown:
            self._shown = entry
            self._chart.title = title(entry)
            self._chart.scales = _scales(TOP if entry.pursuit.changed else ALIEN_TOP)
            self._samples = -1
        if self._samples != len(entry.pursuit.error):
            self._samples = len(entry.pursuit.error)
            self._chart.data = chase_lines(entry)


def title(entry: Entry) -> str:
    """Return what the chart shows."""
    assert entry.pursuit is not None
    if entry.pursuit.changed is None:
        return f"{_short(entry.what)}: what it is taken for [%] over time [s]"
    return f"{_short(entry.what)}: left to be found [%] over time [s]"


def _short(what: str) -> str:
    return what.partition(" (")[0]


def chase_lines(entry: Entry) -> tuple[Array, ...]:
    """Return time since the change [s], what theory allows (two), errors of A and B [%]."""
    pursuit = entry.pursuit
    if pursuit is None or len(pursuit.error) < 2:
        return _nothing()
    rows = POINTS[: np.searchsorted(POINTS, len(pursuit.error))]
    errors = 100 * np.minimum(pursuit.error[rows], TOP / 100)
    bounds = np.full((len(rows), 2), NOWHERE)
    if (allowed := pursuit.allowed) is not None:
        bounds = 100 * allowed.error[rows]
    return (pursuit.time[rows], *bounds.T, *errors.T)


def _nothing() -> tuple[Array, ...]:
    return (np.array([PERIOD, WINDOW]), *np.full((4, 2), NOWHERE))


def _scales(top: float) -> dict[str, Any]:
    from viser import uplot

    return {
        "x": uplot.Scale(time=False, distr=3, log=10, auto=False, range=(PERIOD, WINDOW)),
        "y": uplot.Scale(auto=False, range=(0.0, top)),
    }
