"""Whether a log can be what it says it is: timing, clipping, resolution, units, dead time, band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.prepare import Prepared

Array = NDArray[np.float64]

FASTEST = 2000.0  # rad/s, 19 000 rpm: what no motor of an axis does


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes
    ----------
    name : str
    value : float or None
        What was measured, in `unit`.
    unit : str
    verdict : {"ok", "note", "problem"}
    text : str
        In words: what it means, and what to do.
    """

    name: str
    value: float | None
    unit: str
    verdict: str
    text: str


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError for signals that cannot be used or must be in another unit.

    A unit that somebody stated, in the file or by an option, is believed where it can be.
    """
    for name in ("torque", "angle", "speed"):
        values = getattr(raw, name)
        if values is not None and np.nanmax(values) == np.nanmin(values):
            raise LogError(
                f"{name} is constant, {np.nanmin(values):g} over all {len(values)} samples: the "
                "wrong column, or an axis that stood still"
            )
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
    slope = np.gradient(np.unwrap(raw.angle), raw.time)
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


def _refuse_too_fast(raw: Raw) -> None:
    for name in ("angle", "speed"):
        values = getattr(raw, name)
        if values is None or name in raw.stated:
            continue
        there = np.isfinite(values)
        speed = values[there]
        if name == "angle":
            speed = np.diff(np.unwrap(speed)) / np.diff(raw.time[there])
        usual = float(np.percentile(abs(speed), 95)) if len(speed) else 0.0
        if usual > FASTEST:
            units = "deg or counts" if name == "angle" else "rpm or deg/s"
            raise LogError(
                f"the motor would turn at {usual:.3g} rad/s: is {name} in {units}? State it with "
                f"--unit {name}=… or --scale {name}=FACTOR, or time with --unit time=…; if all is "
                f"right, with --unit {name}={'rad' if name == 'angle' else 'rad/s'}"
            )


def examine(raw: Raw, prepared: Prepared) -> list[Check]:
    """Return everything that was looked at, before any estimator runs.

    Parameters
    ----------
    raw : Raw
        As logged: for clipping and resolution.
    prepared : Prepared
        On the grid: for everything else.
    """
    checks = [_rate(prepared), _jitter(prepared), _gaps(prepared), _clipping(raw)]
    if raw.angle is not None:
        checks.append(_resolution(raw.angle, prepared.period))
    checks += [_dead_time(prepared), _band(prepared), _offset(prepared)]
    return checks


def _rate(p: Prepared) -> Check:
    text = f"{len(p.time)} samples, {len(p.time) * p.period:.4g} s"
    if p.unwrapped:
        text += f"; angle unwrapped at {p.unwrapped} samples"
    return Check("sampling rate", 1 / p.period, "Hz", "ok", text)


def _jitter(p: Prepared) -> Check:
    percent = 100 * p.jitter
    if percent < 5:
        return Check("jitter of the time stamps", percent, "% of T", "ok", "even")
    text = "signals were interpolated; better time stamps, from the controller, would help"
    return Check("jitter of the time stamps", percent, "% of T", "note", text)


def _gaps(p: Prepared) -> Check:
    missing = 100 * float(np.mean(~p.valid))
    edges = np.flatnonzero(np.diff(np.r_[1, p.valid, 1]))
    gaps = len(edges) // 2
    if not gaps:
        return Check("missing samples", 0.0, "%", "ok", "none")
    longest = float((edges[1::2] - edges[::2]).max() * p.period)
    text = f"{gaps} gap(s), the longest {longest:.3g} s; marked, not updated on"
    return Check("missing samples", missing, "%", "note", text)


def _clipping(raw: Raw) -> Check:
    """Count samples that stand at an extreme value for three or more in a row."""
    u = raw.torque[np.isfinite(raw.torque)]
    stuck = np.zeros(len(u), bool)
    for extreme in (u.max(), u.min()):
        run = np.convolve(u == extreme, np.ones(3), "valid") > 2.5
        for shift in range(3):
            stuck[shift : len(u) - 2 + shift] |= run
    share = 100 * float(stuck.mean())
    if share == 0:
        return Check("clipping of the torque", 0.0, "%", "ok", "none")
    text = "the torque stands at its limit: harmless if that is what acted, else not usable"
    return Check("clipping of the torque", share, "%", "note" if share < 1 else "problem", text)


def _resolution(angle: Array, period: float) -> Check:
    steps = np.abs(np.diff(angle[np.isfinite(angle)]))
    span = float(np.ptp(angle[np.isfinite(angle)]))
    moved = steps[steps > 1e-9 * span]
    smallest = float(np.percentile(moved, 1)) if len(moved) else 0.0
    multiples = moved / smallest if smallest else np.array([0.5])
    if not smallest or np.mean(abs(multiples - np.rint(multiples)) < 0.05) < 0.9:
        return Check("encoder resolution", None, "rad", "ok", "finer than the motion shows")
    noise = smallest / np.sqrt(6) / period
    text = f"{2 * np.pi / smallest:.6g} steps a turn, {noise:.2g} rad/s of noise in increments"
    return Check("encoder resolution", smallest, "rad", "ok", text)


def _dead_time(p: Prepared) -> Check:
    """Measure by how much the acceleration of the motor lags the torque.

    From the phase of their cross-correlation at the upper end of the excitation, where the motor's
    own inertia is all that counts; its friction and a mode beyond that end look like a fraction
    of a sample.
    """
    name = "dead time from torque to angle"
    output = p.signals.get("angle")
    if output is None:
        output = np.cumsum(p.signals["speed"])
    a, u = np.diff(output, 2), p.signals["torque"][1:-1]
    frequency, cross = csd(u, a, fs=1 / p.period, nperseg=_segment(p))
    low, high = band(p)
    top = (frequency > high - 0.1 * (high - low)) & (frequency <= high)
    bottom = (frequency >= low) & (frequency < low + 0.1 * (high - low))
    if not top.any() or not bottom.any():
        return Check(name, None, "samples", "note", "not visible in this excitation")
    if cross[bottom].sum().real < 0:
        text = "torque and motion have opposite signs: turn one with --scale torque=-1"
        return Check(name, None, "samples", "problem", text)
    centre = 2 * np.pi * float(np.mean(frequency[top]))
    # a torque held from t_k on shows in the second differences at t_k and t_{k+1} alike
    lag = -float(np.angle(cross[top].sum())) / centre / p.period - 0.5
    if abs(lag) > 0.75:
        early = "the motor moves before its torque; " if lag < 0 else ""
        text = f"{early}a shift of one sample ruins the estimates: let identify find the delay"
        return Check(name, lag, "samples", "problem", text)
    text = "less than a sample, but let identify find it" if abs(lag) > 0.25 else "none to speak of"
    return Check(name, lag, "samples", "ok", text)


def _segment(p: Prepared) -> int:
    return min(len(p.time) // 2, round(4 / p.period))


def band(p: Prepared) -> tuple[float, float]:
    """Return the frequencies [Hz] between which 98 % of the power of the torque lies."""
    frequency, power = welch(p.signals["torque"], fs=1 / p.period, nperseg=_segment(p))
    share = np.cumsum(power) / np.sum(power)
    low, high = np.interp([0.01, 0.99], share, frequency)
    return float(low), float(high)


def _band(p: Prepared) -> Check:
    low, high = band(p)
    text = f"98 % of the torque lies within {low:.3g} … {high:.3g} Hz"
    return Check("band of the excitation", high, "Hz", "ok", text)


def _offset(p: Prepared) -> Check:
    u = p.signals["torque"]
    share = 100 * abs(float(u.mean())) / float(np.sqrt(np.mean(u**2)))
    if share < 5:
        return Check("offset of the torque", share, "% of rms", "ok", "small")
    low, _ = band(p)
    text = (
        "gravity, friction or a sensor: the model knows none of them, so take offset and drift "
        f"away, with --highpass {max(low * 0.7, 1e-3):.2g} say"
    )
    return Check("offset of the torque", share, "% of rms", "note", text)
