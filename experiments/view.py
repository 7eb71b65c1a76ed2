"""The axis in 3-D: a window that replays a record, or one picture of it."""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.results import OutputError, writing
from flexaxis.models_mjcf import model_files
from flexaxis.sim.record import Record

FRAMES = 50  # a second


def poses(record: Record, *, exaggerate: float) -> NDArray[np.float64]:
    """Return motor, gear and arm angle (N, 3) [rad] to be drawn, their twist exaggerated.

    The gear is drawn where the motor would have it, and gear and arm are turned out of that by
    `exaggerate` times their true deviation.

    Raises
    ------
    OutputError
        If the record does not know the true angles.
    """
    if record.true_angle_m is None or record.true_angle_g is None or record.true_angle_a is None:
        raise OutputError("the record has no true angles to show; `flexaxis simulate` makes one")
    ratio = record.scenario["parameters"]["r"]
    rigid = ratio * record.true_angle_m
    gear = rigid + exaggerate * (record.true_angle_g - rigid)
    arm = rigid + exaggerate * (record.true_angle_a - rigid)
    return np.column_stack([record.true_angle_m, gear, arm])


def picture(record: Record, path: Path, *, at: float, exaggerate: float) -> None:
    """Write one picture (PNG) of the axis at a time of the record [s]."""
    import matplotlib.image

    mujoco, model, data = _scene()
    data.qpos[:] = poses(record, exaggerate=exaggerate)[_sample(record, at)]
    mujoco.mj_forward(model, data)
    try:
        with mujoco.Renderer(model, height=720, width=1280) as renderer:
            renderer.update_scene(data, camera="view")
            pixels = renderer.render()
    except Exception as error:  # each platform fails in its own way
        raise OutputError(
            f"no picture can be drawn here: {error}. Without a display set MUJOCO_GL=egl or "
            "MUJOCO_GL=osmesa (Debian: libegl1, libosmesa6)"
        ) from error
    with writing(path):
        matplotlib.image.imsave(path, pixels)


def window(record: Record, *, start: float, exaggerate: float) -> None:
    """Replay a record in a window, in real time, until it ends or the window is closed."""
    mujoco, model, data = _scene()
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


def _scene() -> tuple[Any, Any, Any]:
    import mujoco

    _, assets = model_files("three_mass")
    model = mujoco.MjModel.from_xml_string(assets["scene.xml"].decode(), assets)
    return mujoco, model, mujoco.MjData(model)


def _sample(record: Record, at: float) -> int:
    return int(np.clip(np.searchsorted(record.time, at), 0, len(record.time) - 1))
