"""Estimators of users that take all records of a task at once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import numbers_of
from flexaxis.experiments.building.guest import hosted
from flexaxis.experiments.building.specs import Spec, build
from flexaxis.experiments.running.case import Ran, account, tell_not_finite
from flexaxis.experiments.scoring.spending import spent
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario


def has_batch(spec: Spec, scenario: Scenario) -> bool:
    """Whether an estimator takes all records of a task at once.

    A batch gives estimates alone. One that claims or finds something is run record by record, so
    that these are scored too.

    Raises
    ------
    EstimatorError
        If the estimator cannot be built.
    """
    if not hasattr(spec.make, "run_batch"):
        return False
    estimator = build(spec, scenario)
    return not any(hasattr(estimator, name) for name in ("findings", "covariance", "innovations"))


def run_batch(scenario: Scenario, records: Sequence[Record], spec: Spec) -> list[Ran]:
    """Run an estimator that takes R records at once, by its ``run_batch(u, y)``.

    Parameters
    ----------
    scenario : Scenario
    records : sequence of Record
        Of one scenario, without gaps.
    spec : Spec

    Returns
    -------
    list of R Ran
        Estimates alone; the time of each is its share.

    Raises
    ------
    EstimatorError
        If the estimator raises, or returns another shape.
    """
    estimator: Any = build(spec, scenario)
    u = np.stack([record.torque for record in records])
    y = np.stack([getattr(record, scenario.output) for record in records])
    where = f"on {len(records)} records of {scenario.name}"
    start = time.perf_counter()
    with hosted(spec.text, where), spent(account(spec)):
        theta = numbers_of(estimator.run_batch(u, y), estimator.run_batch)
    seconds = (time.perf_counter() - start) / len(records)
    wanted = (*u.shape, len(estimator.names))
    if theta.shape != wanted:
        raise EstimatorError(
            f"{spec.text}: run_batch returned the shape {theta.shape} {where}; {wanted} is needed"
        )
    for record, own in zip(records, theta, strict=True):
        tell_not_finite(spec.text, own, f"{scenario.name}, seed {record.seed}")
    return [Ran(own, seconds, tuple(estimator.names)) for own in theta]
