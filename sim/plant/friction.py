"""Friction that MuJoCo does not have, as one compiled function that it calls.

MuJoCo calls one such function for all models of the process, whenever it sums up passive forces.
Ours looks for rows of friction among the custom numbers of the model (see
`sim/tables/friction.py`), which a batch holds for each run, and leaves every model without
them as it is.
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
_SEARCHED = 1 << 18  # bytes of a structure of the engine: what we look for lies in these
_NUMBERS = 7919  # custom numbers of a model for looking, a number that no other size has


def install() -> None:
    """Have MuJoCo call our function from now on; the first call compiles it (a second).

    Raises
    ------
    SimulationError
        If another function is installed already.
    """
    with _LOCK:
        ours, present = _compiled().ctypes, mujoco.get_mjcb_passive()
        if present is not None and present is not ours:
            raise SimulationError(
                "this process has a passive callback of MuJoCo's already, and there is room for "
                "one: take it out by mujoco.set_mjcb_passive(None) before plants with friction "
                "laws are made, or run them in a process of their own.",
                run=0, time=0.0, reason="passive callback in use",
            )  # fmt: skip
        mujoco.set_mjcb_passive(ours)


@cache
def _layout() -> tuple[int, ...]:
    """Return where the fields lie that our function reads and writes, in units of 8 bytes.

    Of the model: how many custom numbers there are, their address, and the torque of the first
    actuator over its command; of the data: speeds, torques of springs, passive torques, commands.
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
    """Return at which of its words a structure of the engine holds a value."""
    words = (ctypes.c_int64 * (_SEARCHED // 8)).from_address(structure._address)
    for i in range(len(words)):
        if words[i] == value:
            return i
    raise SimulationError(
        f"laws of friction cannot be built into MuJoCo {mujoco.__version__}: its structures are "
        "not laid out as in the versions that are known; install mujoco 4.0",
        run=0, time=0.0, reason="unknown layout of the engine",
    )  # fmt: skip


@cache
def _compiled() -> Any:
    """Return the compiled function."""
    from numba import cfunc, types
    from numba.extending import intrinsic

    law = _any_of([table.torque for table in COMPILED_LAWS])
    numbers, numeric, gear, qvel, spring, passive, ctrl = _layout()
    mark, width = MARK, WIDTH

    def pointer(context: Any, address: Any) -> Any:
        def convert(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(types.float64)(types.int64), convert

    values: Any = intrinsic(pointer)  # of an address, the numbers that are there
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
    """Return the function of a row, and of the motion, that picks the row's law."""
    from numba.extending import register_jitable  # not njit: a switch of numba's turns that off

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
