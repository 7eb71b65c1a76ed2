"""One estimator on one record: the estimates over time, and the file they are saved in."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.results import OutputError, writing
from flexaxis.experiments.specs import Spec, build
from flexaxis.experiments.theta import true_theta
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
CHUNK = 4000  # samples between two reports of progress


@dataclass(frozen=True)
class Estimate:
    """Estimates over time.

    Attributes
    ----------
    names : tuple of str
        Estimated parameters.
    time : ndarray (N,)
        Sample times [s].
    theta : ndarray (N, p)
        θ[k], made from y[0..k].
    covariance : ndarray (N, p, p) or None
        What the estimator claims, if it claims anything.
    estimator : str
        Text that names it, options included.
    options : dict
        Its options.
    record_hash : str
        Content hash of the record's scenario.
    truth_at_end : dict
        True values at the last sample, where the record knows them.
    """

    names: tuple[str, ...]
    time: Array
    theta: Array
    covariance: Array | None
    estimator: str
    options: dict[str, object]
    record_hash: str
    truth_at_end: dict[str, float]

    def save(self, path: Path) -> None:
        """Write NetCDF-4, at once or not at all: time, theta (time, estimate), covariance."""
        import h5netcdf

        part = path.with_name(path.name + ".part")
        with writing(path):
            with h5netcdf.File(part, "w") as file:
                file.dimensions = {"time": len(self.time), "estimate": len(self.names)}
                time = file.create_variable("time", ("time",), data=self.time)
                time.attrs["units"] = "s"
                names = np.array(self.names, dtype=object)
                file.create_variable("estimate", ("estimate",), dtype=_text(), data=names)
                file.create_variable("theta", ("time", "estimate"), data=self.theta)
                if self.covariance is not None:
                    # NetCDF wants each dimension of a variable to be another one.
                    file.dimensions["estimate_2"] = len(self.names)
                    dims = ("time", "estimate", "estimate_2")
                    file.create_variable("covariance", dims, data=self.covariance)
                file.attrs["estimator"] = self.estimator
                file.attrs["options"] = json.dumps(self.options)
                file.attrs["record_hash"] = self.record_hash
            os.replace(part, path)


def _text() -> object:
    import h5py

    return h5py.string_dtype()


def estimate(
    record: Record,
    spec: Spec,
    *,
    scenario: Scenario | None = None,
    advance: Callable[[float], None] | None = None,
) -> Estimate:
    """Run an estimator on a record.

    Parameters
    ----------
    record : Record
    spec : Spec
        The estimator, as from `flexaxis.experiments.specs.parse`.
    scenario : Scenario, optional
        What the estimator is told; the record's own by default.
    advance : callable, optional
        Called with the number of samples done since the last call.

    Raises
    ------
    EstimatorError, RecordError
        If the record has no scenario, or not the output that the estimator reads.
    """
    told = scenario or _own_scenario(record)
    estimator = build(spec, told)
    y = getattr(record, estimator.output, None)
    if y is None:
        raise EstimatorError(f"{spec.text} reads {estimator.output!r}, which the record lacks")
    claims = hasattr(estimator, "covariance")
    names = tuple(estimator.names)
    theta = np.empty((len(y), len(names)))
    covariance = np.empty((len(y), len(names), len(names))) if claims else None
    valid = np.ones(len(y), bool) if record.valid is None else record.valid
    for first in range(0, len(y), CHUNK):
        span = slice(first, min(first + CHUNK, len(y)))
        u, there = record.torque[span], valid[span]
        if covariance is None:
            theta[span] = run_estimator(estimator, u, y[span], there)
        else:
            for k in range(span.start, span.stop):
                theta[k] = estimator.step(record.torque[k], y[k] if valid[k] else None)
                covariance[k] = estimator.covariance  # type: ignore[attr-defined]
        if advance:
            advance(len(u))
    return Estimate(
        names=names,
        time=record.time,
        theta=theta,
        covariance=covariance,
        estimator=spec.text,
        options=dict(spec.options),
        record_hash=record.hash,
        truth_at_end=_truth(record, names),
    )


def _own_scenario(record: Record) -> Scenario:
    if not record.scenario:
        raise OutputError(
            "the record does not say its scenario, so nominal values and the parameters to "
            "identify are unknown: name one with --scenario"
        )
    return scenario_from(record.scenario, source="the record's scenario")


def _truth(record: Record, names: tuple[str, ...]) -> dict[str, float]:
    if record.true_parameters is None:
        return {}
    values = true_theta(names, record.true_parameters[-1]).tolist()
    return dict(zip(names, values, strict=True))
