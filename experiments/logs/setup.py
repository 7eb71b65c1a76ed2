"""One model of a log: what is identified, within which bounds, and the fit of it."""

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
from flexaxis.experiments.logs.signals import CLEAR, Log, noise_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH = 1e3  # times its start, up or down, to the bounds of a parameter of the linear model
LATEST = 0.01, 4  # s, and samples: delays up to the greater of them are tried
EARLIEST = -2.0  # samples, of a smooth torque
SETTLING = 4  # steps to the states that stretches begin in, where parameters are known
FAR = 100.0  # times the greatest output, up to which a state may come


@dataclass(frozen=True)
class Setup:
    """A model for a log.

    Attributes
    ----------
    log : Log
    model : Model
        Its nominal values are the start.
    names : tuple of str
        Identified parameters.
    delay : float or None
        Known delay of the torque [s].
    box : mapping of str to (float, float)
        Bounds of parameters, where they are not `REACH` about the start.
    beside : mapping of str to ndarray (N,)
        Torques that act in proportion to a gain of that name.
    early : float
        Samples by which a held torque may act before it is logged.
    """

    log: Log
    model: Model
    names: tuple[str, ...]
    delay: float | None = None
    box: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    beside: Mapping[str, Array] = field(default_factory=dict)
    early: float = 0.0

    @cached_property
    def begins(self) -> list[int]:
        """Samples at which stretches begin, each with its own state: the log, and after gaps.

        Of soft bristles and of an angle nothing shows the state after a gap.
        """
        bends = any(isinstance(law.parameters.get("stiffness"), str) for law in self.model.laws)
        turns = any(name.startswith("angle") for name in self.model.states)
        return self.log.begins(0 if bends or turns else len(self.model.states), self._later)

    @property
    def _later(self) -> int:
        """Samples behind a gap in which its torque may still act."""
        latest = self.latest if self.delay is None else max(self.delay, 0.0)
        return int(np.ceil(latest / self.log.period - 1e-9)) + self.log.smooth

    @cached_property
    def ok(self) -> Flags:
        """Samples (N,) that count: neither the torque of a gap acts, nor begins a stretch."""
        ok = self.log.ok.copy()
        for begin in self.begins[1:]:
            ok[begin - self._later : begin] = False
        ok[self.begins] = False
        return ok

    @property
    def earliest(self) -> float:
        """Least delay that is tried [s]."""
        return (EARLIEST if self.log.smooth else 0.0 - self.early) * self.log.period

    @property
    def latest(self) -> float:
        """Greatest delay that is tried [s]."""
        return min(max(LATEST[0], LATEST[1] * self.log.period), 0.1 * len(self.log.u))

    @property
    def start(self) -> Array:
        """The nominal values of what is identified."""
        return self.model.parametrize(self.names).theta

    def problem(self, without: Flags | None = None) -> Problem:
        """Return it as a problem, without samples that are held out."""
        log, begins = self.log, tuple(self.begins)
        model = SIGNALS[log.output].predicted(self.model, log.period).parametrize(self.names)
        beside = np.array([*self.beside.values()]).reshape(-1, len(log.u))
        along = Trajectory(model, log.u, log.period, log.smooth, begins, beside)
        held = np.zeros(along.q, bool)
        held[-1] = self.delay is not None
        for state in along.states:  # bristles forget how they were bent, and nothing shows it
            held[state.start + len(self.model.states) : state.stop] = True
        if log.resting:
            held[along.states[0]] = True
        ok = self.ok if without is None else self.ok & ~without
        return Problem(along, log.y, ok, *self._bounds(along), held)

    def _bounds(self, along: Trajectory) -> tuple[Array, Array]:
        """Return the box (q,)."""
        far = FAR * float(abs(self.log.y[self.log.ok]).max())
        upper = np.full(along.q, np.inf)
        upper[along.first : -2] = far
        lower = -upper
        for i, (name, start) in enumerate(zip(self.names, self.start, strict=True)):
            lawful = name in self.model.law_parameters
            usual = (0.0, np.inf) if lawful else np.sort([start / REACH, start * REACH])
            lower[i], upper[i] = self.box.get(name, usual)
        lower[-1], upper[-1] = min(self.earliest, self.delay or 0.0), self.latest
        # on the wrong side of the sign of dry friction a fit would stay there
        states, first = slice(along.first, -2), self._first(along)
        lower[states][first > 0] = upper[states][first < 0] = 0.0
        return lower, upper

    def _first(self, along: Trajectory) -> Array:
        """Return the states that stretches begin in: the measured speed; 0 where it is noise."""
        log, first = self.log, np.zeros((len(along.begins), len(along.free)))
        noise = noise_of(log.y[log.ok])
        for row, begin in zip(first, along.begins, strict=True):
            speed = log.y[begin + 1] if abs(log.y[begin + 1]) > CLEAR * noise else 0.0
            row[: len(self.model.C)] = [speed * (entry == "1") for entry in self.model.C]
        first[0] *= not log.resting
        return first.ravel()

    def solve(
        self, z: Array | None = None, lag: float = 0.0, *, without: Flags | None = None,
        **options: Any,
    ) -> Fitted:  # fmt: skip
        """Fit it from parameters and a delay [s], or all unknowns; options as of `Problem.fit`.

        By default it starts at the nominal values.
        """
        problem, z = self.problem(without), self.start if z is None else z
        if len(z) != problem.trajectory.q:
            z = self._begun(problem, z, 0.0, lag if self.delay is None else self.delay).z
        return problem.fit(z, **options)

    def begun(self, offset: float, delay: float) -> Fitted:
        """Return the fit of the states that stretches begin in, where all else is known."""
        problem = self.problem()
        problem.held[-2] = True
        return self._begun(problem, self.start, offset, delay)

    def _begun(self, problem: Problem, theta: Array, offset: float, delay: float) -> Fitted:
        """Return a few steps to all but parameters and delay, in white noise."""
        along, held = problem.trajectory, problem.held.copy()
        held[: len(theta)] = held[-1] = True
        rest, gains = replace(problem, held=held), np.zeros(along.first - len(theta))
        z = np.r_[theta, gains, self._first(along), offset, delay]
        return rest.descend(rest.at(z, np.ones(1)), SETTLING)[0]

    def having(self, values: Mapping[str, float]) -> Setup:
        """Return it from other nominal values."""
        nominal = dict(self.model.nominal) | dict(values)
        return replace(self, model=replace(self.model, nominal=nominal))

    def part(self, most: int) -> Setup:
        """Return it for the stretch of that many samples with the greatest torque, or all."""
        piece = self.log.part(most)
        beside = {name: values[piece] for name, values in self.beside.items()}
        return replace(self, log=self.log.cut(piece), beside=beside)
