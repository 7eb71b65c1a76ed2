"""Provide one compiled callback for all friction laws that are missing in MuJoCo.

A process can have only one MuJoCo callback for passive forces. MuJoCo calls this callback whenever
it computes the passive forces. The callback in this module searches the custom numeric fields of a
MuJoCo model for rows of friction parameters (see `sim/tables/friction.py`). Each run of a batch has
its own friction parameters. The callback does not affect models without rows of friction
parameters.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import mujoco

from flexaxis.sim.errors import SimulationError
from flexaxis.sim.tables.friction import COMPILED_LAWS, MARK, WIDTH

_LOCK = Lock()
_SEARCHED = 1 << 18  # number of bytes to search at the start of an engine structure
_NUMBERS = 7919  # number of custom numbers in the probe model; no other size has this value


def install() -> None:
    """Install the friction callback in MuJoCo; the first call takes about 1 s to compile it.

    Raises
    ------
    SimulationError
        If another callback for passive forces is already installed.
    """
    with _LOCK:
        ours, present = _compiled().ctypes, mujoco.get_mjcb_passive()
        if present is not None and present is not ours:
            raise SimulationError(
                "MuJoCo already has another callback for passive forces, and a process can have "
                "only one. Remove the other callback with mujoco.set_mjcb_passive(None), or "
                "simulate friction laws in a separate process.",
                run=0, time=0.0, reason="another passive callback is already in use",
            )  # fmt: skip
        mujoco.set_mjcb_passive(ours)


@cache
def _layout() -> tuple[int, ...]:
    """Return the memory offsets, in units of 8 bytes, of all MuJoCo fields that the callback uses.

    The callback reads three fields of the MuJoCo model: the number of custom numbers, their
    address, and the transmission ratio of the first actuator. The callback also uses four fields of
    the simulation data: speeds, spring torques, passive torques and torque commands.
    """
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(mass=1.0, inertia=[1.0, 1.0, 1.0]).add_joint(name="motor")
    spec.add_actuator(name="motor", target="motor", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spec.add_numeric(name="row", size=_NUMBERS, data=[1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    fields = (data.qvel, data.qfrc_spring, data.qfrc_passive, data.ctrl)
    ours = (model.numeric_data, model.actuator_gear)
    places = [_find(model, _NUMBERS), *(_find(model, field.ctypes.data) for field in ours)]
    return (*places, *(_find(data, field.ctypes.data) for field in fields))


def _find(structure: Any, value: int) -> int:
    """Return the index of the first 8-byte word that equals `value` in a MuJoCo structure."""
    words = (ctypes.c_int64 * (_SEARCHED // 8)).from_address(structure._address)
    for i in range(len(words)):
        if words[i] == value:
            return i
    raise SimulationError(
        f"friction laws do not work with MuJoCo {mujoco.__version__}, because the memory layout of "
        "this version is unknown; install mujoco 4.0",
        run=0, time=0.0, reason="unknown memory layout of this MuJoCo version",
    )  # fmt: skip


@cache
def _compiled() -> Any:
    """Return the compiled callback."""
    from numba import cfunc, types
    from numba.extending import intrinsic

    law = _any_of([table.torque for table in COMPILED_LAWS])
    numbers, numeric, gear, qvel, spring, passive, ctrl = _layout()
    mark, width = MARK, WIDTH

    def pointer(context: Any, address: Any) -> Any:
        def convert(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(types.float64)(types.int64), convert

    values: Any = intrinsic(pointer)  # converts an address to a pointer to floats
    words = types.CPointer(types.int64)

    @cfunc(types.void(words, words), error_model="numpy")
    def friction(model: Any, data: Any) -> None:
        rows = values(model[numeric])
        for start in range(0, model[numbers] - width + 1, width):
            if rows[start] != mark:
                return
            row = values(model[numeric] + 8 * start)
            speed, load = values(data[qvel])[0], values(data[spring])[0]
            motor = values(model[gear])[0] * values(data[ctrl])[0]
            values(data[passive])[0] -= law(row, speed, load, motor)

    return friction


def _any_of(laws: list[Any], code: int = 0) -> Callable[..., float]:
    """Combine friction laws in one function that selects a law by the code in a parameter row."""
    # `register_jitable` instead of `njit`, because NUMBA_DISABLE_JIT turns `njit` off
    from numba.extending import register_jitable

    this = register_jitable(laws[0])
    if len(laws) == 1:
        return this  # type: ignore[no-any-return]
    rest = _any_of(laws[1:], code + 1)

    @register_jitable
    def either(row: Any, speed: float, load: float, motor: float) -> float:
        if row[1] == code:
            return this(row, speed, load, motor)
        return rest(row, speed, load, motor)

    return either
