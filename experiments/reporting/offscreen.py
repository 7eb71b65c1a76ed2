"""How the engine draws where there is no display; chosen before it is imported."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library

from flexaxis.sim.errors import FlexaxisError

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
