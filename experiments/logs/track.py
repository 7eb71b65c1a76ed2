"""Any estimator on a record of a real axis: estimates over time, residuals, alarms, load angle."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import RECOMMENDED
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.colour import Colour, colourless
from flexaxis.estimators.offline.delay import delayed
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY, Entry
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import Change, changes_along
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.gap_torque import filled
from flexaxis.experiments.logs.identification.log import log_of
from flexaxis.experiments.logs.identification.validate import (
    Load,
    at_limits,
    correlation,
    fit_of,
    predicted_load,
)
from flexaxis.experiments.running.estimate import run_on, write_estimates
from flexaxis.experiments.running.estimators import Spec, make_estimator
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

WHITE = 0.1  # correlation of a residual with its past, below which it is called white


@dataclass(frozen=True)
class _Look:
    """What a record says of a model at fixed parameters."""

    model: Parametrization
    torque: Array
    measured: Array
    colour: Colour
    ok: NDArray[np.bool_]
    period: float

    def at(self, theta: Array) -> tuple[Array, Array, Array]:
        """Return y − ŷ (N,), and that and its gradient ψ (N, p) made white."""
        simulated, psi = predict(self.model, theta, self.torque, period=self.period)
        error, bridged = self.measured - simulated, self.colour.bridged
        white = self.colour.white
        return error, white(bridged(error, self.ok)), white(bridged(psi.T, self.ok)).T


@dataclass(frozen=True)
class Tracked:
    """An estimator on a record.

    Attributes
    ----------
    names : tuple of str
    time : ndarray (N,)
        [s].
    theta : ndarray (N, p)
    deviations : ndarray (N, p) or None
        Claimed by the estimator.
    nominal : ndarray (p,)
        Nominal values, for comparison.
    usable : ndarray (N,) of bool
    fit : float
        Of the output simulated at the last estimate, above the high-pass of the axis if it has one.
    residual : ndarray (N,)
        Whitened residual at the last estimate.
    correlation : float
        Largest correlation of the residual with its own past, 1 to 20 samples back.
    white : bool
        Whether that is below `WHITE`.
    alarms : ndarray (M,)
        Times [s] at which the estimator raised its own alarm, if it has one.
    changes : list of Change
    doubts : list of str
        What says that the log is not of this axis, or not in its units; sentences.
    load : Load or None
        Where the record has a load angle, which no estimator is given.
    """

    names: tuple[str, ...]
    time: Array
    theta: Array
    deviations: Array | None
    nominal: Array
    usable: NDArray[np.bool_]
    fit: float
    residual: Array
    correlation: float
    white: bool
    alarms: Array
    changes: list[Change]
    doubts: list[str]
    load: Load | None

    @property
    def last(self) -> Array:
        """Median (p,) of the last fifth of the estimates: what they came to."""
        return _last(self.theta)


def _last(theta: Array) -> Array:
    return np.median(theta[-max(len(theta) // 5, 1) :], axis=0)


def save(found: Tracked, path: Path, *, estimator: str) -> None:
    """Write the estimates as NetCDF-4, with the deviations if it claims any.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    sure = found.deviations
    about = {"estimator": estimator}
    write_estimates(path, found.time, found.theta, found.names, about, deviation=sure)


def track(
    record: Record, axis: Axis, spec: Spec, *, identify: Sequence[str], start: float = 1.0
) -> Tracked:
    """Run an estimator over a record.

    It is given the torque with the axis's delay, and both signals through the axis's whitening
    filter: as that is linear, the model holds for them as it stands, and their residuals are as
    white as the estimator assumes.

    Parameters
    ----------
    record : Record
    axis : Axis
        As identified.
    spec : Spec
        From `flexaxis.experiments.running.estimators.parse`.
    identify : sequence of str
        What to estimate.
    start : float
        θ(0) over nominal.

    Raises
    ------
    LogError, EstimatorError
        If a name is unknown, or the estimator cannot be built or run.

    Notes
    -----
    Of an axis with laws the estimator is given the signals as they are, as a law does not hold for
    filtered ones.
    """
    axis.check_known()
    axis.check_rate(record.period)
    there = np.ones(len(record.time), bool) if record.valid is None else record.valid
    log, lawful = filled(log_of(record, axis), axis, there), bool(axis.model.laws)
    output, period, ok = log.output, log.period, log.ok
    axis.model.parametrize(identify)  # refuses unknown names
    lag = axis.delay if log.smooth else max(axis.delay, 0.0)
    torque = delayed(log.u, lag / period, smooth=log.smooth) + axis.offset
    colour = replace(colourless(axis.highpass, period), inverse=np.array(axis.whitening))
    # a law holds for the signals as they are, so that only residuals can be made white
    u, y = (torque, log.y) if lawful else (colour.white(torque), colour.white(log.y))
    valid = there if lawful else colour.settled(there)
    estimator = _build(spec, axis, identify, start, period=period, output=output, torque=u)
    theta, claimed, alarms = run_on(estimator, u, y, valid)
    names = tuple(estimator.names)
    model = SIGNALS[output].predicted(axis.model, period)
    last = _last(theta)
    if not np.isfinite(last).all():
        raise LogError("the estimates diverged: identify first, or choose another estimator")
    look = _Look(model.parametrize(names), torque, log.y, colour, ok, period)
    error, residual, psi = look.at(last)
    good, nominal = colour.settled(ok), axis.model.parametrize(names).theta
    if not (np.isfinite(residual[good]).all() and np.isfinite(psi[good]).all()):
        raise LogError(
            "a simulation with the last estimates runs away, so that nothing can be told of them: "
            "correct the model, identify first, or choose another estimator"
        )
    changes = changes_along(
        lambda theta: [s[good] for s in look.at(theta)[1:]], record.time[good], last, names
    )
    past, fit = correlation(residual[good]), fit_of(log.y, error, ok, colour)
    doubts = at_limits(names, last, _limits(estimator, len(names)), nominal)
    # one value does not fit what was before a change and after it
    if not (doubts or changes or (abs(past) < WHITE and axis.usual is None)):
        doubts = [said for said in (fit.unlike(axis.usual),) if said]
    return Tracked(
        names=names,
        time=record.time,
        theta=theta,
        deviations=None if claimed is None else _deviations(claimed),
        nominal=nominal,
        usable=good,
        fit=fit.percent,
        residual=residual,
        correlation=past,
        white=abs(past) < WHITE,
        alarms=record.time[alarms],
        changes=changes,
        doubts=doubts,
        load=predicted_load(record, axis, dict(zip(names, last.tolist(), strict=True))),
    )


def default_estimator(axis: Axis) -> str:
    """Return the estimator that is recommended for an axis, by whether it has laws."""
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
    """Build an estimator for this axis; shipped ones take the model, a user's the values."""
    values = dict(axis.model.nominal)
    for name in identify:
        parameter = name.removeprefix("1/")
        values[parameter] *= start ** (-1.0 if name.startswith("1/") else 1.0)
    offered: dict[str, Any] = {"identify": tuple(identify), "output": output, "torque": torque}
    entry = next((e for e in REGISTRY.values() if e.factory is spec.make), None)
    shipped = entry is not None
    if axis.model.laws:
        _refuse_linear(spec, entry)
        if axis.deviation:
            offered["deviations"] = dict(axis.deviation)
    elif axis.noise is not None:
        offered["noise"] = axis.noise
    first = replace(axis.model, nominal=values) if shipped else values
    estimator = make_estimator(spec, first, period, **offered)
    mine = tuple(estimator.names)
    if axis.model.laws:  # who knows laws may track their parameters besides
        mine = mine[: len(identify)]
    if estimator.output != output or mine != tuple(identify):
        raise EstimatorError(
            f"{spec.text} estimates {', '.join(estimator.names)} from {estimator.output!r}; asked "
            f"were {', '.join(identify)} from {output!r}"
        )
    return estimator


def _refuse_linear(spec: Spec, entry: Entry | None) -> None:
    if entry is not None and not entry.laws:
        able = [name for name, e in REGISTRY.items() if e.laws]
        raise LogError(
            f"the axis has laws, such as dry friction, and {spec.text} knows linear models only: "
            f"use --estimator {RECOMMENDED} (or {', '.join(n for n in able if n != RECOMMENDED)})"
        )


def _limits(estimator: Estimator, p: int) -> Array:
    """Return the limits (2, p) of the estimates of an estimator; NaN where it tells none."""
    limits = np.full((2, p), np.nan)
    with suppress(TypeError, ValueError):  # what a user's estimator calls so may be anything
        told = np.asarray(getattr(estimator, "bounds", None), float)
        if told.ndim == 2 and len(told) == 2:  # a law's that are tracked besides may have none
            limits[:, : told.shape[1]] = told[:, :p]
    return limits


def _deviations(claimed: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.diagonal(claimed, axis1=1, axis2=2))
