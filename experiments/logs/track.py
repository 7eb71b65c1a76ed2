"""Run an estimator on a record of a real axis, and find changes of its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label, maximum_filter1d, uniform_filter1d
from scipy.signal import lfilter

from flexaxis.estimators import RECOMMENDED
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.prediction_error import settled
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.trajectory import delayed
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.axis_file import Axis, valid_of
from flexaxis.experiments.logs.changes import Change, changes_along
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.signals import log_of
from flexaxis.experiments.logs.verdict import correlation, validate
from flexaxis.experiments.running.estimate import run_on, write_estimates
from flexaxis.experiments.running.estimators import Spec, make_estimator
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

WHITE = 0.1  # maximum magnitude of the autocorrelation of a residual that is called white
OFF = 0.1  # minimum relative difference from the identified value that is reported
WINDOW = 1.0  # window in which the measured motion is compared with the simulated motion [s]
LONG = 20  # rows; a longer gap with an unknown torque leaves an unknown speed after it
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
    axis.check_rate(record.period)
    log, lawful = log_of(record, axis), bool(axis.model.laws)
    torque = delayed(log.u, axis.delay / log.period, smooth=log.smooth) + axis.offset
    whiten, order = partial(lfilter, axis.whitening, 1.0), len(axis.whitening)
    u, y, output = whiten(torque), whiten(log.y), log.output
    if lawful:
        u, y = torque, log.y
        if output == "increment" and record.angle is not None:  # rounding of an angle is white
            y, output = record.angle, "angle"
    estimator = _build(spec, axis, identify, start, period=log.period, output=output, torque=u)
    names = tuple(estimator.names)
    model = SIGNALS[log.output].predicted(axis.model, log.period).parametrize(names)
    simulated = predict(model, model.theta, torque, period=log.period)[0]
    stopped, quiet = _idle(log.y, simulated, torque, log.period)
    valid = valid_of(record) & ~stopped
    theta, claimed, alarms = run_on(estimator, u, y, valid if lawful else settled(valid, order))
    good = settled(log.ok & ~stopped & ~quiet, order)
    last = np.median(theta[-max(len(theta) // 5, 1) :], axis=0)

    def look(theta: Array) -> tuple[Array, Array]:
        simulated, psi = predict(model, theta, torque, period=log.period)
        white = whiten(np.vstack([log.y - simulated, psi.T]))[:, good]
        return white[0], white[1:].T

    residual, psi = look(last)
    if not np.isfinite(residual.sum() + psi.sum()):
        raise LogError(
            "the estimates diverged, or a simulation with the last estimates diverges. Identify "
            "the axis first, or choose another estimator"
        )
    changes, unseen = changes_along(look, record.time[good], last, names)
    powers = zip(map(physical, names), last, strict=True)
    valued = axis.having({name: float(value**power) for (name, power), value in powers})
    checked, past = validate(replace(record, valid=valid), valued), correlation(residual)
    # after a change, no single value of the parameter fits the whole log
    fits = bool(changes) or (abs(past) < WHITE and axis.usual is None)
    findings = [Finding("problem", checked.unlike)] * bool(checked.unlike and not fits)
    findings += _long_gaps(record)
    texts = [change.text for change in changes]
    texts += [f"this log does not show whether {', '.join(unseen)} changed"] * bool(unseen)
    if not (findings or texts):
        findings = [Finding("ok", "no parameter changed within this log")]
        texts = [
            f"the last estimate of {name} differs by {100 * by:+.1f} % from the identified value"
            for name, by in zip(names, last / model.theta - 1, strict=True)
            if abs(by) > OFF
        ]
    if stopped.any():
        begin, end = record.time[stopped][[0, -1]]
        texts.append(
            f"the motor stands still between {begin:.1f} s and {end:.1f} s although the torque "
            "should move it. The motor is probably blocked, so these samples are ignored"
        )
    infos = [
        f"fit of a simulation from the torque alone: {checked.fit.percent:.1f} %",
        f"the largest autocorrelation of the residual is {past:.3f}; a white residual has less "
        f"than {WHITE}",
        *[f"number of alarms of the estimator: {int(alarms.sum())}"] * bool(alarms.any()),
    ]
    findings += [Finding("note", text) for text in texts] + [Finding("info", x) for x in infos]
    spread = None if claimed is None else np.sqrt(np.abs(np.diagonal(claimed, axis1=1, axis2=2)))
    return Tracked(
        names, record.time, theta, spread, last, model.theta, good, checked.fit.percent,
        record.time[alarms], changes, findings,
    )  # fmt: skip


def _long_gaps(record: Record) -> list[Finding]:
    """Return a problem for each gap of more than `LONG` rows within a record."""
    findings = []
    for (gap,) in find_objects(label(~valid_of(record))[0]):
        if gap.stop - gap.start > LONG and gap.start > 0 and gap.stop < len(record.time):
            text = (
                f"{gap.stop - gap.start} rows are missing at {record.time[gap.start]:.1f} s. The "
                "torque in this gap is not known, so estimates and changes after it can be wrong. "
                f"Import the part after the gap alone, with --rows {gap.stop}:"
            )
            findings.append(Finding("problem", text))
    return findings


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
    spec: Spec,
    axis: Axis,
    identify: Sequence[str],
    start: float,
    *,
    period: float,
    output: str,
    torque: Array,
) -> Estimator:
    """Build an estimator from the model of an axis, or user code from the nominal values."""
    model = axis.model
    model.parametrize(identify)  # raises an error for unknown names
    values = dict(model.nominal)
    for name, power in map(physical, identify):
        values[name] *= start**power
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
        spec, values if spec.is_users else replace(model, nominal=values), period,
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
