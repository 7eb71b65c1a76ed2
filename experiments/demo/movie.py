"""A lesson drawn into a GIF, without a display: for lectures and the README."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.experiments.demo import curves
from flexaxis.experiments.demo.lesson import Lesson, Player
from flexaxis.experiments.demo.session import SPAN, DemoSession
from flexaxis.experiments.demo.view import camera, exaggerated
from flexaxis.experiments.files import OutputError, new_file
from flexaxis.experiments.reporting.charts_old.charts import Chart
from flexaxis.experiments.reporting.charts_old.figures import draw
from flexaxis.sim.timing import PERIOD

Pixels = NDArray[np.uint8]


def record(
    lesson: Lesson,
    path: Path,
    *,
    estimators: Sequence[str] | None = None,
    seed: int | None = None,
    exaggerate: float = 100.0,
    advance: Callable[[float], None] = lambda _: None,
) -> None:
    """Play a lesson and write it as GIF.

    Parameters
    ----------
    lesson : Lesson
    path : Path
        Ends in .gif.
    estimators : sequence of str, optional
        Two in place of those of the lesson.
    seed : int, optional
        In place of that of the lesson.
    exaggerate : float
        Factor on the twist of the joints in the picture.
    advance : callable
        Called with the fraction done since its last call.

    Raises
    ------
    OutputError
        If such a file cannot be written, or nothing be drawn here.
    """
    _check(path)
    session = DemoSession(
        estimators=estimators or lesson.estimators, seed=lesson.seed if seed is None else seed
    )
    pictures = frames(session, lesson, exaggerate=exaggerate, advance=advance)
    with new_file(path) as part:
        _save(part, pictures, lesson.frames)


def frames(
    session: DemoSession,
    lesson: Lesson,
    *,
    exaggerate: float = 100.0,
    advance: Callable[[float], None] = lambda _: None,
) -> Iterator[Pixels]:
    """Play a lesson and yield its pictures (height, width, 3)."""
    number = round(lesson.duration / lesson.speed * lesson.frames)
    player = Player(session, lesson)
    begin = session.axis.samples
    frame_ = Frame(lesson, exaggerate)
    ratio = session.axis.nominal.r
    with camera(width=PICTURE[0], height=PICTURE[1]) as shoot:
        for frame in range(number):
            until = begin + round((frame + 1) * lesson.speed / lesson.frames / PERIOD)
            player.advance(until - session.axis.samples)
            frame_.caption = player.caption
            angles = exaggerated(session.axis.angles, ratio=ratio, exaggerate=exaggerate)
            yield frame_.draw(shoot(angles), session)
            advance(1 / number)


def _check(path: Path) -> None:
    if path.suffix != ".gif":
        raise OutputError(f"{path}: a recording is a .gif file (ffmpeg -i IT.gif IT.mp4 turns one)")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it, or choose another")


def _save(path: Path, pictures: Iterator[Pixels], rate: int) -> None:
    from PIL import Image

    images = [Image.fromarray(pixels) for pixels in pictures]
    # One palette for all, or the colours would flicker; the last picture has all of them.
    palette = images[-1].quantize(160)
    first, *rest = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    first.save(
        path, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0, optimize=True
    )


SIZE = (8.0, 4.8)  # inches at 100 dots each
PICTURE = (480, 224)  # of the axis
SMALL, TINY = 7, 6  # points


class Frame:
    """The picture of a recording, drawn again and again.

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
        self.caption, self._begin, self._duration = "", lesson.start, lesson.duration
        figure = Figure(figsize=SIZE, dpi=100)
        self._canvas = FigureCanvasAgg(figure)
        figure.text(0.015, 0.955, lesson.title, weight="bold", size=11)
        self._caption = figure.text(0.015, 0.91, "", size=9)
        self._names = [
            figure.text(0.015 + 0.2 * i, 0.865, "", color=colour, size=9)
            for i, colour in enumerate(curves.COLOURS)
        ]
        figure.text(0.44, 0.865, curves.THEORY, color="0.45", size=9)
        figure.text(0.015, 0.49, f"MuJoCo; twist × {exaggerate:g} for the eye", size=7, color="0.4")
        image = figure.add_axes((0.01, 0.485, 0.5, 0.37))
        image.set_axis_off()
        self._image = image.imshow(np.full((PICTURE[1], PICTURE[0], 3), 255, np.uint8))
        rows = [(0.63, 0.08 + 0.21 * (3 - i), 0.355, 0.17) for i in range(4)]
        self._axes = [figure.add_axes(row) for row in rows]
        self._left = figure.add_axes((0.065, 0.1, 0.2, 0.32))
        self._points = figure.add_axes((0.335, 0.1, 0.2, 0.32))

    def draw(self, picture: Pixels, session: DemoSession) -> Pixels:
        """Return the picture (height, width, 3) as it is now."""
        self._image.set_data(picture)
        self._caption.set_text(self.caption)
        for text, letter, racer in zip(self._names, curves.RACERS, session.racers, strict=True):
            text.set_text(f"{letter}: {racer.text}")
        last, lines = session.history.last, session.curves()
        now, span = session.axis.time, min(SPAN, self._duration)
        begin = min(max(self._begin, now - span), self._begin + self._duration - span)
        chart = curves.estimates(lines, begin)
        for place, ax in enumerate(self._axes):
            _draw(chart, ax, place).set_xlim(begin, begin + span)
            ax.set_xlabel("")
        self._axes[-1].set_xlabel(chart.x, size=SMALL, labelpad=1)
        _draw(curves.left(last), self._left)
        _draw(curves.tradeoff(session.points, last.allowed if last else (None, None)), self._points)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()


def _draw(chart: Chart, ax: Any, panel: int = 0) -> Any:
    """Draw a panel anew, in small letters."""
    ax.clear()
    draw(chart, ax, panel=panel, looks=curves.STYLES)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set_size(SMALL)
        axis.labelpad = 1
    ax.tick_params(labelsize=TINY, pad=1)
    ax.set_title(ax.get_title(loc="left"), loc="left", size=TINY, pad=2)
    return ax
