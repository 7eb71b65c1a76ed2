"""Define and solve the fit of a model to a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import Fitted, Problem
from flexaxis.estimators.offline.trajectory import Trajectory
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.signals import CLEAR, Log, liveliest, noise_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LATEST = 0.01, 4  # maximum delay in s and in samples; the greater of the two applies
EARLIEST = -2.0  # minimum delay of a smooth torque [samples]
SETTLING = 4  # number of steps in which the initial states of stretches are fitted
FAR = 100.0  # bound of the initial states, relative to the greatest output


@dataclass(frozen=True)
class Setup:
    """A log, and a model with the options of its fit to this log.

    Attributes
    ----------
    log : Log
        Signals to which the model is fitted.
    model : Model
        Model; its nominal values are the initial values of the fit.
    names : tuple of str
        Names of the identified parameters.
    delay : float
        Delay of the torque [s]: the known value, or the initial value of the fit.
    timed : bool
        Whether the delay is known.
    box : mapping of str to (float, float)
        Bounds of parameters. Parameters without an entry have no bounds.
    beside : mapping of str to ndarray (N,)
        Additional torques, each multiplied by an identified gain of the same name.
    early : float
        Number of samples by which a held torque may act before it is logged.
    """

    log: Log
    model: Model
    names: tuple[str, ...]
    delay: float = 0.0
    timed: bool = True
    box: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    beside: Mapping[str, Array] = field(default_factory=dict)
    early: float = 0.0

    @cached_property
    def begins(self) -> list[int]:
        """Indices of the start and of gap ends at which a new initial state is estimated."""
        return self.log.begins(len(self.model.states), self._later)

    @property
    def _later(self) -> int:
        """Number of samples after a gap in which the unknown torque of the gap may still act."""
        latest = max(self.delay, 0.0) if self.timed else self.latest
        return int(np.ceil(latest / self.log.period - 1e-9)) + self.log.smooth

    @cached_property
    def ok(self) -> Flags:
        """Flags (N,) of the samples that are fitted.

        The first sample of each stretch is excluded. Samples in which the unknown torque of a gap
        still acts are also excluded.
        """
        ok = self.log.ok.copy()
        for begin in self.begins[1:]:
            ok[begin - self._later : begin] = False
        ok[self.begins] = False
        return ok

    @property
    def earliest(self) -> float:
        """Minimum delay that is tried [s]."""
        return (EARLIEST if self.log.smooth else 0.0 - self.early) * self.log.period

    @property
    def latest(self) -> float:
        """Maximum delay that is tried [s]."""
        return max(LATEST[0], LATEST[1] * self.log.period)

    @property
    def start(self) -> Array:
        """The nominal values of the identified parameters."""
        return self.model.parametrize(self.names).theta

    def problem(self, without: Flags | None = None) -> Problem:
        """Return the least-squares problem of the fit, without the samples flagged in `without`."""
        log, begins = self.log, tuple(self.begins)
        model = SIGNALS[log.output].predicted(self.model, log.period).parametrize(self.names)
        beside = np.array([*self.beside.values()]).reshape(-1, len(log.u))
        along = Trajectory(model, log.u, log.period, log.smooth, begins, beside)
        held = np.zeros(along.q, bool)
        held[-1] = self.timed
        for state in along.states:  # initial states of laws are unknown, and have no lasting effect
            held[state.start + len(self.model.states) : state.stop] = True
        if log.resting:
            held[along.states[0]] = True
        ok = self.ok if without is None else self.ok & ~without
        return Problem(along, log.y, ok, *self._bounds(along), held)

    def _bounds(self, along: Trajectory) -> tuple[Array, Array]:
        """Return the lower and upper bounds (q,) of the unknowns."""
        far = FAR * float(abs(self.log.y[self.log.ok]).max())
        upper = np.full(along.q, np.inf)
        upper[along.first : -2] = far
        lower = -upper
        for i, name in enumerate(self.names):
            lower[i], upper[i] = self.box.get(name, (-np.inf, np.inf))
        lower[-1], upper[-1] = min(self.earliest, self.delay), self.latest
        # dry friction depends on the sign of the speed; a fit could not change a wrong sign
        states, first = slice(along.first, -2), self._first(along)
        lower[states][first > 0] = upper[states][first < 0] = 0.0
        return lower, upper

    def _first(self, along: Trajectory) -> Array:
        """Return a guess of the initial states of all stretches.

        The motor speed starts at the measured speed, or at 0 if the measured speed is only noise.
        All other states, and all states of a log that begins at rest, start at 0.
        """
        log, first = self.log, np.zeros((len(along.begins), len(along.free)))
        noise = noise_of(log.y[log.ok])
        for row, begin in zip(first, along.begins, strict=True):
            speed = log.y[begin + 1] if abs(log.y[begin + 1]) > CLEAR * noise else 0.0
            row[: len(self.model.C)] = [speed * (entry == "1") for entry in self.model.C]
        first[0] *= not log.resting
        return first.ravel()

    def solve(
        self, z: Array | None = None, *, without: Flags | None = None, **options: Any
    ) -> Fitted:
        """Fit the model, starting at the unknowns `z`, by default at the nominal values.

        The samples flagged in `without` are not fitted. The `options` are those of `Problem.fit`.
        """
        problem = self.problem(without)
        return problem.fit(self.begun(problem).z if z is None else z, **options)

    def begun(self, problem: Problem, offset: float = 0.0) -> Fitted:
        """Fit all unknowns except the parameters and the delay, assuming white noise."""
        along, held = problem.trajectory, problem.held.copy()
        held[: along.p] = held[-1] = True
        rest, gains = replace(problem, held=held), np.zeros(len(self.beside))
        z = np.r_[self.start, gains, self._first(along), offset, self.delay]
        return rest.descend(rest.at(z, np.ones(1)), SETTLING)[0]

    def having(self, values: Mapping[str, float]) -> Setup:
        """Return a copy of the setup with other nominal values of the identified parameters."""
        new = {name: value for name, value in values.items() if name in self.names}
        nominal = dict(self.model.nominal) | new
        return replace(self, model=replace(self.model, nominal=nominal))

    def part(self, most: int) -> Setup:
        """Return the setup for the part of at most `most` samples with the greatest torque."""
        log = self.log
        piece = liveliest(np.where(log.ok, log.u, 0.0), most)
        sides = {name: getattr(log, name)[piece] for name in ("u", "y", "ok", "angle")}
        log = replace(log, **sides, resting=log.resting and piece.start == 0)
        beside = {name: values[piece] for name, values in self.beside.items()}
        return replace(self, log=log, beside=beside)
