"""Run an estimator on a record of a real axis, and find changes of its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import lfilter

from flexaxis.estimators import RECOMMENDED
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.prediction_error import settled
from flexaxis.estimators.offline.trajectory import delayed
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.logs.axis_file import Axis, valid_of
from flexaxis.experiments.logs.changes import Change, changes_along
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.fit import Fit, Setup
from flexaxis.experiments.logs.signals import gaps_of, log_of
from flexaxis.experiments.logs.verdict import correlation, unlike, validate
from flexaxis.experiments.running.estimate import run_on, write_estimates
from flexaxis.experiments.running.estimators import Spec, make_estimator
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

WHITE = 0.1  # maximum magnitude of the autocorrelation of a residual that is called white
OFF = 0.1  # minimum relative difference from the identified value that is reported
WINDOW = 1.0  # window in which the measured motion is compared with the simulated motion [s]
LONG = 20  # rows; in a longer gap, a line between its ends does not describe the torque
STOPPED = 0.2  # ratio of measured to simulated motion below which the axis is blocked


@dataclass(frozen=True)
class Tracked:
    """The result of running an estimator on a record.

    Attributes
    ----------
    names : tuple of str
        Names of the estimated parameters.
    time : ndarray (N,)
        Time [s].
    theta : ndarray (N, p)
        Estimates at each sample.
    deviations : ndarray (N, p) or None
        Standard deviations that the estimator reports, if any.
    last, nominal : ndarray (p,)
        Median of the last fifth of the estimates, and nominal values.
    usable : ndarray (N,) of bool
        Samples that are used to detect changes.
    fit : float
        Fit [%] of a simulation with the last estimates.
    alarms : ndarray (M,)
        Times [s] of the alarms of the estimator.
    changes : list of Change
        Detected changes.
    findings : list of Finding
        Findings, the most important first.
    """

    names: tuple[str, ...]
    time: Array
    theta: Array
    deviations: Array | None
    last: Array
    nominal: Array
    usable: Flags
    fit: float
    alarms: Array
    changes: list[Change]
    findings: list[Finding]

    @property
    def status(self) -> int:
        """Exit status: 1 if a parameter changed or the log does not match the axis, else 0."""
        return int(bool(self.changes) or any(one.kind == "problem" for one in self.findings))

    def save(self, path: Path, *, estimator: str) -> None:
        """Write the estimates, and their standard deviations if known, to a NetCDF-4 file.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        about = {"estimator": estimator}
        write_estimates(path, self.time, self.theta, self.names, about, deviation=self.deviations)


def track(
    record: Record, axis: Axis, spec: Spec, *, identify: Sequence[str], start: float = 1.0
) -> Tracked:
    """Run an estimator on a record, and find changes of parameters.

    The estimator reads the delayed torque and the output after both have passed through the
    whitening filter of the axis. The filter is linear, so the model is also valid for the filtered
    signals. The residuals of the filtered signals are white, as the estimator assumes. For an axis
    with nonlinear laws, the signals are not filtered, because a nonlinear law is not valid for
    filtered signals.

    Parameters
    ----------
    record : Record
        Record of the axis.
    axis : Axis
        Identified axis.
    spec : Spec
        Estimator, as returned by `flexaxis.experiments.running.estimators.parse`.
    identify : sequence of str
        Names of the parameters to estimate.
    start : float
        Initial estimate of each parameter as a multiple of its nominal value.

    Raises
    ------
    LogError, EstimatorError
        If a name is unknown, or if the estimator cannot be built or run.
    """
    nominal = validate(record, axis)
    log, lawful, order = log_of(record, axis), bool(axis.model.laws), len(axis.whitening)
    torque = delayed(log.u, axis.delay / log.period, smooth=log.smooth) + axis.offset
    stopped, quiet = _idle(log.y, nominal.simulated, torque, log.period)
    moving = replace(record, valid=valid_of(record) & ~stopped)
    u, y, output, ok = torque, log.y, log.output, valid_of(moving)
    if not lawful:
        u, y = (lfilter(axis.whitening, 1.0, signal) for signal in (torque, log.y))
        ok = settled(ok, order)
    elif output == "increment" and record.angle is not None:  # rounding of an angle is white
        y, output = record.angle, "angle"
    build = partial(_build, spec, identify=identify, period=log.period, output=output, torque=u)
    first = start * axis.model.parametrize(identify).theta  # raises an error for unknown names
    estimator = build(_valued(axis, identify, first))
    names, runs = tuple(estimator.names), list[Any]()
    for begin, end in pairwise([0, *[end for _, end in _long_gaps(moving)], len(y)]):
        if runs:  # after a long gap the state of the axis is unknown
            estimator = build(_valued(axis, names, runs[-1][0][-1]))
        runs.append(run_on(estimator, u[begin:end], y[begin:end], ok[begin:end]))
    theta, alarms = np.concatenate([run[0] for run in runs]), np.concatenate([x[2] for x in runs])
    spread = None
    if runs[0][1] is not None:
        variances = [np.diagonal(covariance, axis1=1, axis2=2) for _, covariance, _ in runs]
        spread = np.sqrt(np.abs(np.concatenate(variances)))
    last = np.median(theta[-max(len(theta) // 5, 1) :], axis=0)
    setup = Setup(log_of(moving, axis), _valued(axis, names, last).model, names, axis.delay)
    problem = setup.problem()
    problem.held[-2] = True  # the offset is known
    fitted = setup.begun(problem, axis.offset)
    good = settled(setup.ok & ~quiet, order)

    def look(z: Array) -> tuple[Array, Array]:
        result = problem.at(z, np.asarray(axis.whitening))
        sizes = np.r_[z[: len(names)], np.ones(len(z) - len(names))]
        return result.white[good], result.gradient[:, good].T * sizes

    residual, psi = look(fitted.z)
    if not np.isfinite(residual.sum() + psi.sum()):
        raise LogError(
            "the estimates diverged, or a simulation with the last estimates diverges. Identify "
            "the axis first, or choose another estimator"
        )
    time, past = record.time, correlation(residual)
    changes, unseen = changes_along(look, time[good], fitted.z, names)
    fit, known = Fit(setup, fitted), axis.model.parametrize(names).theta
    # after a change, no single value of the parameter fits the whole log
    fits = bool(changes) or (abs(past) < WHITE and axis.error is None)
    text = unlike(fit, axis.error) * (not fits)
    relative = dict(zip(names, last / known - 1, strict=True))
    findings = _findings(text, changes, unseen, relative)
    findings += _interruptions(record, stopped)
    infos = [
        f"fit of a simulation from the torque alone: {fit.percent:.1f} %",
        f"the largest autocorrelation of the residual is {past:.3f}; a white residual has less "
        f"than {WHITE}",
        *[f"number of alarms of the estimator: {int(alarms.sum())}"] * bool(alarms.any()),
    ]
    findings += [Finding("info", text) for text in infos]
    return Tracked(
        names, time, theta, spread, last, known, good, fit.percent, time[alarms], changes,
        findings,
    )  # fmt: skip


def _findings(
    text: str, changes: list[Change], unseen: list[str], relative: Mapping[str, float]
) -> list[Finding]:
    """Return what the log shows about changes of the parameters and about the axis."""
    findings = [Finding("problem", text)] * bool(text)
    texts = [change.text for change in changes]
    texts += [f"this log does not show whether {', '.join(unseen)} changed"] * bool(unseen)
    if not (findings or texts):
        findings = [Finding("ok", "no parameter changed within this log")]
        texts = [
            f"the last estimate of {name} differs by {100 * by:+.1f} % from the identified value"
            for name, by in relative.items()
            if abs(by) > OFF
        ]
    return findings + [Finding("note", text) for text in texts]


def _interruptions(record: Record, stopped: Flags) -> list[Finding]:
    """Return a note for each long gap of a record, and a note if the axis was blocked."""
    texts = [
        f"a gap of {record.time[end] - record.time[begin]:.2g} s begins at "
        f"{record.time[begin]:.1f} s. The torque in this gap is unknown, so the estimator restarts "
        "after the gap from its last estimates"
        for begin, end in _long_gaps(record)
    ]
    if stopped.any():
        begin, end = record.time[stopped][[0, -1]]
        texts.append(
            f"the motor stands still between {begin:.1f} s and {end:.1f} s although the torque "
            "should move it. The motor is probably blocked, so these samples are ignored"
        )
    return [Finding("note", text) for text in texts]


def _long_gaps(record: Record) -> list[tuple[int, int]]:
    """Return the first sample of each gap of more than `LONG` rows, and the sample after it."""
    gaps, N = gaps_of(valid_of(record)).tolist(), len(record.time)
    return [(begin, end) for begin, end in gaps if end - begin > LONG and begin > 0 and end < N]


def _valued(axis: Axis, names: Sequence[str], theta: Array) -> Axis:
    """Return a copy of the axis with the parameters `names` set to the estimates (p,)."""
    powers = zip(map(physical, names), theta, strict=True)
    return axis.having({name: float(value**power) for (name, power), value in powers})


def _idle(y: Array, simulated: Array, torque: Array, period: float) -> tuple[Flags, Flags]:
    """Return flags (N,) of samples with a blocked axis, and flags of samples with a small torque.

    The axis is blocked if it stands still although the model moves. Samples with a small torque are
    excluded from the search for changes, because a brake would look like a change of a parameter.
    """
    length = max(round(WINDOW / period), 1)
    moved, model, acted = (uniform_filter1d(x**2, length) for x in (y, simulated, torque))
    stopped = (model > STOPPED**2 * np.mean(moved)) & (moved < STOPPED**2 * model)
    quiet = acted < STOPPED**2 * np.mean(acted)
    return maximum_filter1d(stopped, length), maximum_filter1d(quiet, length)


def default_estimator(axis: Axis) -> str:
    """Return the recommended estimator for an axis with or without nonlinear laws."""
    return RECOMMENDED if axis.model.laws else "ekf"


def _build(
    spec: Spec, axis: Axis, *, identify: Sequence[str], period: float, output: str, torque: Array
) -> Estimator:
    """Build an estimator from the model of an axis, or user code from the nominal values."""
    model = axis.model
    if model.laws and not spec.is_users and not REGISTRY[spec.name].laws:
        raise LogError(
            f"the axis has nonlinear laws, such as dry friction, but {spec.text} needs a linear "
            f"model. Use --estimator {RECOMMENDED}"
        )
    own: dict[str, Any] = {"noise": axis.noise}
    if model.laws:
        own = {"deviations": dict(axis.deviation)}
    known = {name: value for name, value in own.items() if value}
    estimator = make_estimator(
        spec, model.nominal if spec.is_users else model, period,
        identify=tuple(identify), output=output, torque=torque, **known,
    )  # fmt: skip
    names = tuple(estimator.names)
    # an estimator for models with laws may also track parameters of the laws
    if estimator.output != output or names[: len(identify)] != tuple(identify):
        raise EstimatorError(
            f"{spec.text} estimates {', '.join(names)} from {estimator.output!r}, but should "
            f"estimate {', '.join(identify)} from {output!r}"
        )
    return estimator
