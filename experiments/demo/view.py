"""Draw the axis in 3-D: replay a run in a window, or write an image file."""

import os
import sys
import time
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

Array = NDArray[np.float64]

STRIDE = 4
"""Number of samples between successive frames of a replay."""
WAYS = {"egl": "EGL", "osmesa": "OSMesa"}
"""Libraries for rendering without a display, keyed by MUJOCO_GL value; the first is preferred."""


def view(
    run: str | Path | Scenario | Record,
    *,
    seed: int = 0,
    at: float = 0.0,
    exaggerate: float = 100.0,
    picture: str | Path | None = None,
) -> Path | None:
    """Show a run in 3-D, in a window or as an image file.

    The joint twist is approximately one milliradian, so the drawing magnifies the twist. The
    drawing shows the motor at its true angle.

    Parameters
    ----------
    run : str, Path, Scenario or Record
        Record to show, or scenario to simulate and show. A scenario can also be given by its name
        or path.
    seed : int
        Random seed of the simulation.
    at : float
        Time of the image, or start time of the replay [s].
    exaggerate : float
        Magnification of the joint twist. If the magnification is 1, the drawing shows the true
        angles.
    picture : str or Path, optional
        Path of the PNG file to write. By default, the function writes no file and opens a window.
        Writing a PNG file does not require a display.

    Returns
    -------
    Path or None
        Path of the image file, or None if the run was shown in a window.

    Raises
    ------
    FlexaxisError
        If the time `at` is outside the run, or if the name of the image file does not end in .png.
    OutputError
        If the computer cannot open a window or draw an image.
    """
    target = None if picture is None else Path(picture)
    if target is not None:
        if target.suffix.lower() != ".png":
            raise FlexaxisError(f"picture={str(picture)!r}: use a file name that ends in .png")
        draw_offscreen()
    from flexaxis.sim.simulate import simulate  # imports MuJoCo, so MUJOCO_GL must be set before

    if not isinstance(run, Record):
        run = simulate(run if isinstance(run, Scenario) else find_scenario(str(run)), [seed])[0]
    if not 0 <= at <= (end := run.time[-1]):
        raise FlexaxisError(f"at={at:g}: use a time within the run, from 0 to {end:g} s")
    angles = poses(run, exaggerate=exaggerate)[round(at / run.period) :]
    mujoco, model, data = scene(run.scenario.get("model", DEFAULT))
    if target is None:
        _replay(mujoco, model, data, angles, run.period)
    else:
        data.qpos[:] = angles[0]
        _draw(mujoco, model, data, target)
    return target


def poses(record: Record, *, exaggerate: float) -> Array:
    """Return the angles at which to draw the masses, including the magnified twist [rad].

    Raises
    ------
    OutputError
        If the record does not contain the true angles.
    """
    values = record.scenario.get("parameters", {})
    angles = [getattr(record, f"true_angle_{name[2:]}") for name in values if name[0] == "J"]
    if not angles or any(each is None for each in angles):
        raise OutputError(
            "a record without true angles cannot be shown in 3-D: use a simulated record"
        )
    ratio = values.get("r", 1.0)
    return exaggerated(np.column_stack(angles), ratio=ratio, exaggerate=exaggerate)


def exaggerated(angles: Array, *, ratio: float, exaggerate: float) -> Array:
    """Magnify the joint twist, and return the angles at which to draw the n masses [rad].

    In the drawing, each mass deviates `exaggerate` times as far from the angle of a rigid axis.
    """
    drawn = np.array(angles)
    rigid = ratio * drawn[..., :1]
    drawn[..., 1:] = rigid + exaggerate * (drawn[..., 1:] - rigid)
    return drawn


def _draw(mujoco: Any, model: Any, data: Any, path: Path) -> None:
    """Write an image of the axis at its current angles to a file."""
    import matplotlib.image

    mujoco.mj_forward(model, data)
    try:
        renderer = mujoco.Renderer(model, height=720, width=1280)
    except Exception as error:  # the type of the exception depends on the platform
        raise OutputError(
            f"MuJoCo cannot draw an image: {error}. Without a display, set MUJOCO_GL=egl or "
            "MUJOCO_GL=osmesa (Debian packages: libegl1, libosmesa6)"
        ) from error
    with renderer, new_file(path) as part:
        renderer.update_scene(data, camera="view")
        matplotlib.image.imsave(part, renderer.render(), format="png")


def _replay(mujoco: Any, model: Any, data: Any, angles: Array, period: float) -> None:
    """Replay the motion given by `angles` (N, n) in a window, until the user closes the window."""
    try:
        viewer = import_module("mujoco.viewer").launch_passive(model, data)
    except Exception as error:
        raise OutputError(
            f"MuJoCo cannot open a window: {error}. To write an image file, set picture='axis.png'"
        ) from error
    with viewer:
        for data.qpos[:] in angles[::STRIDE]:
            if not viewer.is_running():
                break
            mujoco.mj_forward(model, data)
            viewer.sync()
            time.sleep(STRIDE * period)


def scene(name: str = DEFAULT) -> tuple[Any, Any, Any]:
    """Return the module `mujoco`, the model of the axis in a scene, and the simulation data."""
    import mujoco

    _, assets = model_files(name)
    model = mujoco.MjModel.from_xml_string(assets["scene.xml"].decode(), assets)
    return mujoco, model, mujoco.MjData(model)


def draw_offscreen() -> None:
    """Set MUJOCO_GL to an available renderer if MUJOCO_GL is not set and there is no display.

    Raises
    ------
    FlexaxisError
        If the computer has no display and no library for rendering without a display.
    """
    if sys.platform != "linux" or {"MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        return
    way = next((way for way, library in WAYS.items() if find_library(library)), None)
    if way is None:
        raise FlexaxisError(
            "MuJoCo cannot draw an image, because there is no display and neither "
            f"{' nor '.join(f'lib{library}' for library in WAYS.values())} is installed (Debian "
            "packages: libegl1, libosmesa6)"
        )
    os.environ["MUJOCO_GL"] = way
