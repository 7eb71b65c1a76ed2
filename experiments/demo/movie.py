"""A lesson drawn into a file, GIF or MP4, without a display: for lectures and the README."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.lesson import Lesson, Player
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.experiments.demo.sheet import PICTURE, SIZE, Sheet
from flexaxis.experiments.reporting.view import camera, exaggerated
from flexaxis.experiments.running.files import OutputError, new_file
from flexaxis.sim.timing import PERIOD

Pixels = NDArray[np.uint8]

KINDS = (".gif", ".mp4")


def record(
    lesson: Lesson,
    path: Path,
    *,
    estimators: Sequence[str] | None = None,
    seed: int | None = None,
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
    player = Player(session, lesson)
    begin = session.axis.samples
    sheet = Sheet(lesson, exaggerate)
    ratio = session.axis.nominal.r
    with camera(width=PICTURE[0], height=PICTURE[1]) as shoot:
        for frame in range(number):
            until = begin + round((frame + 1) * lesson.speed / lesson.frames / PERIOD)
            player.advance(until - session.axis.samples)
            sheet.caption = player.caption
            angles = exaggerated(session.axis.angles, ratio=ratio, exaggerate=exaggerate)
            yield sheet.draw(shoot(angles), session)
            advance(1 / number)


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
