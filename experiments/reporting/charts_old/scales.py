"""From values to places along an axis, and where its ticks stand."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel

Array = NDArray[np.float64]
Tick = tuple[float, str]

LETTERS = 20  # pixels that a number at the side takes
MOST = 7  # ticks that have room on a phone
NARROW = 0.7  # decades of a logarithmic scale below which round values are better than 1, 2, 5
FAR = 2.0  # ranges of what is certain by which an estimate may leave it and still be shown


@dataclass(frozen=True)
class Scale:
    """A range of values along an axis.

    Attributes
    ----------
    low, high : float
    log : bool
    origin : str
        Where values count days: the date that is 0, as ISO 8601 has it.
    """

    low: float
    high: float
    log: bool = False
    origin: str = ""

    def share(self, values: ArrayLike) -> Array:
        """Return how far along the axis values lie: 0 at its begin, 1 at its end."""
        given = np.asarray(values, float)
        if not self.log:
            return np.asarray((given - self.low) / ((self.high - self.low) or 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(given / self.low) / (np.log(self.high / self.low) or 1.0))

    def marks(self, high: float = np.inf) -> list[Tick]:
        """Return where along the axis its ticks stand, and their words: as many as have room.

        Parameters
        ----------
        high : float
            Pixels of the axis, up.
        """
        few = self.ticks[:: max(1, math.ceil(len(self.ticks) * LETTERS / high))]
        return [(float(self.share(value)), text) for value, text in few]

    @cached_property
    def ticks(self) -> list[Tick]:
        """Round values of the range, and what is written there."""
        if self.origin:
            return _dates(self)
        if self.log and np.log10(self.high / self.low) >= NARROW:
            return list(_decades(self.low, self.high))
        from matplotlib.ticker import MaxNLocator

        found = np.asarray(MaxNLocator(MOST, steps=[1, 2, 5, 10]).tick_values(self.low, self.high))
        places = max(0, -int(np.floor(np.log10(found[1] - found[0]) + 1e-9)))
        there = found[(found >= self.low) & (found <= self.high)]
        return [(float(v), f"{v + 0.0:.{places}f}".replace("-", "−")) for v in there]


def _decades(low: float, high: float) -> Iterator[Tick]:
    """Yield powers of ten, and where there is room 2 and 5 times each."""
    digits = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    for power in range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1):
        for digit in digits:
            value = float(f"{digit}e{power}")
            if low * 0.999 <= value <= high * 1.001:
                text = f"{value:.4g}" if value >= 1e-3 else f"{value:.0e}"
                yield value, text.replace("e-0", "e−").replace("e+0", "e")


def _dates(scale: Scale) -> list[Tick]:
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num, num2date

    zero = date2num(datetime.fromisoformat(scale.origin))
    locator = AutoDateLocator(minticks=2, maxticks=5)
    numbers = locator.tick_values(num2date(zero + scale.low), num2date(zero + scale.high))
    there = [n for n in numbers if scale.low <= n - zero <= scale.high]
    if not there:
        return []
    formatter = ConciseDateFormatter(locator, show_offset=False)
    words = formatter.format_ticks(there)
    first = f"{num2date(there[0]):%-d %b %Y}" if "%H" not in str(words[0]) else words[0]
    return [(float(n - zero), w) for n, w in zip(there, [first, *words[1:]], strict=True)]


def across(chart: Chart) -> list[tuple[str, Scale]]:
    """Return what a chart shows of x: its first window and its last, else all; with their names."""
    ends = [*chart.windows[:1], *chart.windows[1:][-1:]] or [("", *_ends(chart))]
    return [(name, Scale(low, high, chart.x_log, chart.x_from)) for name, low, high in ends]


def _ends(chart: Chart) -> tuple[float, float]:
    """Return the range of x of all lines, with a margin where there are points."""
    lines = [line for panel in chart.panels for line in panel.lines]
    low, high = _range([s for n in lines for s in (n.x, n.x_low, n.x_high)], log=chart.x_log)
    if chart.x_log:
        margin = (high / low or 2.0) ** 0.05 if high > low else 2**0.05
        return low / margin, high * margin
    pointed = low == high or any(line.kind in {"points", "both"} for line in lines)
    margin = (0.04 * (high - low) or 0.5) if pointed else 0.0
    return low - margin, high + margin


def _range(sides: Sequence[Any], *, log: bool) -> tuple[float, float]:
    """Return the least and the greatest of all that can be drawn."""
    values = np.concatenate([np.asarray(s, float) for s in sides if s is not None] or [np.empty(0)])
    there = values[np.isfinite(values) & ((values > 0) | (not log))]
    return (float(there.min()), float(there.max())) if there.size else (0.1 if log else 0.0, 1.0)


def upward(panel: Panel, x: Scale) -> Scale:
    """Return the range of y of a panel: truth and points whole, curves not all of a burst.

    But of a panel that is to be seen whole.
    """
    if panel.y_range is not None:
        return Scale(*panel.y_range, panel.y_log)
    certain: list[Any] = []
    drawn: list[Any] = []
    for line in panel.lines:
        pointed = panel.whole or line.kind in {"points", "both"}
        there = _within(line, x)
        sides = (line.y, line.low, line.high) if pointed else (line.y,)
        into = certain if pointed or line.role == "truth" else drawn
        into += [np.asarray(side)[there] for side in sides if side is not None]
    usual = [_middle(np.concatenate(drawn))] if drawn else []
    if panel.y_log:
        low, high = _range([*certain, *usual], log=True)
        margin = max((high / low) ** 0.06, 1.05)
        return Scale(low / margin, high * margin, log=True)
    return Scale(*_room(certain, usual))


def _room(certain: Sequence[Any], usual: Sequence[Any]) -> tuple[float, float]:
    low, high = _range(usual or certain, log=False)
    if certain and usual:
        a, b = _range(certain, log=False)
        span = max(b - a, 0.04 * max(abs(a), abs(b)), 1e-12)
        low, high = max(min(a, low), a - FAR * span), min(max(b, high), b + FAR * span)
    margin = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def _within(line: Line, x: Scale) -> NDArray[np.bool_]:
    """Return which points lie in a range; of steps the one before holds in it too."""
    there = (line.x >= x.low) & (line.x <= x.high)
    if line.kind == "steps" and (before := np.flatnonzero(line.x < x.low)).size:
        there[before[-1]] = True
    return np.asarray(there)


def _middle(values: Array) -> Array:
    """Return the ends of 99 % of the values, so that a burst does not set the scale."""
    known = values[np.isfinite(values)]
    return np.quantile(known, [0.005, 0.995]) if known.size else known
