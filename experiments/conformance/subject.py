"""What a rule looks at: an estimator under test, fresh each time, and a record."""

from __future__ import annotations

import time
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.scoring.parameter_names import known_names, nominal_theta, theta_over_time
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

BEFORE_FAULT = slice(1000, 2000)


class Subject:
    """An estimator under test, and the record that it is tested on."""

    def __init__(
        self, spec: Spec, scenario: Scenario, record: Record, store: RecordCache | None = None
    ) -> None:
        self.spec, self.scenario, self.store = spec, scenario, store
        self.u = record.torque
        self.y: Array = getattr(record, scenario.output)
        self.names = tuple(self.make().names)
        known = known_names(scenario, self.names)
        self.known = [self.names.index(name) for name in known]
        self.truth = theta_over_time(scenario, known)

    def make(self) -> Estimator:
        """Return a fresh estimator."""
        return build(self.spec, self.scenario)

    def run(self, u: Array | None = None, y: Array | None = None) -> Array:
        """Return the estimates (N, p) of a fresh estimator; its inputs are copies."""
        u, y = (self.u if u is None else u), (self.y if y is None else y)
        return run_estimator(self.make(), u.copy(), y.copy())

    @cached_property
    def theta(self) -> Array:
        """Estimates on the record as it is."""
        return self.run()

    @cached_property
    def nominal(self) -> Array:
        """Sizes (p,) of the parameters; what has no truth has that of its largest estimate."""
        sizes = np.abs(self.theta).max(axis=0)
        sizes[~(np.isfinite(sizes) & (sizes > 0))] = 1.0
        names = [self.names[i] for i in self.known]
        sizes[self.known] = np.abs(nominal_theta(self.scenario, names))
        return sizes

    @cached_property
    def stepped(self) -> tuple[Array, float]:
        """Estimates step by step, and the time of a step [s]."""
        estimator = self.make()
        step(estimator, self.u[:2], self.y[:2])  # what is compiled, is compiled now
        estimator = self.make()
        start = time.perf_counter()
        theta = step(estimator, self.u, self.y)
        return theta, (time.perf_counter() - start) / len(self.u)

    def gaps(self, one: Array, other: Array) -> Array:
        """Return the differences (N, p) of two runs, as shares of nominal."""
        with np.errstate(invalid="ignore", over="ignore"):
            gap = np.abs(one - other) / self.nominal
        same = (one == other) | (np.isnan(one) & np.isnan(other))  # `finite` judges what is not
        return np.where(same, 0.0, gap)

    def apart(self, one: Array, other: Array) -> float:
        """Return the largest difference of two runs, as a share of nominal."""
        return float(np.max(self.gaps(one, other), initial=0.0))

    def error(self, theta: Array) -> float:
        """Return the rms error before the fault, as a share of nominal, over all parameters.

        Those without a truth, as of a friction that is not there, have no part in it.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            errors = (theta[:, self.known] - self.truth) / self.nominal[self.known]
            found = np.sqrt(np.mean(errors[BEFORE_FAULT] ** 2))
        return float(found) if np.isfinite(found) else np.inf


def step(estimator: Estimator, u: Array, y: Array, gap: slice = slice(0)) -> Array:
    """Return the estimates (N, p) step by step, without y in the gap."""
    values: list[float | None] = [float(value) for value in y]
    values[gap] = [None] * len(values[gap])
    return np.array(
        [np.array(estimator.step(float(a), b), float) for a, b in zip(u, values, strict=True)]
    )
