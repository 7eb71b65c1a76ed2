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
number, and one that learns something once when it has for seconds explained less than nothing: what
it leaves of y is then larger than y itself.

All is relative to y and to what is known of its noise, so that units do not matter.
"""

import numpy as np

from flexaxis.estimators.recursion.records import Record, record
from flexaxis.estimators.sampling.compiler import inlined

FAR = 10.0  # standard deviations that ŷ moves; twice those in which a coarse encoder may repeat
NOTHING = 2.0  # of the mean square of y, that a lost filter leaves of it. An axis that stands still
# leaves its noise, and that is all of y
MEMORY = 2.0  # s, of these means: an axis may stand still for part of it, and an outlier of 50
# times y is less than y² over it
UNKNOWN = 1.0  # s after which a wrong state has been forgotten

KEPT = "reading", "foreseen", "stuck", "rails"  # what is known of the sensor, whatever comes


def astray(period: float) -> tuple[Record, Record]:
    """Return what `repeats` and `explains_nothing` need of tuning and state."""
    tuning = record(astray_memory=MEMORY / period, unknown=round(UNKNOWN / period))
    state = record(
        reading=np.nan,  # the last one
        foreseen=0.0,  # ŷ as it was when this reading first came
        stuck=0.0,
        rails=np.full(2, np.nan),  # lowest and highest reading, where the sensor was stuck there
        doubted=0.0,  # 1 from when a sensor is found to be stuck until it reads on
        squares=np.zeros(2),  # mean squares of the residual and of y
        judged=0.0,  # samples that they are the means of
        anew=0.0,  # 1 where the filter should begin anew, 2 where its R is worth nothing either
        earlier=np.nan,  # R before it last began anew
        waits=0.0,  # samples that it still waits for its state, in mid-motion
    )
    return tuning, state


@inlined
def repeats(state, y, prediction, variance):
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
def explains_nothing(tuning, state, y, epsilon):
    """Mark a filter that has for seconds explained less than nothing."""
    squares = state["squares"]
    state["judged"] = min(state["judged"] + 1.0, tuning["astray_memory"])
    squares[0] += (epsilon**2 - squares[0]) / state["judged"]
    squares[1] += (y**2 - squares[1]) / state["judged"]
    if squares[0] > NOTHING * squares[1] and state["judged"] >= tuning["astray_memory"]:
        state["anew"] = 2.0


def begin_anew(tuning: Record, state: Record, start: Record) -> None:
    """
    Put a filter, or several side by side, to the start, but for what is known of the sensor.

    The torque alone moves the state from rest until it is that of the axis; what is wrong in it
    would be learnt as structure. R is learnt again, and the one before judges the sensor until then.
    """
    earlier = state["noise"].copy() if state["anew"].max() < 2.0 else np.nan
    sensor = {name: state[name].copy() for name in KEPT}
    state[:] = start
    for name, value in sensor.items():
        state[name] = value
    state["earlier"], state["waits"] = earlier, tuning["unknown"]
