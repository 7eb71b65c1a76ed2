"""The axis in 3-D: a window that replays a record, or one picture of it."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.files import OutputError, new_file
from flexaxis.models_mjcf import DEFAULT, model_files
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

FRAMES = 50  # a second


def view(
    run: str | Path | Scenario | Record,
    *,
    seed: int = 0,
    at: float = 0.0,
    exaggerate: float = 100.0,
    picture: str | Path | None = None,
) -> Path | None:
    """Show a run in 3-D: in a window, or as a picture.

    The twist of the joints is about a milliradian. The angles of gear and arm are therefore
    exaggerated; the motor turns as it does.

    Parameters
    ----------
    run : str, Path, Scenario or Record
        A scenario, which is simulated first, or a recording of `simulate` or `load`.
    seed : int
        Seed of the simulation.
    at : float
        Time of the run at which to begin [s].
    exaggerate : float
        Factor of the twist; 1 shows it as it is.
    picture : str or Path, optional
        PNG file to write instead of opening a window. It needs no display.

    Returns
    -------
    Path or None
        The picture.

    Raises
    ------
    FlexaxisError
        If a number or the name of the picture is wrong.
    """
    target = None if picture is None else Path(picture)
    if not (0 <= exaggerate < np.inf and (target is None or target.suffix.lower() == ".png")):
        raise FlexaxisError("give a factor of 0 or more, and a picture that ends in .png")
    if target is not None:
        draw_offscreen()
    from flexaxis.sim.simulate import simulate  # imports the engine

    if not isinstance(run, Record):
        run = simulate(run if isinstance(run, Scenario) else find_scenario(str(run)), [seed])[0]
    if not 0 <= at <= (end := run.time[-1]):
        raise FlexaxisError(f"at={at:g}: give a time of the run, 0 to {end:g} s")
    if target is None:
        window(run, start=at, exaggerate=exaggerate)
    else:
        picture(run, target, at=at, exaggerate=exaggerate)
    return target


def poses(record: Record, *, exaggerate: float) -> NDArray[np.float64]:
    """Return the angles (N, n) [rad] of the n masses to be drawn, their twist exaggerated.

    The gear is drawn where the motor would have it, and gear and arm are turned out of that by
    `exaggerate` times their true deviation.

    Raises
    ------
    OutputError
        If the record does not know the true angles.
    """
    values = record.scenario.get("parameters", {})
    angles = [getattr(record, f"true_angle_{name[2:]}") for name in values if name[0] == "J"]
    if not angles or any(each is None for each in angles):
        raise OutputError("the record has no true angles to show; `flexaxis simulate` makes one")
    ratio = values.get("r", 1.0)
    return exaggerated(np.column_stack(angles), ratio=ratio, exaggerate=exaggerate)


def exaggerated(
    angles: NDArray[np.float64], *, ratio: float, exaggerate: float
) -> NDArray[np.float64]:
    """Return the angles (…, n) [rad] to be drawn, from the true ones."""
    drawn = np.array(angles)
    rigid = ratio * drawn[..., :1]
    drawn[..., 1:] = rigid + exaggerate * (drawn[..., 1:] - rigid)
    return drawn


def picture(record: Record, path: Path, *, at: float, exaggerate: float) -> None:
    """Write one picture (PNG) of the axis at a time of the record [s]."""
    import matplotlib.image

    with camera(model_of(record), width=1280, height=720) as shoot:
        pixels = shoot(poses(record, exaggerate=exaggerate)[_sample(record, at)])
    with new_file(path) as part:
        matplotlib.image.imsave(part, pixels, format="png")


@contextmanager
def camera(
    name: str = DEFAULT, *, width: int, height: int
) -> Iterator[Callable[[NDArray[np.float64]], NDArray[np.uint8]]]:
    """Give a function from angles (n,) [rad] to a picture (height, width, 3), without a display.

    Raises
    ------
    OutputError
        If nothing can be drawn on this machine.
    """
    mujoco, model, data = scene(name)
    try:
        renderer = mujoco.Renderer(model, height=height, width=width)
    except Exception as error:  # each platform fails in its own way
        raise OutputError(
            f"no picture can be drawn here: {error}. Without a display set MUJOCO_GL=egl or "
            "MUJOCO_GL=osmesa (Debian: libegl1, libosmesa6)"
        ) from error

    def shoot(angles: NDArray[np.float64]) -> NDArray[np.uint8]:
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera="view")
        return renderer.render()  # type: ignore[no-any-return]

    with renderer:
        yield shoot


def window(record: Record, *, start: float, exaggerate: float) -> None:
    """Replay a record in a window, in real time, until it ends or the window is closed."""
    mujoco, model, data = scene(model_of(record))
    angles = poses(record, exaggerate=exaggerate)
    try:
        viewer = import_module("mujoco.viewer").launch_passive(model, data)
    except Exception as error:
        raise OutputError(
            f"no window can be opened here: {error}. A picture needs no display: -o axis.png"
        ) from error
    period = record.time[1] - record.time[0]
    stride = max(1, round(1 / FRAMES / period))
    with viewer:
        for k in range(_sample(record, start), len(angles), stride):
            if not viewer.is_running():
                break
            data.qpos[:] = angles[k]
            mujoco.mj_forward(model, data)
            viewer.sync()
            time.sleep(stride * period)


def model_of(record: Record) -> str:
    """Return the name of the plant's model."""
    return str(record.scenario.get("model", DEFAULT))


def scene(name: str = DEFAULT) -> tuple[Any, Any, Any]:
    """Return the engine's module, and model and data of a plant with floor, light and camera."""
    import mujoco

    _, assets = model_files(name)
    model = mujoco.MjModel.from_xml_string(assets["scene.xml"].decode(), assets)
    return mujoco, model, mujoco.MjData(model)


def _sample(record: Record, at: float) -> int:
    return int(np.clip(np.searchsorted(record.time, at), 0, len(record.time) - 1))


WAYS = {"egl": "EGL", "osmesa": "OSMesa"}
"""Values of MUJOCO_GL that need no display, best first, and the library that each needs."""


def draw_offscreen() -> None:
    """Set MUJOCO_GL to a way that works here, unless it is set or there is a display.

    Raises
    ------
    FlexaxisError
        If there is no display, and neither of the libraries that can do without.
    """
    if "MUJOCO_GL" in os.environ or sys.platform != "linux":
        return  # elsewhere the engine needs no display
    if {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        return
    way = next((way for way, library in WAYS.items() if find_library(library)), None)
    if way is None:
        raise FlexaxisError(
            "no picture can be drawn here: there is no display, and neither "
            f"{' nor '.join(f'lib{library}' for library in WAYS.values())} is installed (Debian: "
            "libegl1, libosmesa6)"
        )
    os.environ["MUJOCO_GL"] = way
