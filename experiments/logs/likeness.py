"""Whether a log is of the axis that it is taken for: by its fit, and by estimates at a limit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.fits import POOR

Array = NDArray[np.float64]

MATCHED = 50.0  # per cent of a fit that is none by chance
REMEMBERED = 10_000  # samples, after which what a filter of noise remembers counts no more


def at_limits(names: Sequence[str], theta: Array, bounds: Array, known: Array) -> list[str]:
    """Return in a sentence which estimates stand at a limit, and so are none.

    Parameters
    ----------
    names : sequence of str
    theta : ndarray (p,)
    bounds : ndarray (2, p)
        Lowest and highest values that are allowed.
    known : ndarray (p,)
        What is known of the axis, to compare with.
    """
    stuck = [
        f"{name} at {value / of:.3g} times what is known"
        for name, value, of, low, high in zip(names, theta, known, *bounds, strict=True)
        if value in (low, high)
    ]
    if not stuck:
        return []
    word = "stands at a limit" if len(stuck) == 1 else "stand at limits"
    return [
        f"{', '.join(stuck)} {word}, which is no estimate: is it a log of this axis, in the same "
        "units, and does its torque have the same sign?"
    ]


def no_fit(fit: float) -> list[str]:
    """Return in a sentence that nothing is explained, where the fit [%] says so."""
    if fit > 0:
        return []
    return [
        f"a simulation from the torque fits by {fit:.0f} % only: is it a log of this axis, in the "
        "same units, and does its torque have the same sign?"
    ]


def poor_fit(axis: Axis, fit: float, size: float, *, white: bool) -> list[str]:
    """Return in a sentence that a log is explained far worse than that of the identification.

    Expected is the fit that the noise of the axis leaves in a motion of this size; worse than
    that by more than `POOR` is what `--validate` calls another axis. Where an axis file has no
    noise, half of the motion explained and no white residual say it.

    Parameters
    ----------
    axis : Axis
    fit : float
        Of a simulation [%].
    size : float
        Standard deviation of the measured output [rad/s].
    white : bool
        Whether the residual is white.
    """
    noise = noise_of(axis)
    if noise is None:
        expected, poor = "", fit < MATCHED and not white
    else:
        usual = 100 * (1 - noise / size)
        expected, poor = f", and its noise would leave {usual:.1f} %", fit < usual - POOR
    if not poor:
        return []
    return [
        f"a simulation from the torque fits by {fit:.1f} % only{expected}: either it is not the "
        "axis that was identified, or torque or angle are in another unit, or a parameter that is "
        "not tracked is another one. Compare units and scales with the first log, then track k_T "
        "or identify again"
    ]


def noise_of(axis: Axis) -> float | None:
    """Return the standard deviation [rad/s] of what an axis left of its log; None if not known."""
    if axis.noise is None:
        return None
    impulse = np.zeros(REMEMBERED)
    impulse[0] = 1.0
    return axis.noise * float(np.linalg.norm(lfilter([1.0], axis.whitening, impulse)))
