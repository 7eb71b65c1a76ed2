"""Logs that cannot be what they say: constant signals, wrong units, impossible speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.prepare import unwrapped

Array = NDArray[np.float64]

SI = {"time": "s", "angle": "rad", "speed": "rad/s"}
FAST = 2000.0  # rad/s, 19 000 rpm: motors of axes stay below, spindles do not
ABSURD = 1e8  # times the usual; a converter of 24 bits has 1.7e7 steps
FASTEST = 1e4  # rad/s, 95 000 rpm: above motor spindles for milling, sold up to some 60 000 rpm


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError for signals that cannot be used or must be in another unit.

    A unit that somebody stated, in the file or by an option, is believed where it can be.
    """
    for name in ("torque", "angle", "speed"):
        values = getattr(raw, name)
        if values is None:
            continue
        if not np.isfinite(values).any():
            raise LogError(f"{name} holds no numbers in any of its {len(values)} samples")
        if np.nanmax(values) == np.nanmin(values):
            raise LogError(
                f"{name} is constant, {np.nanmin(values):g} over all {len(values)} samples: the "
                "wrong column, or an axis that stood still"
            )
    _refuse_absurd_torque(raw)
    if raw.angle is not None and "angle" not in raw.stated:
        _refuse_degrees(raw.angle)
    if raw.speed is not None and raw.angle is not None:
        _refuse_other_speed(raw)
    if len(raw.time) > 1 and "time" not in raw.stated:
        step = float(np.median(np.diff(raw.time)))
        if step >= 1:
            raise LogError(
                f"time advances by {step:g} s a sample: is it in ms, us or ns? State it with "
                "--unit time=us, or, if it is right, --unit time=s"
            )
    _refuse_too_fast(raw)


def _refuse_absurd_torque(raw: Raw) -> None:
    """Refuse what no converter has measured beside the rest: it would throw every estimator."""
    size = np.where(np.isfinite(raw.torque), np.abs(raw.torque), 0.0)  # what is not is missing
    at = int(np.argmax(size))
    usual = float(np.percentile(size, 99))
    if usual > 0 and size[at] > ABSURD * usual:
        raise LogError(
            f"torque is {raw.torque[at]:.3g} at {raw.time[at]:.6g} s (sample {at}), and up to "
            f"{usual:.3g} in 99 of 100 samples: that is no torque. Correct it, or cut the log there"
        )


def _refuse_degrees(angle: Array) -> None:
    jumps = np.abs(np.diff(angle[np.isfinite(angle)]))
    turns = jumps[(jumps > 300) & (jumps < 360.5)]
    if len(turns) and turns.max() > 350:
        raise LogError(
            f"angle jumps by {turns.max():.4g} between samples, as an angle in degrees does that "
            "wraps around: state it with --unit angle=deg (or rad, if that is what it is)"
        )


def _refuse_other_speed(raw: Raw) -> None:
    """Compare the speed with the slope of the angle: their ratio tells a wrong unit."""
    assert raw.angle is not None and raw.speed is not None
    there = np.isfinite(raw.angle)
    angle = raw.angle.copy()
    angle[there] = unwrapped(angle[there])[0]
    slope = np.gradient(angle, raw.time)
    both = np.isfinite(slope) & np.isfinite(raw.speed)
    ratio = float(slope[both] @ raw.speed[both] / (slope[both] @ slope[both]))
    for unit, factor in (("rpm", 60 / (2 * np.pi)), ("deg/s", 180 / np.pi), ("rev/s", 0.159155)):
        if abs(abs(ratio) / factor - 1) < 0.15:
            raise LogError(
                f"speed is {ratio:.3g} times the slope of the angle, as one in {unit} would be: "
                f"state it with --unit speed={unit} (or is the angle in another unit?)"
            )
    if abs(abs(ratio) * 180 / np.pi - 1) < 0.15:
        raise LogError(
            f"speed is {ratio:.3g} times the slope of the angle, as if that were in degrees: "
            "state it with --unit angle=deg"
        )


def usual_speed(raw: Raw, name: str) -> float | None:
    """Return the speed [rad/s] below which a motor is for 95 % of a log, by its angle or speed.

    None where there is no such signal, or somebody stated its unit.
    """
    values = getattr(raw, name)
    if values is None or name in raw.stated:
        return None
    there = np.isfinite(values)
    speed = values[there]
    if name == "angle":
        speed = np.diff(unwrapped(speed)[0]) / np.diff(raw.time[there])
    return float(np.percentile(abs(speed), 95)) if len(speed) else None


def other_units(name: str) -> str:
    """Return a question for the unit of an angle or a speed, and how to state it."""
    units = "deg or counts" if name == "angle" else "rpm or deg/s"
    return (
        f"is {name} in {units}? State it with --unit {name}=… or --scale {name}=FACTOR, or time "
        f"with --unit time=…; if all is right, with --unit {name}={SI[name]}"
    )


def _refuse_too_fast(raw: Raw) -> None:
    for name in ("angle", "speed"):
        usual = usual_speed(raw, name)
        if usual is not None and usual > FASTEST:
            raise LogError(f"the motor would turn at {usual:.3g} rad/s: {other_units(name)}")
