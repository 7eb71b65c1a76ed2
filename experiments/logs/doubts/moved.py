"""How the torque moves an axis: outliers of the motion, signs, dry friction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import butter, sosfiltfilt

from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.findings import Finding, Kind
from flexaxis.experiments.logs.prepare import unwrapped

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OUTLIERS = "outliers of the motion"
WINDOW = 7  # samples, of which up to 3 may be outliers
USUAL = 95.0  # percentile: at most one sample in twenty is an outlier, or it is no exception
FAR = 10.0  # times the usual distance from the median of the window
STEPS = 5.0  # times the usual move within a sample: an end stop is a turn of twice that
SHOWN = 4  # times of outliers that are named
ORDER = 8  # of the prediction of a torque: three masses need six
FINE = 5.0  # samples to a period of the fastest excitation that are enough
LONGEST = 100_000  # samples that are looked at, in the middle of the log
FEWEST = 200
SOME, MUCH = 4.0, 12.0  # %; linear axes stay below 3, stiffening springs and cogging below 10
FEW = 10  # reversals, below which dry and viscous friction are hardly told apart
DITHER = 0.01  # of the rms of the speed
UNSEEN = 1e-6  # of the torque: what is left where all is predicted but for rounding
SLOW, OFTEN, PUSHED = 0.02, 8.0, 0.2  # of the rms speed; % of the samples; of the torque


def outliers_of(e: Evidence) -> Finding:
    """Return samples of the motion that are far from those before and after them."""
    for name, unit in (("angle", "rad"), ("speed", "rad/s")):
        values = getattr(e.raw, name)
        if values is None:
            continue
        there = np.isfinite(values)
        time, signal = e.raw.time[there], values[there]
        far = outliers(unwrapped(signal)[0] if name == "angle" else signal)
        if far.any():
            count, worst = int(far.sum()), np.abs(signal[far] - np.median(signal)).max()
            at = ", ".join(f"{t:.6g}" for t in time[far][:SHOWN]) + " …" * (count > SHOWN)
            text = (
                f"the {name} jumps by up to {worst:.3g} {unit} and back within some samples, as no "
                f"axis moves, at {at} s; that spoils all estimates, and what else is to be doubted "
                "cannot be seen. Empty such cells of the log: what is missing is not used"
            )
            return Finding("problem", text, OUTLIERS, float(count), "samples")
    return Finding("ok", "none", OUTLIERS, 0.0, "samples")


def outliers(x: Array) -> Flags:
    """Return which samples (N,) of a motion are none: far out, and back within three samples.

    Hampel's filter: the distance from the median of seven samples, over what it usually is. It is
    0 where the motion has one direction; where it turns, it is less than the axis moves in a
    sample, which decides where the noise is low.

    Examples
    --------
    >>> motion = np.sin(np.arange(1000) / 20)
    >>> motion[500] = 1e6
    >>> np.flatnonzero(outliers(motion)).tolist()
    [500]
    """
    distance, moves = np.abs(x - median_filter(x, WINDOW, mode="nearest")), np.abs(np.diff(x))
    if not distance.any():
        return np.zeros(len(x), bool)
    usual = float(np.percentile(distance, USUAL))
    # of an axis that rests most of the time, the moves count
    step = float(np.percentile(moves[moves > 0], USUAL))
    return distance > max(FAR * usual, STEPS * step)


def sign(e: Evidence) -> Finding:
    """Return whether torque and motion have opposite signs.

    At the lower end of the excitation an axis is inertia and friction: its acceleration leads the
    torque by 0 to 90°, and friction takes power, and never gives it.
    """
    name, s = "signs of torque and motion", e.spectra
    low, high = s.band
    bottom = (s.frequency > 0) & (s.frequency >= low) & (s.frequency < low + 0.1 * (high - low))
    faster = s.cross * (np.exp(2j * np.pi * s.frequency * e.period) - 1)
    along = float((faster[bottom] * np.exp(-0.25j * np.pi)).sum().real)
    power = float(np.mean((e.torque * e.step_speed)[e.usable]))
    if along < 0 and power < 0:
        text = "torque and motion have opposite signs: turn one of them"
        return Finding("problem", text, name, command="--scale torque=-1")
    return Finding("ok", "the torque drives the motion", name)


def dry_friction(e: Evidence) -> Finding | None:
    """Return what the sign of the speed explains of the torque, and no linear axis does.

    The torque is predicted from the torques before and the speeds around it, which is exact for any
    linear axis of that order, and then from the signs of the speeds as well. What the signs explain
    of the rest is nothing for a linear axis, however flexible; a fifth and more under dry friction,
    as soon as there are reversals.
    """
    name, unit = "dry friction", "% by the sign of the speed"
    begin = max(len(e.time) // 2 - LONGEST // 2, 0)
    piece = slice(begin, begin + LONGEST)
    share = signs_of(
        e.torque[piece], e.step_speed[piece], e.step_sign[piece], e.period, top=e.spectra.band[1]
    )
    if share is None:
        return None
    percent, stands, (reversals, _) = 100 * max(share, 0.0), _stands(e), reversals_of(e)
    few = (
        f"{reversals} reversals: dry and viscous friction can hardly be told apart. Log motions to "
        "and fro at several speeds"
    )
    if percent < SOME and stands < OFTEN:
        if reversals < FEW:
            return Finding("note", few, name, percent, unit)
        return Finding("ok", "none that the log shows", name, percent, unit)
    text = (
        f"over {reversals} reversals, the sign of the speed explains {percent:.0f} % of what "
        "no linear axis explains of the torque"
        + (
            f", and the motor stands still under torque {stands:.0f} % of the time"
            * (stands > OFTEN)
        )
        + ". A model without dry friction takes it for viscous friction, and f_m comes out too "
        "high; identify looks for it by itself, unless --friction none is given"
    )
    kind: Kind = "problem" if percent >= MUCH or stands >= OFTEN else "note"
    return Finding(kind, text, name, percent, unit)


def signs_of(
    torque: Array, speed: Array, sign: Array, period: float, *, top: float
) -> float | None:
    """Return what part the signs of the speed explain of a torque; None of too short a log.

    Parameters
    ----------
    torque : (N,) ndarray
        Means over [t_k, t_{k+1}).
    speed : (N,) ndarray
        Means over the same [rad/s].
    sign : (N,) ndarray
        Mean signs of the speed over the same, within ±1.
    period : float
        [s].
    top : float
        Upper end of the excitation [Hz].
    """
    # A relation that needs the speed better than that is not the axis, but the controller, which
    # computed the torque from it: exactly linear, whatever the friction is.
    noise = np.random.default_rng(0).standard_normal(len(speed))
    speed = speed + DITHER * float(np.std(speed)) * noise
    every = max(1, int(1 / (period * FINE * max(top, 1e-9))))
    u, v, s = (_thinned(x, every) for x in (torque, speed, sign))
    inner = slice(ORDER + 3, len(u) - ORDER - 3)
    one = _lagged(np.ones_like(u), 0, 0, inner)
    linear = np.hstack([_lagged(u, 1, ORDER, inner), _lagged(v, -2, ORDER + 1, inner), one])
    signed = _lagged(s, 0, ORDER, inner)
    if len(linear) < FEWEST:
        return None
    rest = _rest(linear, u[inner])
    if rest @ rest < UNSEEN**2 * (u @ u):
        return 0.0
    both = _rest(np.hstack([linear, signed]), u[inner])
    # a regressor without any effect explains one part in N of the rest
    return float(1 - (both @ both) / (rest @ rest)) - signed.shape[1] / len(linear)


def _thinned(x: Array, every: int) -> Array:
    if every == 1:
        return x
    return np.asarray(sosfiltfilt(butter(6, 0.8 / every, output="sos"), x)[::every])


def _lagged(x: Array, first: int, last: int, inner: slice) -> Array:
    """Return columns x[k − first] … x[k − last] for the samples k of a piece."""
    return np.stack([x[inner.start - i : inner.stop - i] for i in range(first, last + 1)], axis=1)


def _rest(regressors: Array, y: Array) -> Array:
    scaled = regressors / (np.linalg.norm(regressors, axis=0) + 1e-300)
    return np.asarray(y - scaled @ np.linalg.lstsq(scaled, y, rcond=1e-10)[0])


def reversals_of(e: Evidence) -> tuple[int, float]:
    """Return the number of reversals, and the ratio of fast to slow speeds (deciles)."""
    v = e.step_speed[e.usable]
    # a reversal that noise makes about standstill is none: a tenth of the rms must be crossed
    out = v[np.abs(v) > 0.1 * float(np.std(v))]
    slow, fast = np.percentile(np.abs(v), [10, 90])
    return int(np.sum(np.diff(np.sign(out)) != 0)), float(fast / max(slow, 1e-12 * fast + 1e-300))


def _stands(e: Evidence) -> float:
    """Return how often the motor stands while its torque changes [%]; 0 where steps hide it."""
    u, v = e.torque[e.usable], e.step_speed[e.usable]
    slow, moves = np.abs(v) < SLOW * float(np.std(v)), np.abs(v[v != 0])
    if not len(moves) or np.percentile(moves, 1) > SLOW * float(np.std(v)):
        return 0.0
    # what only holds a load is not meant, nor is a pause without torque
    slow &= np.abs(u - np.median(u)) > PUSHED * float(np.std(u))
    return 100 * float(slow.mean())
