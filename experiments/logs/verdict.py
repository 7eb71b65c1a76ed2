"""Whether the numbers of an identification can be used, on its log and another one; what next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from flexaxis.estimators.offline.colour import Colour
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import Change
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.fit import Answer, Candidate
from flexaxis.experiments.logs.search import Search
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of, noise_of
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

POOR = 10.0  # points of fit, by which another axis is worse than errors elsewhere leave
MATCHED = 50.0  # per cent of a fit, where nobody knows how large errors usually are
LAGS = 20
BLIND = 0.5  # relative standard deviation from which on a parameter counts as not seen
APART = 0.99  # negative correlation from which on two count as not told apart
EARLY = 3.0  # standard deviations beyond the least delay that is possible
HALF = 0.5  # samples: least delay of a measured torque, the mean over the sample before
FILTERED = 0.5  # samples of delay, from which on a speed may be filtered
NOISY = 1.2  # times the noise of the motion, that a simulation leaves of a coarse encoder
HIDDEN = 30.0  # % of a fit, below which noise of the sensor, which is not white, decides
MISSING = 0.07  # of the samples, from which on what acted in many gaps is too much
SMOOTHER = {"two_mass": "one_mass", "three_mass": "two_mass"}


def judged(
    search: Search, best: Candidate, chosen: Answer, fit: float, changes: Sequence[Change]
) -> list[Finding]:
    """Return the findings on an identification, a sentence each.

    Parameters
    ----------
    search : Search
        With what was compared.
    best : Candidate
    chosen : Answer
        The fit that is believed.
    fit : float
        Of a simulation of what was held out [%].
    changes : sequence of Change
        Of parameters within the log.
    """
    setup, fitted, log = chosen.setup, chosen.fitted, chosen.setup.log
    noise = max(noise_of(fitted.residual[log.ok]), log.rounding)
    wrong = fit < MATCHED and best.error > NOISY * noise
    dry = next((one for one in search.tried if one.name == "dry friction"), None)
    rubs = search.friction == "none" and dry is not None and dry.taken
    missing, gaps = float(1 - np.mean(log.ok)), np.count_nonzero(np.diff(log.ok.astype(int)) < 0)
    counted = float(np.mean(fitted.good)) / max(1 - missing, 1e-9)
    # behind the longest gaps the state is estimated; in all others the torque is a line
    lost = (missing > MISSING and gaps > len(setup.begins)) or counted < HALF
    problems = {
        f"a simulation explains {fit:.0f} % of pieces that it was not fitted to: the model does "
        "not describe this motion (play, a brake or a wrong column would do that); try another "
        "--model, or --highpass HZ below the excitation, or begin nearer with --start "
        "NAME=VALUE": wrong,
        f"steps of the sensor or noise hide the motion, of which {fit:.0f} % are explained: bring "
        f"the log to a lower rate, such as --resample {0.2 / log.period:.3g}, or excite "
        "more": fit < HIDDEN and not wrong,
        "the fit did not converge; use --start NAME=VALUE from these estimates, or fix with --fix "
        "NAME=VALUE what is known least": not fitted.converged,
        "dry friction would lower the error of a simulation, and a linear model takes it for "
        "viscous friction; use --friction auto": rubs,
        f"{100 * missing:.0f} % of the samples are missing, in {gaps} gaps: what acted there is "
        "not known, and estimates are off; log without loss, or use a part with --rows A:B": lost,
    }
    notes = {
        "the motion drifts below the excitation in a way that the torque does not explain: "
        f"residuals below {setup.highpass or 0:g} Hz were left out, as with --highpass "
        f"{setup.highpass or 0:g}": setup.highpass is not None and search.setup.highpass is None,
        "more than noise is left: something acts that the model has not. Deviations hold the "
        "difference of two fits": best.lacks,
    }
    compared = "; ".join(
        f"{one.name} {'taken' if one.taken else 'not taken'} ({one.before:.4g} → {one.after:.4g})"
        for one in search.tried
    )
    text = f"compared by the error of a simulation of held-out pieces: {compared}"
    return [
        *(Finding("problem", text) for text, holds in problems.items() if holds),
        *_changes(chosen, changes),
        *_unseen(search, chosen),
        *_late(best, chosen),
        *(Finding("note", text) for text, holds in notes.items() if holds),
        *([Finding("info", text)] if compared else []),
    ]


def _changes(chosen: Answer, changes: Sequence[Change]) -> Iterator[Finding]:
    for one in changes[:1]:
        k = round(one.time / chosen.setup.log.period)
        part = f"one part, with --rows 0:{k} or --rows {k}:"
        if one.kind == "drift":
            part = "a shorter part, with --rows A:B, as the value is a mean over the log"
        text = f"{one.text}: identify {part}, and follow it with flexaxis track"
        yield Finding("problem", text)


def _unseen(search: Search, chosen: Answer) -> Iterator[Finding]:
    """Yield in a sentence each what the log does not determine, and what to do about it."""
    setup, names = chosen.setup, chosen.setup.names
    shapes = setup.model.law_parameters - {"f_c"}
    ends = set(chosen.stuck) - shapes
    wide = {
        name: sd / max(abs(value), 1e-300)
        for name, value, sd in zip(names, chosen.fitted.z, chosen.deviations, strict=False)
        if name not in shapes
    }
    unseen = [name for name, share in wide.items() if name in ends or share >= BLIND]
    if len(unseen) > 2 and len(unseen) >= len(names) - 1:
        smaller = SMOOTHER.get(search.setup.model.name, "one_mass")
        text = (
            f"the log determines none of {', '.join(names)}: the excitation is too small or too "
            f"slow for this model; try --model {smaller}"
        )
        yield Finding("problem", text)
        return
    for name in unseen:
        known = "it may be 0" if wide[name] >= 1 else f"it is known to ±{100 * wide[name]:.0f} %"
        known = "it is at the bound of the search" if name in ends else known
        remedy = f"fix it with --fix {name}=VALUE, or excite what it acts on"
        if name == "f_c":
            remedy = "use --friction none, or a longer log with slow and fast motion"
        elif other := _summed(chosen, name):
            remedy = f"only {name} + {other} is seen: give --fix {name}=0, and read {other} so"
        grave = bool(ends) or 2 * len(unseen) > len(names)
        text = f"the log does not determine {name}: {known}; {remedy}"
        yield Finding("problem" if grave else "note", text)


def _summed(chosen: Answer, name: str) -> str:
    """Return of which other parameter a log tells the sum with one only; empty if of none.

    There the one goes up as the other goes down, by as much; there is no axis without a mass.
    """
    names, covariance, nonzero = chosen.setup.names, chosen.fitted.covariance, "Jk"
    i = names.index(name)
    for j, other in enumerate(names):
        variance, both = covariance[i, i], covariance[i, j]
        opposite = both < -APART * np.sqrt(variance * covariance[j, j])
        if name[0] not in nonzero and opposite and abs(both / variance + 1) < 1 - APART:
            return other
    return ""


def _late(best: Candidate, chosen: Answer) -> Iterator[Finding]:
    """Yield what a delay at the end of what is possible means, and one beyond it."""
    setup, lag, sd = chosen.setup, float(chosen.fitted.z[-1]), float(chosen.deviations[-1])
    period, least = setup.log.period, HALF if setup.log.smooth else 0.0
    if setup.delay is not None:
        return
    if lag >= max(setup.latest * (1 - 1e-9), EARLY * sd):
        yield Finding(
            "problem",
            f"the torque acts {1e3 * lag:.3g} ms late or more: the columns of torque and motion "
            "are shifted; shift one, or give --delay S",
        )
    if lag < -least * period - EARLY * sd:
        yield Finding(
            "problem" if setup.log.smooth else "note",
            f"the torque acts {-lag / period:.2f} samples before it is logged, which is not "
            "possible: its column is late, or filtered; shift it by whole samples, or log the "
            "torque before its filter. The numbers here hold for the shifted column",
        )
    if setup.log.output == "speed" and best.lacks and lag > FILTERED * period:
        yield Finding(
            "problem",
            f"the speed is behind a low-pass of about {1e3 * lag:.1g} ms, or late in another way "
            "that no delay explains; inertias and springs are off by some per cent: log the angle, "
            "or the speed before its filter",
        )


@dataclass(frozen=True)
class Fit:
    """How well a simulation from the torque alone does, above the corner of the axis.

    Attributes
    ----------
    percent : float
        100 (1 − |y − ŷ|/|y − mean y|).
    error, size : float
        Standard deviations of y − ŷ and of y [rad/s].
    """

    percent: float
    error: float
    size: float

    def unlike(self, usual: float | None) -> str:
        """Return in a sentence that this is not the axis whose errors are usually as large.

        A log with less motion has a poorer fit by the same errors.
        """
        expected = MATCHED + POOR if usual is None else 100 * (1 - usual / self.size)
        if self.percent > 0 and (self.percent >= expected - POOR or self.error <= (usual or 0.0)):
            return ""
        told = "" if usual is None else f", and its errors elsewhere would leave {expected:.1f} %"
        return (
            f"a simulation from the torque fits by {self.percent:.1f} % only{told}: it is another "
            "axis, another motion, or torque or angle are in another unit or of another sign; "
            "compare units and scales with the first log, or identify again"
        )


def fit_of(y: Array, residual: Array, ok: Flags, colour: Colour) -> Fit:
    """Return how well a simulation does.

    Parameters
    ----------
    y, residual : ndarray (N,)
        Measured output, and what the simulation leaves of it.
    ok : ndarray (N,) of bool
        What counts.
    colour : Colour
        Of which the high-pass counts.
    """
    high, counted = colour.high, ok.copy()
    counted[: colour.skip] = False
    size = float(np.std(high(y)[counted]))
    error = float(np.std(high(colour.bridged(residual, ok))[counted]))
    return Fit(100 * (1 - error / max(size, 1e-300)), error, size)


def correlation(white: Array) -> float:
    """Return the largest correlation of a residual (N,) with its past, 1 to `LAGS` samples back."""
    e = white - white.mean()
    past = correlate(e, e, method="fft")[len(e) - 1 :][: LAGS + 1]
    past = past[1:] / past[0]
    return float(past[np.argmax(abs(past))])


@dataclass(frozen=True)
class Validation:
    """What an axis says of another log.

    Attributes
    ----------
    time, measured, simulated : ndarray (N,)
        [s], and the output [rad/s]: as logged, and simulated from the torque alone.
    fit : Fit
    unlike : str
        What speaks against the axis; empty if nothing does.
    """

    time: Array
    measured: Array
    simulated: Array
    fit: Fit
    unlike: str


def validate(record: Record, axis: Axis) -> Validation:
    """Simulate a record, with nothing fitted to it but the state that it begins in.

    Parameters
    ----------
    record : Record
    axis : Axis

    Raises
    ------
    LogError
        If the log has another rate than the one that the axis was identified at.
    """
    axis.check_rate(record.period)
    log, names = log_of(record, axis), tuple(axis.model.parameters[:1])
    setup = Setup(log, axis.model, names, delay=axis.delay, highpass=axis.highpass)
    fitted = setup.begun(axis.offset, axis.delay)
    if not np.isfinite(fitted.residual).all():
        raise LogError("the axis cannot be simulated over this log: is it the same axis?")
    fit = fit_of(log.y, fitted.residual, setup.counted, fitted.colour)
    return Validation(record.time, log.y, log.y - fitted.residual, fit, fit.unlike(axis.usual))
