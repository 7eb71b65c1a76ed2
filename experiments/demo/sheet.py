"""The page of a recording: picture, caption, curves with bands, the last fault, the trade-off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter
from numpy.typing import NDArray

from flexaxis.experiments.demo.charts import COLOURS, THEORY, unit
from flexaxis.experiments.demo.chase import ALIEN_TOP, TOP, chase_lines
from flexaxis.experiments.demo.dots import Dot
from flexaxis.experiments.demo.history import Entry
from flexaxis.experiments.demo.lesson import Lesson
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.demo.session import SPAN, Curves, DemoSession
from flexaxis.experiments.reporting.figures import symbol
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.timing import PERIOD

Pixels = NDArray[np.uint8]

SIZE = (8.0, 4.8)  # inches at 100 dots each
PICTURE = (480, 224)  # of the axis
MARKERS = dict(zip(NAMES, "s^o", strict=True))
SMALL, TINY = 7, 6  # points
LABEL: dict[str, Any] = {"size": SMALL, "labelpad": 1}  # of a label of an axis


class Sheet:
    """A page of a recording.

    Parameters
    ----------
    lesson : Lesson
        For title and duration.
    exaggerate : float
        To be said under the picture.

    Attributes
    ----------
    caption : str
        What is said now.
    """

    def __init__(self, lesson: Lesson, exaggerate: float) -> None:
        self.caption = ""
        figure = Figure(figsize=SIZE, dpi=100)
        self._canvas = FigureCanvasAgg(figure)
        figure.text(0.015, 0.955, lesson.title, weight="bold", size=11)
        self._caption = figure.text(0.015, 0.91, "", size=9)
        self._names = [
            figure.text(0.015 + 0.2 * i, 0.865, "", color=colour, size=9)
            for i, colour in enumerate(COLOURS)
        ]
        figure.text(0.44, 0.865, "theory allows", color=THEORY, size=9)
        figure.text(0.015, 0.49, f"MuJoCo; twist × {exaggerate:g} for the eye", size=7, color="0.4")
        image = figure.add_axes((0.01, 0.485, 0.5, 0.37))
        image.set_axis_off()
        self._image = image.imshow(np.full((PICTURE[1], PICTURE[0], 3), 255, np.uint8))
        rows = [(0.63, 0.08 + 0.21 * (3 - i), 0.355, 0.17) for i in range(4)]
        self._axes = [figure.add_axes(row) for row in rows]
        self._chase = figure.add_axes((0.065, 0.1, 0.2, 0.32))
        self._trade = figure.add_axes((0.335, 0.1, 0.2, 0.32))
        self._begin, self._duration = lesson.start, lesson.duration

    def draw(self, picture: Pixels, session: DemoSession) -> Pixels:
        """Return the page (height, width, 3) as it is now."""
        curves = session.curves()
        self._image.set_data(picture)
        self._caption.set_text(self.caption)
        for text, letter, racer in zip(self._names, "AB", session.racers, strict=True):
            text.set_text(f"{letter}: {racer.text}")
        for i in range(len(NAMES)):
            self._draw_estimate(i, i, curves)
        rubbing = bool(curves.truth[:, len(NAMES) :].any())
        # Dry friction, where there is some, takes the place of diag P.
        (self._draw_friction if rubbing else self._draw_P)(curves)
        self._draw_chase(session.history.last)
        self._draw_dots(session.dots, session.history.last)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _fresh(self, row: int, label: str, now: float) -> Any:
        ax = self._axes[row]
        ax.clear()
        span = min(SPAN, self._duration)
        left = min(max(self._begin, now - span), self._begin + self._duration - span)
        ax.set_xlim(left, left + span)
        ax.set_ylabel(label, **LABEL)
        ax.tick_params(labelsize=TINY, pad=1, labelbottom=row == len(self._axes) - 1)
        ax.grid(alpha=0.25)
        return ax

    def _draw_estimate(self, row: int, i: int, curves: Curves) -> None:
        ax = self._fresh(row, f"{symbol(SHOWN[i])}\n[{unit(SHOWN[i])}]", _now(curves))
        for racer, colour in enumerate(COLOURS):
            theta, band = curves.theta[:, racer, i], 2 * curves.deviation[:, racer, i]
            ax.fill_between(curves.time, theta - band, theta + band, color=colour, alpha=0.2, lw=0)
            ax.plot(curves.time, theta, color=colour, lw=1.2)
        ax.plot(curves.time, curves.truth[:, i], "k--", lw=0.9)
        ax.set_ylim(*limits(curves.truth[:, i], curves.theta[:, :, i]))

    def _draw_friction(self, curves: Curves) -> None:
        self._draw_estimate(3, len(NAMES), curves)
        self._axes[3].set_xlabel("time [s]", **LABEL)

    def _draw_P(self, curves: Curves) -> None:
        ax = self._fresh(3, "diag P", _now(curves))
        for racer, colour in enumerate(COLOURS):
            for i, style in enumerate(("-", "--", ":")):
                ax.plot(curves.time, curves.P[:, racer, i], style, color=colour, lw=1)
        ax.set_yscale("log")
        ax.set_ylim(1e-6, 1e-2)
        ax.set_xlabel("time [s]", **LABEL)

    def _draw_chase(self, entry: Entry | None) -> None:
        ax = self._chase
        ax.clear()
        known = entry is None or entry.pursuit is None or entry.pursuit.changed
        ax.set(xscale="log", xlim=(PERIOD, WINDOW), ylim=(0, TOP if known else ALIEN_TOP))
        if entry is not None:
            time, single, unknown, *errors = chase_lines(entry)
            ax.fill_between(time, single, unknown, color=THEORY, alpha=0.35, lw=0.8)
            for colour, error in zip(COLOURS, errors, strict=True):
                ax.plot(time, error, color=colour, lw=1.6)
        what = "left of the fault [%]" if known else "what it is taken for [%]"
        _label(ax, "time since the fault [s]", what)
        _ticks(ax.xaxis, (0.01, 0.1, 1))

    def _draw_dots(self, dots: Sequence[Dot], entry: Entry | None) -> None:
        ax = self._trade
        ax.clear()
        single, unknown = entry.allowed if entry else (None, None)
        if single is not None and unknown is not None:
            ax.axhspan(single, unknown, color=THEORY, alpha=0.35, lw=0.8)
        for dot in dots:
            ax.plot(
                dot.std, dot.lag, MARKERS[dot.parameter], color=COLOURS[dot.racer], ms=7, mec="w"
            )
        for name, marker in MARKERS.items():
            ax.plot([], [], marker, color="0.4", ms=5, label=symbol(name))
        ax.set(xscale="log", yscale="log", xlim=(0.02, 5), ylim=(0.02, 8))
        _label(ax, "std before the fault [%]", "lag after it [s]")
        _ticks(ax.xaxis, (0.1, 1))
        _ticks(ax.yaxis, (0.03, 0.1, 0.3, 1, 3))
        ax.legend(
            loc="upper right", fontsize=TINY, ncols=3, title="a dot a fault", title_fontsize=TINY,
            handletextpad=0, columnspacing=0.6, borderpad=0.3,
        )  # fmt: skip


def limits(truth: NDArray[np.float64], theta: NDArray[np.float64]) -> tuple[float, float]:
    """Return what a diagram shows of an estimate: the truth, a bias, but not all of a burst."""
    if not len(truth):
        return 0.0, 1.0
    known = theta[np.isfinite(theta)]
    low, high = np.quantile(known, [0.05, 0.95]) if len(known) else (truth[0], truth[0])
    bottom, top = 0.9 * truth.min(), 1.16 * truth.max()
    # Where there is none before, as of dry friction, zero is to be seen as well.
    bottom -= 0.1 * truth.max() * (truth.min() == 0)
    return float(np.clip(0.98 * low, bottom / 2, bottom)), float(np.clip(1.02 * high, top, 2 * top))


def _now(curves: Curves) -> float:
    return float(curves.time[-1]) if len(curves.time) else 0.0


def _label(ax: Any, x: str, y: str) -> None:
    ax.set_xlabel(x, **LABEL)
    ax.set_ylabel(y, **LABEL)
    ax.tick_params(labelsize=TINY, pad=1)
    ax.grid(alpha=0.25, which="both")


def _ticks(axis: Any, ticks: tuple[float, ...]) -> None:
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
