"""
Whether a sensor does not follow the axis, or a filter has lost its way and begins anew.

A reading that repeats while the axis moves is no measurement: of a sensor that is stuck, or at the
end of its range. Noise never repeats to the last bit, but what an encoder counts does. Its speeds
are wrong by less than a count q in a period, evenly from −q to q about the truth with the variance
q²/6, so that two equal ones leave the truth 2q = 4.9 standard deviations to move in. Where ŷ has
moved by more than twice that since a reading first came, nothing is taken from the sensor, as in a
gap, until it reads something else; nor any such reading again, until one beyond it shows that it is
not the end of the range.

What was taken before that was noticed may have thrown a filter: one that does not forget all that
it knows, or that believes in jumps, begins anew when the sensor reads on. So it does when ŷ is no
number. One that forgets finds back by itself, unless it came into another valley: it begins anew
only where it has left a large part of y that is no noise for longer than it remembers anything. If
that does not help, it is judged ever later: it is lost for at most as long again as the sensor was
wrong.

All is relative to y and to what is known of its noise, so that units do not matter.
"""

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Memory

FAR = 10.0  # standard deviations that ŷ moves; twice those in which a coarse encoder may repeat
FORETOLD = 0.5  # of what is left, which the residual before foretells: it is no noise
LEFT = 0.2  # of the mean square of y, that a lost filter leaves of it: a spring of the gear that is
# no longer what the model was told leaves 0.17, a sensor that had the wrong sign for a while 0.25
MEMORY = 2.0  # s, of these means
PATIENCE = 5.0  # memories for which a filter is lost: 10 s, ten of its time constants
ABSURD = 1e2
"""
Times as large as the output, or as its noise, that no residual is: parameters inside their box, a
tenth to ten times what was told, change y by a hundred.
"""
HEEDS_ALL, HEEDS_LOST, HEEDS_NOTHING = 0.0, 1.0, 9.0  # of ``anew``, what a filter begins anew for
UNKNOWN = 1.0  # s after which a wrong state has been forgotten

KEPT = (
    "reading",
    "foreseen",
    "stuck",
    "rails",
    "patience",
)  # what is known of the sensor, whatever comes


def monitor_numbers(period: float, heeds: float = HEEDS_ALL) -> dict[str, ArrayLike]:
    """Return the numbers that `is_stuck` and `check_residual` need, with what a filter heeds."""
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
    """Return whether y is that of a stuck sensor; ``variance`` is that of y − ŷ, or NaN."""
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
    """Take a residual, and mark a filter that is lost; it is asked again after twice the time."""
    if y**2 > ABSURD**2 * max(state["signal"], state["expected"] ** 2, state["noise"]):
        return  # a mean of squares would not forget it for minutes
    squares = state["squares"]
    state["judged"] += 1.0
    count = min(state["judged"], state["astray_memory"])
    squares[0] += (epsilon**2 - squares[0]) / count
    squares[1] += (y**2 - squares[1]) / count
    squares[2] += (epsilon * state["last_left"] - squares[2]) / count
    state["last_left"] = epsilon
    lost = squares[0] > LEFT * squares[1] and squares[2] > FORETOLD * squares[0]
    # all the while, as it takes time after every jump
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
    Put a filter, or several side by side, to the start, but for what is known of the sensor.

    The torque alone moves the state from rest until it is that of the axis; what is wrong in it
    would be learnt as structure. R is learnt again; until then that before judges the sensor.
    """
    kept: dict[str, ArrayLike] = {name: np.copy(state[name]) for name in KEPT}
    kept["earlier"] = np.copy(state["noise"]) if np.max(state["anew"]) < 2.0 else np.nan
    state.block[...] = start.block
    for name, value in kept.items():
        state[name] = value
    state["waits"] = state["unknown"]
