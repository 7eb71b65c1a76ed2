"""Figures of a log, of what was identified from it, and of an estimator on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import welch

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.doubts.doubt import Doubt
from flexaxis.experiments.logs.friction import linear_part
from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.track import Tracked
from flexaxis.experiments.logs.visibility import Seen
from flexaxis.experiments.reporting.figures import colour
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#7F7F7F"


def log_figure(record: Record) -> Figure:
    """Draw torque and motion over time, and the spectrum of the torque."""
    fig = Figure(figsize=(8.0, 6.0), layout="constrained")
    torque, motion, spectrum = fig.subplots(3, 1)
    y = np.asarray(getattr(record, output_of(record)))
    ok = usable(record)
    for ax, values, label in ((torque, record.torque, "torque"), (motion, y, "speed [rad/s]")):
        ax.plot(record.time, values, color=BLUE, lw=0.6)
        _shade(ax, record.time, ok)
        ax.set(ylabel=label, xlim=(record.time[0], record.time[-1]))
        ax.grid(alpha=0.25)
    motion.set_xlabel("time [s]   (grey: missing, or before the end of the burn-in)")
    rate = 1 / record.period
    frequency, power = welch(record.torque, fs=rate, nperseg=min(len(y) // 2, round(4 * rate)))
    spectrum.loglog(frequency[1:], np.sqrt(power[1:]), color=BLUE, lw=0.8)
    spectrum.set(xlabel="frequency [Hz]", ylabel="torque [per √Hz]")
    spectrum.grid(alpha=0.25)
    return fig


def doubt_figure(doubt: Doubt) -> Figure:
    """Draw what was seen of a doubt."""
    fig = Figure(figsize=(8.0, 3.0), layout="constrained")
    ax = fig.subplots()
    assert doubt.draw is not None
    doubt.draw(ax)
    ax.grid(alpha=0.25)
    return fig


def visibility_figure(seen: Mapping[str, Seen]) -> Figure:
    """Draw how well the excitation can tell each parameter, eq. (28): alone, and with all free."""
    told = {
        name: (one.together, one.alone)
        for name, one in seen.items()
        if one.together is not None and one.alone is not None
    }
    fig = Figure(figsize=(8.0, 1.0 + 0.4 * len(told)), layout="constrained")
    ax = fig.subplots()
    for row, pair in enumerate(list(told.values())[::-1]):
        together, alone = (min(max(100 * x, 1e-6), 1e6) for x in pair)
        ax.barh(row, together, height=0.6, color=BLUE if together < 50 else ORANGE)
        ax.plot(alone, row, "k|", ms=12)
    ax.axvline(50, color="0.3", lw=0.8)
    ax.set_yticks(range(len(told)), list(told)[::-1])
    ax.set(xscale="log")
    ax.set_xlabel("standard deviation [% of the value], all unknown; line: were all others known")
    return fig


def bode_figure(found: Identification, period: float) -> Figure:
    """Draw the measured frequency response and that of the identified model."""
    assert found.response is not None
    model = linear_part(found.axis.model)
    chosen = (increment(model, period) if found.output == "increment" else model).parametrize(
        model.parameters
    )
    seen = found.response.omega
    fine = np.geomspace(seen.min(), seen.max(), 800)  # resonances are narrower than steps of lines
    gain = frequency_response(chosen, chosen.theta, fine, period=period)[0]
    gain = gain * np.exp(-1j * fine * found.delay)
    label = "log, dry friction taken off" if found.axis.model.laws else "log"
    fig = Figure(figsize=(8.0, 5.0), layout="constrained")
    magnitude, phase = fig.subplots(2, 1, sharex=True)
    size = 2 if len(seen) > 200 else 5  # pt: few lines would be lost as dots
    for omega, values, style in (
        (fine, gain, {"color": ORANGE, "lw": 1.3, "label": "identified model"}),
        (
            seen,
            found.response.gain,
            {"color": GREY, "marker": ".", "ms": size, "lw": 0, "label": label},
        ),
    ):
        magnitude.loglog(omega / (2 * np.pi), abs(values), **style)
        phase.semilogx(omega / (2 * np.pi), np.degrees(np.angle(values)), **style)
    magnitude.set_ylabel("|torque to speed|")
    phase.set(xlabel="frequency [Hz]", ylabel="phase [°]")
    for ax in (magnitude, phase):
        ax.grid(alpha=0.25, which="both")
    magnitude.legend(frameon=False)
    return fig


def estimates_figure(tracked: Tracked, estimator: str) -> Figure:
    """Draw the estimates over time with a ±2σ band, over nominal; changes are thin lines."""
    p = len(tracked.names)
    fig = Figure(figsize=(8.0, 1.0 + 1.6 * p), layout="constrained")
    shade = colour(estimator)
    for i, ax in enumerate(fig.subplots(p, 1, sharex=True, squeeze=False)[:, 0]):
        values = tracked.theta[:, i] / tracked.nominal[i]
        if tracked.deviations is not None:
            band = 2 * tracked.deviations[:, i] / abs(tracked.nominal[i])
            ax.fill_between(
                tracked.time, values - band, values + band, color=shade, alpha=0.2, lw=0
            )
        ax.plot(tracked.time, values, color=shade, lw=1.2)
        ax.axhline(1, color="k", ls="--", lw=0.8)
        for change in tracked.changes:
            if change.name == tracked.names[i]:
                ax.axvline(change.time, color="0.3", lw=0.8)
        for alarm in tracked.alarms:
            ax.axvline(alarm, color=ORANGE, lw=0.6)
        low, high = np.percentile(values[len(values) // 50 :], [0.5, 99.5])
        room = max(0.1 * (high - low), 0.02)
        ax.set(ylabel=f"{tracked.names[i]} / nominal", ylim=(low - room, high + room))
        _shade(ax, tracked.time, tracked.usable)
        ax.grid(alpha=0.25)
    ax.set(xlabel="time [s]", xlim=(tracked.time[0], tracked.time[-1]))
    return fig


def load_figure(tracked: Tracked, seconds: float = 0.5) -> Figure:
    """Draw a piece of the predicted load angle over the hidden encoder, and the error."""
    assert tracked.load is not None
    good = np.flatnonzero(tracked.usable)
    start = good[len(good) // 2]
    piece = (tracked.time >= tracked.time[start]) & (tracked.time < tracked.time[start] + seconds)
    load = tracked.load
    fig = Figure(figsize=(8.0, 3.0), layout="constrained")
    ax = fig.subplots()
    time = tracked.time[piece]
    ax.plot(time, load.measured[piece], "k--", lw=1.0, label="load encoder, hidden", zorder=3)
    ax.plot(time, load.predicted[piece], color=ORANGE, lw=1.2, label="from motor angle and model")
    ax.plot(time, (load.measured - load.predicted)[piece], color=GREY, lw=0.8, label="difference")
    ax.set(xlabel="time [s]", ylabel="load angle [rad]")
    ax.grid(alpha=0.25)
    ax.legend(frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.2))
    return fig


def residual_figure(tracked: Tracked, period: float) -> Figure:
    """Draw the correlation of the residual with its past, and the band of white noise."""
    error = tracked.residual[tracked.usable]
    error = error - error.mean()
    lags = np.arange(1, 61)
    values = [error[k:] @ error[: len(error) - k] / (error @ error) for k in lags]
    fig = Figure(figsize=(8.0, 2.4), layout="constrained")
    ax = fig.subplots()
    ax.vlines(lags * period * 1e3, 0, values, color=BLUE)
    ax.axhspan(-2 / np.sqrt(len(error)), 2 / np.sqrt(len(error)), color="0.5", alpha=0.2, lw=0)
    height = max(1.3 * np.max(np.abs(values)), 0.1)
    ax.set_ylim(-height, height)
    ax.set(xlabel="lag [ms]   (grey: ±2σ of white noise)", ylabel="correlation")
    ax.grid(alpha=0.25)
    return fig


def _shade(ax, time: Array, ok: NDArray[np.bool_]) -> None:  # type: ignore[no-untyped-def]
    edges = np.flatnonzero(np.diff(np.r_[1, ok, 1]))
    for begin, end in list(zip(edges[::2], edges[1::2], strict=True))[:200]:
        ax.axvspan(time[begin], time[end - 1], color="0.5", alpha=0.15, lw=0)
