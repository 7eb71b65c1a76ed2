"""Run an estimator on a record of a real axis, and find changes in the axis parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from flexaxis.estimators.offline.structure import TRACKED
from flexaxis.estimators.offline.trajectory import delayed
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
    """Run an estimator on a record, and find parameter changes.

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
    log, period = nominal.setup.log, record.period
    torque = delayed(log.u, axis.delay / period, smooth=log.smooth) + axis.offset
    stopped, quiet = _idle(log.y, nominal.simulated, torque, period)
    moving = replace(record, valid=valid_of(record) & ~stopped)
    names, theta, spread, alarms = _run(spec, axis, moving, torque, identify=identify, start=start)
    last = np.median(theta[-max(len(theta) // 5, 1) :], axis=0)
    setup = Setup(log_of(moving, axis), _valued(axis, names, last).model, names, axis.delay)
    problem = setup.problem()
    problem.held[-2] = True  # the offset is known
    fitted = setup.begun(problem, axis.offset)
    if not np.isfinite(fitted.square):
        raise LogError(
            "the estimates diverged, or a simulation with the last estimates diverges. Identify "
            "the axis first, or choose another estimator"
        )
    good = settled(setup.ok & ~quiet, len(axis.whitening))

    def look(z: Array) -> tuple[Array, Array]:
        result = problem.at(z, np.asarray(axis.whitening))
        sizes = np.r_[z[: len(names)], np.ones(len(z) - len(names))]
        return result.white[good], result.gradient[:, good].T * sizes

    time, past = record.time, correlation(look(fitted.z)[0])
    changes, unseen = changes_along(look, time[good], fitted.z, names)
    fit, known = Fit(setup, fitted), axis.model.parametrize(names).theta
    # after a change, no single value of the parameter fits the whole log
    fits = bool(changes) or (abs(past) < WHITE and axis.error is None)
    text = unlike(fit, axis.error) * (not fits)
    findings = [Finding("problem", text)] * bool(text)
    texts = [change.text for change in changes]
    texts += [f"this log does not show whether {', '.join(unseen)} changed"] * bool(unseen)
    if not (findings or texts):
        findings = [Finding("ok", "no parameter changed within this log")]
        texts = [
            f"the last estimate of {name} differs by {100 * by:+.1f} % from the identified value"
            for name, by in zip(names, last / known - 1, strict=True)
            if abs(by) > OFF
        ]
    texts += [f"the identified values cannot be used: {text}" for text in axis.problems]
    texts += _interruptions(record, stopped)
    infos = [
        f"fit of a simulation from the torque alone: {fit.percent:.1f} %",
        f"the largest autocorrelation of the residual is {past:.3f}; for a white residual, it is "
        f"below {WHITE}",
        *[f"number of alarms of the estimator: {int(alarms.sum())}"] * bool(alarms.any()),
    ]
    findings += [Finding("note", text) for text in texts] + [Finding("info", x) for x in infos]
    return Tracked(
        names, time, theta, spread, last, known, good, fit.percent, time[alarms], changes,
        findings,
    )  # fmt: skip


def _run(
    spec: Spec, axis: Axis, record: Record, torque: Array, *, identify: Sequence[str], start: float
) -> tuple[tuple[str, ...], Array, Array | None, Flags]:
    """Run an estimator on a record, and restart the estimator after each long gap.

    The state of the axis after a long gap is unknown, because the torque in the gap is unknown. The
    estimator starts again from its last estimates. The result contains the parameter names, the
    estimates (N, p), their standard deviations (N, p) or None, and the alarms (N,).
    """
    if axis.model.laws and not spec.is_users and not REGISTRY[spec.name].laws:
        raise LogError(
            f"the axis has nonlinear laws, such as dry friction, but {spec.text} needs a linear "
            f"model. Use --estimator {RECOMMENDED}"
        )
    log, ok = log_of(record, axis), valid_of(record)
    u, y, output = torque, log.y, log.output
    # the log determines only ratios to k_T, so glr tracks k_T only if the user asks for it
    known: dict[str, Any] = {"track": [name for name in TRACKED if name != "k_T"]}
    if not axis.model.laws:
        known |= {"noise": axis.noise} if axis.noise else {}
        u, y = (lfilter(axis.whitening, 1.0, signal) for signal in (torque, log.y))
        ok = settled(ok, len(axis.whitening))
    else:
        known |= {"deviations": dict(axis.deviation)} if axis.deviation else {}
        if output == "increment" and record.angle is not None:  # rounding of an angle is white
            y, output = record.angle, "angle"
    wanted, runs = tuple(identify), list[Any]()
    names, theta = wanted, start * axis.model.parametrize(wanted).theta  # refuses unknown names
    for begin, end in pairwise([0, *[end for _, end in _long_gaps(record)], len(y)]):
        model = _valued(axis, names, theta).model
        estimator = make_estimator(
            spec, model.nominal if spec.is_users else model, record.period,
            identify=wanted, output=output, torque=u, **known,
        )  # fmt: skip
        names = tuple(estimator.names)
        # an estimator for models with laws may also track parameters of the laws
        if estimator.output != output or names[: len(wanted)] != wanted:
            raise EstimatorError(
                f"{spec.text} estimates {', '.join(names)} from {estimator.output!r}, but should "
                f"estimate {', '.join(wanted)} from {output!r}"
            )
        runs.append(run_on(estimator, u[begin:end], y[begin:end], ok[begin:end]))
        theta = runs[-1][0][-1]
    estimates, covariances, alarms = zip(*runs, strict=True)
    spread = None
    if covariances[0] is not None:
        variances = [np.diagonal(one, axis1=1, axis2=2) for one in covariances]
        spread = np.sqrt(np.abs(np.concatenate(variances)))
    return names, np.concatenate(estimates), spread, np.concatenate(alarms)


def _interruptions(record: Record, stopped: Flags) -> list[str]:
    """Return a sentence for each long gap of a record, and one more if the axis was blocked."""
    time = record.time
    texts = [
        f"a gap of {time[end] - time[begin]:.2g} s begins at {time[begin]:.1f} s. The torque in "
        "this gap is unknown, so the estimator restarts after the gap from its last estimates"
        for begin, end in _long_gaps(record)
    ]
    if stopped.any():
        begin, end = time[stopped][[0, -1]]
        texts.append(
            f"the motor stands still between {begin:.1f} s and {end:.1f} s although the torque "
            "should move it. The motor is probably blocked, so these samples are ignored"
        )
    return texts


def _long_gaps(record: Record) -> list[tuple[int, int]]:
    """Return the first sample of each gap longer than `LONG` rows, and the first one after it."""
    gaps, N = gaps_of(valid_of(record)).tolist(), len(record.time)
    return [(begin, end) for begin, end in gaps if end - begin > LONG and begin > 0 and end < N]


def _valued(axis: Axis, names: Sequence[str], theta: Array) -> Axis:
    """Return a copy of the axis with the parameters `names` set to the estimates (p,)."""
    powers = zip(map(physical, names), theta, strict=True)
    return axis.having({name: float(value**power) for (name, power), value in powers})


def _idle(y: Array, simulated: Array, torque: Array, period: float) -> tuple[Flags, Flags]:
    """Return masks (N,) of the samples with a blocked axis and of those with a small torque.

    The axis is blocked if it stands still although the model moves. Samples with a small torque are
    excluded from the search for changes, because a closed brake would look like a parameter change.
    """
    length = max(round(WINDOW / period), 1)
    moved, model, acted = (uniform_filter1d(x**2, length) for x in (y, simulated, torque))
    stopped = (model > STOPPED**2 * np.mean(moved)) & (moved < STOPPED**2 * model)
    quiet = acted < STOPPED**2 * np.mean(acted)
    return maximum_filter1d(stopped, length), maximum_filter1d(quiet, length)


def default_estimator(axis: Axis) -> str:
    """Return the recommended estimator if the axis has nonlinear laws, else ``ekf``."""
    return RECOMMENDED if axis.model.laws else "ekf"
