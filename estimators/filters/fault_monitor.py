"""
Detect a sensor that does not follow the axis, and a filter that is lost and has to be reset.

A reading that repeats while the axis moves comes from a sensor that is stuck or saturated. Noise
never repeats to the last bit, but counts of an encoder do. The error of its speed is less than a
count q in a period, with a triangular distribution from −q to q and the variance q²/6. Between two
equal readings the true speed may therefore move by 2q = 4.9 standard deviations. If ŷ has moved by
more than twice that since the reading first came, samples are ignored, as in a gap, until the
sensor reads another value. The repeated reading is also ignored later, until a reading beyond it
shows that it is not the end of the range.

The samples before the detection may have moved the estimate far away. A filter that does not forget
everything, or that models jumps, is reset when the sensor reads on; so is any filter whose ŷ is not
a number. A filter that forgets recovers by itself, unless it is in another local minimum. It is
reset only if a large and correlated part of y has stayed in its residual for longer than its
memory. The next reset takes twice as long, so a filter is lost for at most twice as long as the
sensor was wrong.

Everything is relative to y and to its noise, so that units do not matter.
"""

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Memory

FAR = 10.0  # standard deviations that ŷ moves; twice those of a coarse encoder that repeats
FORETOLD = 0.5  # autocorrelation of the residual of a lost filter; that of noise is small
LEFT = 0.2  # mean square of that residual over that of y: a wrong gear spring in the model gives
# 0.17, a sensor that had the wrong sign for a while 0.25
MEMORY = 2.0  # s, of these means
PATIENCE = 5.0  # memories until a filter counts as lost: 10 s, ten of its time constants
ABSURD = 1e2
"""
Largest residual over the output or its noise that is used: parameters inside their box, 0.1 to 10
times nominal, change y by a factor of a hundred.
"""
HEEDS_ALL, HEEDS_LOST, HEEDS_NOTHING = 0.0, 1.0, 9.0  # values of ``anew`` above which it is reset
UNKNOWN = 1.0  # s, after which a wrong state is forgotten

KEPT = (
    "reading",
    "foreseen",
    "stuck",
    "rails",
    "patience",
    "rounding",
)  # kept through a reset: the state of the sensor


def monitor_numbers(period: float, heeds: float = HEEDS_ALL) -> dict[str, ArrayLike]:
    """Return the numbers of `is_stuck` and `check_residual`; ``heeds`` is one of the above."""
    return {
        "astray_memory": MEMORY / period,
        "unknown": round(UNKNOWN / period),
        "heeds": heeds,
        "reading": np.nan,
        "rails": np.nan,
        "patience": PATIENCE,
        "earlier": np.nan,
    }


@inlined
def is_stuck(state, y, prediction, variance):
    """Return whether y comes from a stuck sensor; ``variance`` is that of y − ŷ, or NaN."""
    rails = state["rails"]
    if y < rails[0]:  # it can read less
        rails[0] = np.nan
    elif y > rails[1]:
        rails[1] = np.nan
    if not np.isfinite(prediction):
        state["anew"] = 2.0
    elif y != state["reading"]:
        state["reading"], state["foreseen"] = y, prediction
        state["stuck"] = 1.0 if y == rails[0] or y == rails[1] else 0.0
        if state["stuck"] == 0.0 and state["doubted"] > 0.0:
            state["doubted"], state["anew"] = 0.0, 1.0
    elif state["stuck"] == 0.0 and (prediction - state["foreseen"]) ** 2 > FAR**2 * variance:
        state["stuck"] = state["doubted"] = 1.0
        rails[1 if prediction > y else 0] = y
    if state["waits"] > 0.0:
        state["waits"] -= 1.0
        return True
    return state["stuck"] > 0.0


@inlined
def check_residual(state, y, epsilon):
    """Take a residual, and mark a filter that is lost; the next check takes twice the time."""
    if y**2 > ABSURD**2 * max(state["signal"], state["expected"] ** 2, state["noise"]):
        return  # the means would keep it for minutes
    squares = state["squares"]
    state["judged"] += 1.0
    count = min(state["judged"], state["astray_memory"])
    squares[0] += (epsilon**2 - squares[0]) / count
    squares[1] += (y**2 - squares[1]) / count
    squares[2] += (epsilon * state["last_left"] - squares[2]) / count
    state["last_left"] = epsilon
    lost = squares[0] > LEFT * squares[1] and squares[2] > FORETOLD * squares[0]
    # without interruption, because every jump takes some time
    state["gone"] = state["gone"] + 1.0 if lost else 0.0
    lost = state["gone"] >= state["patience"] * state["astray_memory"]
    if state["judged"] >= state["patience"] * state["astray_memory"]:
        if lost:
            state["patience"] *= 2.0
            state["anew"] = 2.0
        elif state["gone"] == 0.0:
            state["patience"] = PATIENCE


def begin_anew(state: Memory, start: Memory) -> None:
    """
    Reset a filter, or several in rows, but keep the state of the sensor.

    For a while only the torque moves the state, until it is that of the axis: the filter would
    learn a wrong state as structure. R is learnt again; until then the sensor is judged by the R
    before the reset.
    """
    kept: dict[str, ArrayLike] = {name: np.copy(state[name]) for name in KEPT}
    kept["earlier"] = np.copy(state["noise"]) if np.max(state["anew"]) < 2.0 else np.nan
    state.block[...] = start.block
    for name, value in kept.items():
        state[name] = value
    state["waits"] = state["unknown"]
