"""
Detection of a stuck or saturated sensor, and of a diverged filter that needs a reset.

A sensor reading that repeats while the axis moves indicates a stuck or saturated sensor. Noisy
analogue readings never repeat exactly, but encoder counts do. Let q be one count per period. If the
speed is computed from encoder readings, the speed error is less than q and has a triangular
distribution with the variance q²/6. The true speed can therefore change by up to 2q, or 4.9
standard deviations of the speed error, between two equal readings. The filter treats a sensor as
stuck if the prediction ŷ has changed by more than four counts (4q) since the sensor first returned
its current reading. While the sensor is stuck, the filter ignores all samples until the reading
changes. The filter also ignores later occurrences of the repeated reading, because this reading
could be the end of the sensor range. If a later reading lies outside the assumed sensor range, the
repeated reading was not the end of the range, and the filter no longer ignores it.

Before a stuck sensor is detected, its wrong readings can move the estimate far from the true value.
When the readings of a stuck sensor change again, filters without forgetting and filters that model
parameter jumps are reset. Any filter is reset if its prediction ŷ is not a number. A filter with
forgetting recovers without a reset, unless its estimate has reached a wrong local minimum of the
mean squared residual. A filter with forgetting is therefore reset only if its residual has been
both autocorrelated and large relative to y for longer than the memory of the filter. The waiting
time before a reset doubles after each reset, so a filter remains diverged for at most twice as long
as the sensor was wrong.

All thresholds are relative to y or to the noise in y, so the unit of y does not matter.
"""

import numpy as np

from flexaxis.estimators.filters.state import PATIENCE
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Memory

FAR = 10.0  # change of ŷ in standard deviations: twice the change that a coarse encoder can miss
FORETOLD = 0.5  # smallest autocorrelation of a lost filter's residual; that of noise is small
LEFT = 0.2  # smallest mean square of a lost filter's residual relative to that of y: a wrong gear
# spring in the model leads to 0.17, a sensor whose sign was temporarily wrong to 0.25
ABSURD = 1e2
"""
Largest accepted ratio of |y| to the largest of three values: |ŷ|, the rms of ŷ, and the standard
deviation of the noise. The filter does not check the residual of a sample with a ratio above
`ABSURD`. Parameters within their bounds (0.1 to 10 times the nominal value) change y by at most a
factor of 100.
"""
HEEDS_LOST, HEEDS_NOTHING = 1.0, 9.0  # a reset requires ``anew`` > ``heeds``, which is 0 by default

KEPT = (
    "reading",
    "foreseen",
    "stuck",
    "rails",
    "patience",
    "rounding",
)  # variables that describe the sensor and are kept after a reset


@inlined
def is_stuck(state, y, prediction, variance):
    """Return whether the sensor is stuck, given the ``variance`` of y − ŷ (NaN if unknown)."""
    rails = state["rails"]
    if y < rails[0]:  # the sensor can read a lower value, so this is not the end of the range
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
    """Check a residual; if the filter has diverged, request a reset and double the waiting time."""
    if y**2 > ABSURD**2 * max(state["signal"], state["prediction"] ** 2, state["noise"]):
        return  # such a sample would dominate the means for minutes
    squares = state["squares"]
    state["judged"] += 1.0
    count = min(state["judged"], state["astray_memory"])
    squares[0] += (epsilon**2 - squares[0]) / count
    squares[1] += (y**2 - squares[1]) / count
    squares[2] += (epsilon * state["last_left"] - squares[2]) / count
    state["last_left"] = epsilon
    lost = squares[0] > LEFT * squares[1] and squares[2] > FORETOLD * squares[0]
    # count only consecutive samples, because tracking a jump of a parameter takes some time
    state["gone"] = state["gone"] + 1.0 if lost else 0.0
    patience = state["patience"] * state["astray_memory"]
    if state["judged"] >= patience:
        if state["gone"] >= patience:
            state["patience"] *= 2.0
            state["anew"] = 2.0
        elif state["gone"] == 0.0:
            state["patience"] = PATIENCE


def begin_anew(state: Memory, start: Memory) -> None:
    """
    Reset one or several filters, but keep the variables that describe the sensor.

    After a reset, the filter ignores y and predicts the state from the torque alone until the state
    errors have decayed. If the filter used y at once after a reset, it would attribute the state
    errors to the parameters. The filter also estimates the noise variance R again after a reset.
    Until a new estimate of R is available, the stuck-sensor detection uses the value of R from
    before the reset.
    """
    kept = {name: np.copy(state[name]) for name in KEPT}
    kept["earlier"] = state["noise"] * (1.0 if np.max(state["anew"]) < 2.0 else np.nan)
    state.block[...] = start.block
    for name, value in kept.items():
        state[name] = value
    state["waits"] = state["unknown"]
