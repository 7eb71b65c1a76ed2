"""Any estimator on a record of a real axis: estimates over time, residuals, alarms, load angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.offline.delay import delayed
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.specs import Spec, made
from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.experiments.logs.changes import Change, find_changes
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identify import settled
from flexaxis.experiments.running.estimate import estimates_file, run_on
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Load:
    """Load angle from motor angle and model, and the hidden encoder it is compared with.

    Attributes
    ----------
    predicted, measured : ndarray (N,)
        [rad].
    fit : float
        100 (1 − |measured − predicted|/|measured − mean|).
    """

    predicted: Array
    measured: Array
    fit: float


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
        Of the output simulated at the last estimate, as for `Identification`.
    residual : ndarray (N,)
        Whitened residual at the last estimate.
    correlation : float
        Largest correlation of the residual with its own past, 1 to 20 samples back.
    white : bool
        Whether that is below 0.1.
    alarms : ndarray (M,)
        Times [s] at which the estimator raised its own alarm, if it has one.
    changes : list of Change
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
    load: Load | None

    @property
    def last(self) -> Array:
        """Median (p,) of the last fifth of the estimates: what they came to."""
        return np.median(self.theta[-max(len(self.theta) // 5, 1) :], axis=0)


def save(found: Tracked, path: Path, *, estimator: str) -> None:
    """Write the estimates as NetCDF-4, with the deviations if it claims any.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    sure = found.deviations
    claimed: Literal["deviation"] | None = None if sure is None else "deviation"
    with estimates_file(path, found.names, len(found.time), claimed=claimed) as file:
        file["time"][:], file["theta"][:] = found.time, found.theta
        if claimed:
            file["deviation"][:] = sure
        file.attrs["estimator"] = estimator


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
        From `flexaxis.experiments.building.specs.parse`.
    identify : sequence of str
        What to estimate.
    start : float
        θ(0) over nominal.

    Raises
    ------
    LogError, EstimatorError
        If a name is unknown, or the estimator cannot be built or run.
    """
    output, period, ok = output_of(record), record.period, usable(record)
    nominal = axis.model.parametrize(identify).theta  # refuses unknown names
    torque = delayed(record.torque, axis.delay / period, smooth=is_smooth(record))
    u, y = (lfilter(axis.whitening, 1.0, x) for x in (torque, getattr(record, output)))
    there = np.ones(len(u), bool) if record.valid is None else record.valid
    valid = settled(there, len(axis.whitening))
    estimator = _build(spec, axis, identify, start, period=period, output=output, torque=u)
    filtered = replace(record, torque=u, valid=valid, **{output: y})
    theta, claimed, alarms = run_on(estimator, filtered)
    model = increment(axis.model, period) if output == "increment" else axis.model
    good = settled(ok, len(axis.whitening))
    last = np.median(theta[-max(len(theta) // 5, 1) :], axis=0)
    if not np.isfinite(last).all():
        raise LogError("the estimates diverged: identify first, or choose another estimator")
    simulated, _ = predict(model.parametrize(identify), last, torque, period=period)
    white, psi = predict(model.parametrize(identify), last, u, period=period)
    measured = getattr(record, output)
    changes = find_changes(record.time[good], (y - white)[good], psi[good], last, tuple(identify))
    correlation = _correlation((y - white)[good])
    return Tracked(
        names=tuple(estimator.names),
        time=record.time,
        theta=theta,
        deviations=None if claimed is None else _deviations(claimed),
        nominal=nominal,
        usable=good,
        fit=100 * float(1 - np.std((measured - simulated)[ok]) / np.std(measured[ok])),
        residual=y - white,
        correlation=correlation,
        white=abs(correlation) < 0.1,
        alarms=record.time[alarms],
        changes=changes,
        load=_load(record, axis, dict(zip(identify, last.tolist(), strict=True))),
    )


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
    if axis.noise is not None:
        offered["noise"] = axis.noise
    shipped = spec.make in [entry.factory for entry in REGISTRY.values()]
    first = replace(axis.model, nominal=values) if shipped else values
    estimator = made(spec, first, period, offered)
    if estimator.output != output or tuple(estimator.names) != tuple(identify):
        raise EstimatorError(
            f"{spec.text} estimates {', '.join(estimator.names)} from {estimator.output!r}; asked "
            f"were {', '.join(identify)} from {output!r}"
        )
    return estimator


def _deviations(claimed: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.diagonal(claimed, axis1=1, axis2=2))


def _correlation(residual: Array) -> float:
    e = residual - residual.mean()
    past = np.array([e[k:] @ e[: len(e) - k] for k in range(1, 21)]) / (e @ e)
    return float(past[np.argmax(abs(past))])


def load_side(model: Model) -> Model | None:
    """Return the rest of a model when its motor speed is given: from motor speed to load speed.

    Row and column of the motor are taken out; what it did to the others becomes the input. None
    if there are no states ``speed_motor`` and ``speed_load`` or ``speed_arm``.
    """
    states = list(model.states)
    load = next((name for name in ("speed_load", "speed_arm") if name in states), None)
    if load is None or "speed_motor" not in states:
        return None
    motor = states.index("speed_motor")
    rest = [i for i in range(len(states)) if i != motor]
    return Model(
        name=f"{model.name}, load side",
        states=[states[i] for i in rest],
        A=[[model.A[i][j] for j in rest] for i in rest],
        B=[model.A[i][motor] for i in rest],
        C=["1" if states[i] == load else "0" for i in rest],
        nominal=model.nominal,
    )


def _load(record: Record, axis: Axis, estimates: dict[str, float]) -> Load | None:
    """Predict the load angle from the measured motor angle by the estimated model."""
    side = load_side(axis.model)
    if side is None or record.true_angle_a is None or record.increment is None:
        return None
    physical = {
        name.removeprefix("1/"): 1 / value if name.startswith("1/") else value
        for name, value in estimates.items()
    }
    side = replace(side, nominal=dict(axis.model.nominal) | physical)
    chosen = increment(side, record.period).parametrize(side.parameters[:1])
    # the increment up to t_{k+1} is the mean motor speed over the sample from t_k on
    moved = np.append(record.increment[1:], record.increment[-1])
    speed, _ = predict(chosen, chosen.theta, moved, period=record.period)
    predicted, ok = np.cumsum(speed) * record.period, usable(record)
    predicted += np.mean((record.true_angle_a - predicted)[ok])
    error = (record.true_angle_a - predicted)[ok]
    fit = 100 * float(1 - np.std(error) / np.std(record.true_angle_a[ok]))
    return Load(predicted, record.true_angle_a, fit)
