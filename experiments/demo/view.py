"""The axis in 3-D: a window that replays a record, or one picture of it."""

from __future__ import annotations

import os
import sys
import time
from ctypes.util import find_library
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.files import OutputError, new_file
from flexaxis.models_mjcf import DEFAULT, model_files
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.record import Record

STRIDE = 4
"""Samples from one picture of a window to the next."""
WAYS = {"egl": "EGL", "osmesa": "OSMesa"}
"""Values of MUJOCO_GL that need no display, best first, and the library that each needs."""


def poses(record: Record, *, exaggerate: float) -> NDArray[np.float64]:
    """Return the angles (N, n) [rad] of the n masses to be drawn, their twist exaggerated.

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
    """Return the angles (…, n) [rad] to be drawn, from the true ones.

    The gear is drawn where the motor would have it, and gear and arm are turned out of that by
    `exaggerate` times their true deviation.
    """
    drawn = np.array(angles)
    rigid = ratio * drawn[..., :1]
    drawn[..., 1:] = rigid + exaggerate * (drawn[..., 1:] - rigid)
    return drawn


def picture(record: Record, path: Path, *, at: float, exaggerate: float) -> None:
    """Write one picture (PNG) of the axis at a time of the record [s].

    Raises
    ------
    OutputError
        If nothing can be drawn on this machine.
    """
    import matplotlib.image

    mujoco, model, data = scene(model_of(record))
    data.qpos[:] = poses(record, exaggerate=exaggerate)[_sample(record, at)]
    mujoco.mj_forward(model, data)
    try:
        renderer = mujoco.Renderer(model, height=720, width=1280)
    except Exception as error:  # each platform fails in its own way
        raise OutputError(
            f"no picture can be drawn here: {error}. Without a display set MUJOCO_GL=egl or "
            "MUJOCO_GL=osmesa (Debian: libegl1, libosmesa6)"
        ) from error
    with renderer, new_file(path) as part:
        renderer.update_scene(data, camera="view")
        matplotlib.image.imsave(part, renderer.render(), format="png")


def window(record: Record, *, start: float, exaggerate: float) -> None:
    """Replay a record in a window, in real time, until it ends or the window is closed.

    Raises
    ------
    OutputError
        If no window can be opened.
    """
    mujoco, model, data = scene(model_of(record))
    angles = poses(record, exaggerate=exaggerate)
    try:
        viewer = import_module("mujoco.viewer").launch_passive(model, data)
    except Exception as error:
        raise OutputError(
            f"no window can be opened here: {error}. A picture needs no display: -o axis.png"
        ) from error
    with viewer:
        for k in range(_sample(record, start), len(angles), STRIDE):
            if not viewer.is_running():
                break
            data.qpos[:] = angles[k]
            mujoco.mj_forward(model, data)
            viewer.sync()
            time.sleep(STRIDE * record.period)


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


def draw_offscreen() -> None:
    """Set MUJOCO_GL to a way that works here, unless it is set or there is a display.

    Raises
    ------
    FlexaxisError
        If there is no display, and neither of the libraries that need none.
    """
    if sys.platform != "linux" or {"MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        return
    way = next((way for way, library in WAYS.items() if find_library(library)), None)
    if way is None:
        raise FlexaxisError(
            "no picture can be drawn here: there is no display, and neither "
            f"{' nor '.join(f'lib{library}' for library in WAYS.values())} is installed (Debian: "
            "libegl1, libosmesa6)"
        )
    os.environ["MUJOCO_GL"] = way
