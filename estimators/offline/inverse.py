r"""
Inverse dynamics of a rigid axis by least squares: its torque as a sum of what its motion explains.

.. math:: k_T u = J \dot v + f v + f_c \operatorname{sgn} v + f_\pm |v| + g_s \sin q
          + g_c \cos q + c

is linear in its coefficients, so that nothing has to be searched for, simulated or started, and
what the axis has besides does not run away: M. Gautier and P. Poignet, *Extended Kalman filtering
and weighted least squares dynamic identification of robot*, Control Engineering Practice 9 (2001).
Torque and regressors pass the same low-pass; slow motion, where friction has its hump, is left out.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from flexaxis.estimators.offline.prediction_error import PIECES, jackknife

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLOW = 0.1  # of the top speed: slower, friction is what the torque is, and has a hump
TOP = 99.0  # percentile of |v| that is called top speed
WIDE = 5.0  # times the band of the motion, of the low-pass
MEAN = np.array([1.0, 4.0, 1.0]) / 6  # over two samples, by the rule of Simpson
FAST = 0.25  # of the sampling rate, where that ends


def inverse_dynamics(  # noqa: PLR0917
    torque: Array, speed: Array, angle: Array, ok: Flags, period: float, names: Sequence[str]
) -> dict[str, tuple[float, float]]:
    """
    Return coefficients and their standard deviations by name; empty where too little moves.

    Parameters
    ----------
    torque, speed, angle : (N,) arrays
        Means over each sample.
    ok : (N,) array of bool
    period : float
        [s].
    names : sequence of str
        Of inertia, viscous, dry, sided, constant, sine and cosine.
    """
    frequency, power = welch(speed, fs=1 / period, nperseg=min(len(speed), round(4 / period)))
    band = float(np.interp(0.98, np.cumsum(power) / max(power.sum(), 1e-300), frequency))
    corner = min(WIDE * max(band, frequency[1]), FAST / period)
    sos = butter(2, 2 * corner * period, output="sos")
    columns = {
        "inertia": np.gradient(speed, period),
        "viscous": speed,
        "dry": np.sign(speed),
        "sided": abs(speed),
        "constant": np.ones(len(speed)),
        "sine": np.sin(angle),
        "cosine": np.cos(angle),
    }
    # a difference over two samples is a mean over them, of which all else is to have one too
    signals = [torque, speed, *(columns[name] for name in names if name != "inertia")]
    means = [np.convolve(x, MEAN, "same") for x in signals]
    u, v, a, *rows = sosfiltfilt(sos, [*means[:2], columns["inertia"], *means[2:]])
    # a filter remembers what is missing for a while, and begins and ends with what is none
    memory = round(1 / (corner * period))
    missing = np.convolve(~ok, np.ones(2 * memory + 1), "same") > 0.5
    missing[:memory] = missing[len(missing) - memory :] = True
    top = float(np.percentile(abs(v[ok]), TOP)) if ok.any() else 0.0
    used = ~missing & (abs(v) > SLOW * top)
    if used.sum() <= 20 * PIECES:
        return {}
    names = ("inertia", *(name for name in names if name != "inertia"))
    theta, deviation = jackknife(np.array([a, *rows]), u, used)
    return dict(zip(names, zip(theta.tolist(), deviation.tolist(), strict=True), strict=True))
