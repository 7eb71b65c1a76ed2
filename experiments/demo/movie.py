"""A lesson drawn into a file, GIF or MP4, without a display: for lectures and the README."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter
from numpy.typing import NDArray

from flexaxis.experiments.demo.charts import COLOURS, unit
from flexaxis.experiments.demo.dots import Dot
from flexaxis.experiments.demo.lesson import Lesson
from flexaxis.experiments.demo.racer import NAMES
from flexaxis.experiments.demo.session import SPAN, Curves, DemoSession
from flexaxis.experiments.reporting.figures import symbol
from flexaxis.experiments.reporting.view import camera, exaggerated
from flexaxis.experiments.running.files import OutputError, new_file
from flexaxis.sim.timing import PERIOD, sample_index

Pixels = NDArray[np.uint8]

SIZE = (7.2, 4.4)  # inches at 100 dots each
PICTURE = (480, 224)  # of the axis
KINDS = (".gif", ".mp4")
MARKERS = dict(zip(NAMES, "s^o", strict=True))


def record(
    lesson: Lesson,
    path: Path,
    *,
    estimators: Sequence[str] | None = None,
    seed: int = 0,
    exaggerate: float = 100.0,
    advance: Callable[[float], None] = lambda _: None,
) -> None:
    """Play a lesson and write it as GIF or MP4.

    Parameters
    ----------
    lesson : Lesson
    path : Path
        Ends in .gif, or in .mp4 where ffmpeg is installed.
    estimators : sequence of str, optional
        Two in place of those of the lesson.
    seed : int
        Of excitation and noise.
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
    session = DemoSession(estimators=estimators or lesson.estimators, seed=seed)
    pictures = frames(session, lesson, exaggerate=exaggerate, advance=advance)
    with new_file(path) as part:
        (_save_gif if path.suffix == ".gif" else _save_mp4)(part, pictures, lesson.frames)


def frames(
    session: DemoSession,
    lesson: Lesson,
    *,
    exaggerate: float = 100.0,
    advance: Callable[[float], None] = lambda _: None,
) -> Iterator[Pixels]:
    """Play a lesson and yield its pictures (height, width, 3)."""
    number = round(lesson.duration / lesson.speed * lesson.frames)
    acts = sorted(lesson.act, key=lambda act: act.at)
    sheet = Sheet(lesson, [racer.text for racer in session.racers], exaggerate)
    ratio = session.axis.nominal.r
    with camera(width=PICTURE[0], height=PICTURE[1]) as shoot:
        for frame in range(number):
            until = round((frame + 1) * lesson.speed / lesson.frames / PERIOD)
            while acts and sample_index(acts[0].at, PERIOD) < until:
                session.advance(max(0, sample_index(acts[0].at, PERIOD) - session.axis.samples))
                acts[0].do(session)
                sheet.caption = acts.pop(0).say or sheet.caption
            session.advance(until - session.axis.samples)
            angles = exaggerated(session.axis.angles, ratio=ratio, exaggerate=exaggerate)
            yield sheet.draw(shoot(angles), session.curves(), session.dots)
            advance(1 / number)


class Sheet:
    """The page of a recording: picture, caption, curves with bands, diag P, trade-off.

    Parameters
    ----------
    lesson : Lesson
        For title and duration.
    racers : sequence of str
        Names of the two.
    exaggerate : float
        To be said under the picture.

    Attributes
    ----------
    caption : str
        What is said now.
    """

    def __init__(self, lesson: Lesson, racers: Sequence[str], exaggerate: float) -> None:
        self.caption = ""
        self._lesson = lesson
        figure = Figure(figsize=SIZE, dpi=100)
        self._canvas = FigureCanvasAgg(figure)
        figure.text(0.02, 0.955, lesson.title, weight="bold", size=11)
        self._caption = figure.text(0.02, 0.905, "", size=9)
        for i, (name, colour) in enumerate(zip(racers, COLOURS, strict=True)):
            figure.text(0.02 + 0.26 * i, 0.855, f"{'AB'[i]}: {name}", color=colour, size=9)
        figure.text(0.02, 0.475, f"MuJoCo; twist × {exaggerate:g} for the eye", size=7, color="0.4")
        image = figure.add_axes((0.01, 0.465, 0.5, 0.38))
        image.set_axis_off()
        self._image = image.imshow(np.full((PICTURE[1], PICTURE[0], 3), 255, np.uint8))
        rows = [(0.61, 0.08 + 0.205 * (3 - i), 0.37, 0.165) for i in range(4)]
        self._axes = [figure.add_axes(row) for row in rows]
        self._trade = figure.add_axes((0.085, 0.11, 0.40, 0.31))

    def draw(self, picture: Pixels, curves: Curves, dots: Sequence[Dot]) -> Pixels:
        """Return the page (height, width, 3) as it is now."""
        self._image.set_data(picture)
        self._caption.set_text(self.caption)
        for i, name in enumerate(NAMES):
            self._draw_estimate(i, name, curves)
        self._draw_P(curves)
        self._draw_dots(dots)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _fresh(self, i: int, label: str, now: float) -> None:
        ax = self._axes[i]
        ax.clear()
        end = max(min(self._lesson.duration, SPAN), now)
        ax.set_xlim(end - min(self._lesson.duration, SPAN), end)
        ax.set_ylabel(label, size=7, labelpad=1)
        ax.tick_params(labelsize=6, pad=1, labelbottom=i == 3)
        ax.grid(alpha=0.25)

    def _draw_estimate(self, i: int, name: str, curves: Curves) -> None:
        now = curves.time[-1] if len(curves.time) else 0.0
        self._fresh(i, f"{symbol(name)}\n[{unit(name)}]", now)
        ax = self._axes[i]
        for racer, colour in enumerate(COLOURS):
            theta, band = curves.theta[:, racer, i], 2 * curves.deviation[:, racer, i]
            ax.fill_between(curves.time, theta - band, theta + band, color=colour, alpha=0.2, lw=0)
            ax.plot(curves.time, theta, color=colour, lw=1.2)
        ax.plot(curves.time, curves.truth[:, i], "k--", lw=0.9)
        truth = curves.truth[:, i] if len(curves.time) else np.ones(1)
        ax.set_ylim(0.9 * truth.min(), 1.16 * truth.max())  # a burst may not set the scale

    def _draw_P(self, curves: Curves) -> None:
        now = curves.time[-1] if len(curves.time) else 0.0
        self._fresh(3, "diag P", now)
        ax = self._axes[3]
        for racer, colour in enumerate(COLOURS):
            for i, style in enumerate(("-", "--", ":")):
                ax.plot(curves.time, curves.P[:, racer, i], style, color=colour, lw=1)
        ax.set_yscale("log")
        ax.set_ylim(1e-6, 1e-2)
        ax.set_xlabel("time [s]", size=7, labelpad=1)

    def _draw_dots(self, dots: Sequence[Dot]) -> None:
        ax = self._trade
        ax.clear()
        for dot in dots:
            ax.plot(
                dot.std, dot.lag, MARKERS[dot.parameter], color=COLOURS[dot.racer], ms=7, mec="w"
            )
        for name, marker in MARKERS.items():
            ax.plot([], [], marker, color="0.4", ms=5, label=symbol(name))
        ax.set(xscale="log", yscale="log", xlim=(0.02, 5), ylim=(0.1, 6))
        for axis, ticks in ((ax.xaxis, (0.1, 1)), (ax.yaxis, (0.1, 0.3, 1, 3))):
            axis.set_major_locator(FixedLocator(ticks))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        ax.set_xlabel("std before the fault [% of nominal]", size=7, labelpad=1)
        ax.set_ylabel("lag after it [s]", size=7, labelpad=1)
        ax.tick_params(labelsize=6, pad=1)
        ax.grid(alpha=0.25, which="both")
        ax.legend(loc="lower left", fontsize=6, ncols=3, title="a dot a fault", title_fontsize=6)


def _check(path: Path) -> None:
    if path.suffix not in KINDS:
        raise OutputError(f"{path}: a recording is a {' or '.join(KINDS)} file")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it, or choose another")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise OutputError(f"{path}: an MP4 needs ffmpeg on the path; a .gif needs nothing more")


def _save_gif(path: Path, pictures: Iterator[Pixels], rate: int) -> None:
    from PIL import Image

    images = [Image.fromarray(pixels) for pixels in pictures]
    # One palette for all, or the colours would flicker; the last picture has all of them.
    palette = images[-1].quantize(160)
    first, *rest = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    first.save(
        path, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0, optimize=True
    )


def _save_mp4(path: Path, pictures: Iterator[Pixels], rate: int) -> None:
    width, height = round(100 * SIZE[0]), round(100 * SIZE[1])
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(rate)]
    target = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
    words = ["ffmpeg", "-loglevel", "error", "-y", *source, "-i", "-", *target]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None and ffmpeg.stderr is not None
        for pixels in pictures:
            ffmpeg.stdin.write(pixels.tobytes())
        ffmpeg.stdin.close()
        complaint = ffmpeg.stderr.read().decode()
    if ffmpeg.returncode:
        raise OutputError(f"{path}: ffmpeg failed: {complaint.strip()}")
