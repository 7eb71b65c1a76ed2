"""Dry friction: a torque that turns over with the sign of the speed.

The torque is predicted from the torques before and the speeds around it, which is exact for any
linear axis of that order, and then from the signs of the speeds as well. What the signs explain
of the rest is nothing for a linear axis, however flexible; a fifth and more under dry friction, as
soon as there are reversals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import sketch
from flexaxis.experiments.reporting.charts import Chart, Line

Array = NDArray[np.float64]

ORDER = 8  # of the prediction: three masses need six
FINE = 5.0  # samples to a period of the fastest excitation that are enough
LONGEST = 100_000  # samples that are looked at, in the middle of the log
FEWEST = 200
SOME, MUCH = 4.0, 12.0  # %; linear axes stay below 3, stiffening springs and cogging below 10
DITHER = 0.01  # of the rms of the speed
UNSEEN = 1e-6  # of the torque: what is left where all is predicted but for rounding


@dataclass(frozen=True)
class Signs:
    """What the signs of the speed say of a torque.

    Attributes
    ----------
    share : float
        Of the variance that a linear axis leaves unexplained, what they explain.
    reversals : int
    """

    share: float
    reversals: int


def signs_of(
    torque: Array, speed: Array, sign: Array, period: float, *, top: float
) -> Signs | None:
    """Return what the signs of the speed explain of a torque; None of too short a log.

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
    reversals = int(np.sum(np.diff(np.sign(speed)) != 0))
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
        return Signs(0.0, reversals)
    both = _rest(np.hstack([linear, signed]), u[inner])
    # a regressor without any effect explains one part in N of the rest
    chance = signed.shape[1] / len(linear)
    return Signs(float(1 - (both @ both) / (rest @ rest)) - chance, reversals)


def _thinned(x: Array, every: int) -> Array:
    if every == 1:
        return x
    return np.asarray(sosfiltfilt(butter(6, 0.8 / every, output="sos"), x)[::every])


def _lagged(x: Array, first: int, last: int, inner: slice) -> Array:
    """Return columns x[k − first] … x[k − last] for the samples k of a piece."""
    return np.stack([x[inner.start - i : inner.stop - i] for i in range(first, last + 1)], axis=1)


def _rest(regressors: Array, y: Array) -> Array:
    scaled = regressors / (np.linalg.norm(regressors, axis=0) + 1e-300)
    return y - scaled @ np.linalg.lstsq(scaled, y, rcond=1e-10)[0]


def _look(e: Evidence) -> Doubt | None:
    name, unit = "dry friction", "% by the sign of the speed"
    begin = max(len(e.time) // 2 - LONGEST // 2, 0)
    piece = slice(begin, begin + LONGEST)
    signals = e.torque[piece], e.step_speed[piece], e.step_sign[piece]
    found = signs_of(*signals, e.period, top=e.band[1])
    if found is None:
        return None
    share = 100 * max(found.share, 0.0)
    if share < SOME:
        return Doubt(name, share, unit, "ok", "none that the log shows")
    text = (
        f"over {found.reversals} reversals, the sign of the speed explains {share:.0f} % of what "
        "no linear axis explains of the torque. A model without dry friction takes it for viscous "
        "friction, and f_m comes out too high"
    )
    if share < MUCH:
        text = "some: " + text
    verdict = "note" if share < MUCH else "problem"
    return Doubt(
        name,
        share,
        unit,
        verdict,  # type: ignore[arg-type]
        text,
        "flexaxis identify … --friction auto",
        {"friction": "auto"},
        draw=lambda: _draw(e, piece),
    )


def _draw(e: Evidence, piece: slice) -> Chart:
    """Return torque less the part for acceleration over speed: its mean, and where most of it is.

    Most is from the 10th to the 90th percentile.
    """
    u, v = e.torque[piece], e.step_speed[piece]
    a = np.gradient(v, e.period)
    rest = u - a * float(a @ (u - u.mean()) / (a @ a))
    # finer about zero, where friction turns over
    edges = np.percentile(np.abs(v), np.linspace(0, 98, 15))
    edges = np.unique(np.r_[-edges[::-1], edges])
    place = np.digitize(v, edges)
    held = [place == k for k in range(1, len(edges)) if np.sum(place == k) > 10]
    speed, mean = (np.array([values[at].mean() for at in held]) for values in (v, rest))
    low, high = np.array([np.percentile(rest[at], (10, 90)) for at in held]).T
    label = "mean of the log, and 10 … 90 % of it"
    curve = Line(who=label, x=speed, y=mean, low=low, high=high)
    y = "torque less that for acceleration [as logged]"
    return sketch("motor speed [rad/s]", y, curve, marks=[(0.0, "")])


LOOK = Look(22, _look)
