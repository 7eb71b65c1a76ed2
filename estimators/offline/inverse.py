r"""
Inverse dynamics of a rigid axis by least squares: its torque as a sum of what its motion explains.

.. math:: k_T u = J \dot v + f v + f_c \operatorname{sgn} v + f_\pm |v| + g_s \sin q
          + g_c \cos q + c

is linear in its coefficients, so that nothing has to be searched for, simulated or started, and
what the axis has besides does not run away: M. Gautier and P. Poignet, *Extended Kalman filtering
and weighted least squares dynamic identification of robot*, Control Engineering Practice 9 (2001).
Torque and regressors pass the same low-pass; slow motion, where friction has its hump, is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.prediction_error import damped_step

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLOW = 0.1  # of the top speed: slower, friction is what the torque is, and has a hump
TOP = 99.0  # percentile of |v| that is called top speed
WIDE = 5.0  # times the band of the motion, of the low-pass
FAST = 0.25  # of the sampling rate, where that ends
HELD, MEAN = np.array([0.25, 0.5, 0.25]), np.array([1.0, 4.0, 1.0]) / 6
"""Means over two samples of what is held over each, and of what is smooth (Simpson's rule)."""
PIECES = 10  # of a record
REGRESSORS = ("inertia", "viscous", "dry", "sided", "constant", "sine", "cosine")


@dataclass(frozen=True)
class Motion:
    """
    What a record says of a rigid axis, a sample each from t_k to t_{k+1}.

    Attributes
    ----------
    torque : (N,) array
        Low-passed.
    columns : dict of str to (N,) array
        Regressors by `REGRESSORS`, low-passed.
    speed, angle : (N,) arrays
        Low-passed; the angle is as measured, or from where it starts.
    used : (N,) array of bool
        Where the axis moves, and nothing is missing.
    """

    torque: Array
    columns: Mapping[str, Array]
    speed: Array
    angle: Array
    used: Flags


@dataclass(frozen=True)
class Inverse:
    """
    Coefficients of a rigid axis.

    Attributes
    ----------
    value, deviation : dict of str to float
        By regressor; the deviation is from the spread over pieces of the record.
    rest : (N,) array
        What of the torque they do not explain.
    motion : Motion
    """

    value: Mapping[str, float]
    deviation: Mapping[str, float]
    rest: Array
    motion: Motion

    def sure(self, name: str) -> float:
        """Return a coefficient in its standard deviations."""
        return abs(self.value[name]) / max(self.deviation[name], np.finfo(float).tiny)

    def gain(self, names: Sequence[str]) -> float:
        """Return the part of the torque that others leave which some regressors explain (rms)."""
        used = self.motion.used
        others = [name for name in self.value if name not in names]
        columns = np.stack([self.motion.columns[name] for name in others])[:, used]
        torque = self.motion.torque[used]
        left = torque - np.linalg.lstsq(columns.T, torque)[0] @ columns
        return float(1 - np.std(self.rest[used]) / max(float(np.std(left)), 1e-300))


def motion_of(
    torque: Array, speed: Array, angle: Array, ok: Flags, period: float, *, held: bool = False
) -> Motion:
    """
    Return torque and regressors, low-passed alike.

    Parameters
    ----------
    torque, speed, angle : (N,) arrays
        Means over [t_k, t_{k+1}).
    ok : (N,) array of bool
    period : float
        [s].
    held : bool
        Whether the torque is held over each sample.
    """
    frequency, power = welch(speed, fs=1 / period, nperseg=min(len(speed), round(4 / period)))
    band = float(np.interp(0.98, np.cumsum(power) / max(power.sum(), 1e-300), frequency))
    corner = min(WIDE * max(band, frequency[1]), FAST / period)
    sos = butter(2, 2 * corner * period, output="sos")

    def low(x: Array, mean: Array = MEAN) -> Array:
        # a difference over two samples is a mean over them, of which all else is to have one too
        return np.asarray(sosfiltfilt(sos, np.convolve(np.pad(x, 1, "edge"), mean, "valid")))

    v, q = low(speed), low(angle - angle[0]) + angle[0]
    top = float(np.percentile(abs(v[ok]), TOP)) if ok.any() else 0.0
    # a filter remembers what is missing for a while, and begins and ends with what is none
    memory = round(1 / (corner * period))
    missing = np.convolve(~ok, np.ones(2 * memory + 1), "same") > 0.5
    missing[:memory] = missing[len(missing) - memory :] = True
    columns = {
        "inertia": np.asarray(sosfiltfilt(sos, np.gradient(speed, period))),
        "viscous": v,
        "dry": low(np.sign(v)),
        "sided": low(abs(v)),
        "constant": np.ones_like(v),
        "sine": low(np.sin(q)),
        "cosine": low(np.cos(q)),
    }
    return Motion(
        low(torque, HELD if held else MEAN), columns, v, q, ~missing & (abs(v) > SLOW * top)
    )


def inverse_dynamics(motion: Motion, names: Sequence[str]) -> Inverse:
    """
    Fit the coefficients of some regressors to the torque.

    Parameters
    ----------
    motion : Motion
    names : sequence of str
        Of `REGRESSORS`.

    Raises
    ------
    EstimatorError
        If too little of the record moves.
    """
    used = motion.used
    if used.sum() <= 20 * PIECES:
        raise EstimatorError(f"{used.sum()} samples move: too few for the inverse dynamics")
    J = np.stack([motion.columns[name] for name in names])
    theta, deviation = jackknife(J, motion.torque, used)
    return Inverse(
        dict(zip(names, theta.tolist(), strict=True)),
        dict(zip(names, deviation.tolist(), strict=True)),
        motion.torque - theta @ J,
        motion,
    )


def pieces(ok: Flags) -> NDArray[np.int64]:
    """Return the number of the piece (N,) that each sample is in; all have as many usable ones."""
    count = np.cumsum(ok)
    return np.minimum(count * PIECES // max(int(count[-1]), 1), PIECES - 1)


def jackknife(J: Array, e: Array, good: Flags) -> tuple[Array, Array]:
    """
    Return the regression (q,) of e (N,) on rows of J (q, N), and its deviation from pieces.

    B. Efron and C. Stein, *The jackknife estimate of variance*, Ann. Statist. 9, 1981: each of the
    estimates without a piece of the record is one step of Gauss and Newton from that with all.
    Where white noise is all that there is, it is what a covariance says; what the model leaves out
    comes on top.
    """
    number = pieces(good)
    kept = [good & (number != i) for i in range(PIECES)]
    whole, *left = [damped_step(J[:, k] @ J[:, k].T, J[:, k] @ e[k], 0.0) for k in (good, *kept)]
    off = np.array(left) - np.mean(left, axis=0)
    return whole, np.sqrt((PIECES - 1) / PIECES * np.sum(off**2, axis=0))
