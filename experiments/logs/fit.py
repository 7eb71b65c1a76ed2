"""Fit a model to a log, and compute the simulation error and the uncertainty of the estimates.

A candidate model is fitted without the held-out pieces of the log. The simulation error in the
held-out pieces shows whether the model is adequate, and which of two models is better.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import Fitted, Problem, jackknife, pieces
from flexaxis.estimators.offline.trajectory import Trajectory
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.signals import (
    CLEAR,
    Array,
    Flags,
    Log,
    gaps_of,
    liveliest,
    noise_of,
)

HELD_OUT = (2, 5, 8)  # indices of the held-out pieces among ten pieces of a record
PARTS = 10  # number of parts of a held-out piece in which errors are compared
AGAIN = 0.2  # fraction of a stretch after a gap that is fitted to determine the initial state
BEYOND_CHANCE = 2.0  # minimum difference of errors, in standard deviations
LEAST_GAIN = 0.01  # minimum relative decrease of the simulation error that is relevant
RIGHT = 1.1  # maximum ratio of simulation error to noise for an adequate model
NOTHING = 1e-3  # largest simulation error that is negligible, as a fraction of the motion
EXACT = 1e-9  # relative error of the arithmetic, and of the printed digits of a log
STEPS = 1e-3  # relative error of a friction law that is solved in steps (0.24 % at 50 Hz)
SEARCHING: Mapping[str, Any] = {"most": 12, "near": 0.5}  # options of a fit with low accuracy
LATEST = 0.01, 4  # maximum delay in s and in samples; the greater of the two applies
EARLIEST = -2.0  # minimum delay of a smooth torque [samples]
SETTLING = 4  # number of steps in which the initial states of stretches are fitted
UNKNOWN, ROOM = 30, 2e7  # maximum number of unknown states after gaps, and of their derivatives


@dataclass(frozen=True)
class Setup:
    """A log, a model of the axis, and the options for fitting the model to the log.

    Attributes
    ----------
    log : Log
        Signals to which the model is fitted.
    model : Model
        Model of the axis. The nominal values of the model are the initial values of the fit.
    names : tuple of str
        Names of the parameters that the fit estimates.
    delay : float
        Delay of the torque [s]: the known value, or the initial value of the fit.
    timed : bool
        Whether the torque delay is known.
    box : mapping of str to (float, float)
        Lower and upper bounds of parameters. Parameters without an entry have no bounds.
    beside : mapping of str to ndarray (N,)
        Additional torques. The fit estimates a gain for each additional torque.
    early : float
        Maximum time by which a held torque may act before it is logged [samples].
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
        """Indices of the samples at which segments with an unknown initial state begin.

        Segments begin at the start of the log and after the longest gaps. The torque in a gap is
        unknown, so the state after the gap is also unknown. In shorter gaps, the torque is
        interpolated linearly.
        """
        ok, N = self.log.ok, len(self.log.ok)
        # if the log does not begin at rest, the first stretch begins at the first usable sample
        first = 0 if self.log.resting else int(np.argmax(ok))
        gaps = [(begin, end) for begin, end in gaps_of(ok).tolist() if begin and end < N]
        most = int(min(UNKNOWN, ROOM // N)) // len(self.model.states)
        longest = sorted(gaps, key=lambda gap: gap[0] - gap[1])[:most]
        ends = sorted(end + self._later for _, end in longest)
        return [first, *(end for end in ends if end < N)]

    @property
    def _later(self) -> int:
        """Number of samples after a gap that the unknown torque in the gap may still affect."""
        latest = max(self.delay, 0.0) if self.timed else self.latest
        return int(np.ceil(latest / self.log.period - 1e-9)) + self.log.smooth

    @cached_property
    def ok(self) -> Flags:
        """Mask (N,) of the samples that are fitted.

        The first sample of each segment is excluded. Because of the torque delay, the unknown
        torque in a gap still acts on some samples after the gap. These samples are also excluded.
        """
        ok = self.log.ok.copy()
        for begin in self.begins[1:]:
            ok[begin - self._later : begin] = False
        ok[self.begins] = False
        return ok

    @property
    def earliest(self) -> float:
        """Minimum torque delay in the search [s]."""
        return (EARLIEST if self.log.smooth else 0.0 - self.early) * self.log.period

    @property
    def latest(self) -> float:
        """Maximum torque delay in the search [s]."""
        return max(LATEST[0], LATEST[1] * self.log.period)

    def problem(self, without: Flags | None = None) -> Problem:
        """Return the least-squares problem of the fit without the samples marked in `without`."""
        log, begins, n = self.log, tuple(self.begins), len(self.model.states)
        model = SIGNALS[log.output].predicted(self.model, log.period).parametrize(self.names)
        beside = np.array([*self.beside.values()]).reshape(-1, len(log.u))
        along = Trajectory(model, log.u, log.period, log.smooth, begins, beside)
        held = np.zeros(along.q, bool)
        held[-1] = self.timed
        for state in along.states:  # initial states of laws are unknown, and have no lasting effect
            held[state.start + n : state.stop] = True
        if log.resting:
            held[along.states[0]] = True
        states, first, upper = slice(along.first, -2), self._first(along), np.full(along.q, np.inf)
        lower = -upper
        for i, name in enumerate(self.names):
            lower[i], upper[i] = self.box.get(name, (-np.inf, np.inf))
        # dry friction depends on the sign of the speed; a fit could not change a wrong sign
        lower[states], upper[states] = (
            np.where(first > 0, 0, -np.inf),
            np.where(first < 0, 0, np.inf),
        )
        lower[-1], upper[-1] = min(self.earliest, self.delay), self.latest
        ok = self.ok if without is None else self.ok & ~without
        return Problem(along, log.y, ok, lower, upper, held)

    def _first(self, along: Trajectory) -> Array:
        """Return a guess of the initial states of all segments.

        The motor speed starts at the measured speed, or at 0 if the measured speed is only noise.
        All other states start at 0. If the log begins at rest, all states start at 0.
        """
        log, moved = self.log, np.zeros(len(along.free))
        moved[: len(self.model.C)] = [entry == "1" for entry in self.model.C]
        speed = log.y[np.add(along.begins, 1)]
        clear = abs(speed) > CLEAR * noise_of(log.y[log.ok])
        clear[0] &= not log.resting
        return np.outer(speed * clear, moved).ravel()

    def solve(
        self, z: Array | None = None, *, without: Flags | None = None, **options: Any
    ) -> Fitted:
        """Fit the model, starting at the values `z` of the unknowns.

        If `z` is None, the fit starts at the nominal values. The samples marked in `without` are
        not fitted. The `options` are passed to `Problem.fit`.
        """
        problem = self.problem(without)
        return problem.fit(self.begun(problem).z if z is None else z, **options)

    def begun(self, problem: Problem, offset: float = 0.0) -> Fitted:
        """Fit the initial states, gains and offset with fixed parameters, assuming white noise."""
        along, held = problem.trajectory, problem.held.copy()
        held[: along.p] = held[-1] = True
        rest, gains = replace(problem, held=held), np.zeros(len(self.beside))
        z = np.r_[along.model.theta, gains, self._first(along), offset, self.delay]
        return rest.descend(rest.at(z, np.ones(1)), SETTLING)[0]

    def having(self, values: Mapping[str, float]) -> Setup:
        """Return a copy of the setup with new nominal values for the identified parameters."""
        new = {name: value for name, value in values.items() if name in self.names}
        nominal = dict(self.model.nominal) | new
        return replace(self, model=replace(self.model, nominal=nominal))

    def part(self, most: int) -> Setup:
        """Return a setup for the stretch of at most `most` samples with the greatest torque."""
        log = self.log
        piece = liveliest(np.where(log.ok, log.u, 0.0), most)
        sides = {name: getattr(log, name)[piece] for name in ("u", "y", "ok", "angle")}
        log = replace(log, **sides, resting=log.resting and piece.start == 0)
        beside = {name: values[piece] for name, values in self.beside.items()}
        return replace(self, log=log, beside=beside)


@dataclass(frozen=True)
class Fit:
    """A fit of a model to a log, with the simulation of the log from the torque alone.

    Attributes
    ----------
    setup : Setup
        Log, and the model that is fitted to the log.
    fitted : Fitted
        Estimates of the unknowns, with the simulation error at each sample.
    """

    setup: Setup
    fitted: Fitted

    @property
    def found(self) -> Setup:
        """A copy of the setup with the estimates as nominal values."""
        z, setup = self.fitted.z.tolist(), self.setup
        values = dict(zip(setup.names, z, strict=False))
        return replace(setup.having(values), delay=z[-1])

    @property
    def simulated(self) -> Array:
        """Output (N,) of a simulation from the torque alone [rad/s]."""
        return self.setup.log.y - self.fitted.residual

    @property
    def rows(self) -> list[int]:
        """Indices of the columns of `estimates` in the vector of unknowns."""
        return [*range(self.fitted.problem.trajectory.first), -1, -2]

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """Table of the estimated parameters, gains of additional torques, delay and offset.

        The table has one column for each estimate, and the rows ``value`` and ``sd`` (standard
        deviation). If the delay is at the lower limit of the search, its ``sd`` is 0.
        """
        keys = (*self.setup.names, *self.setup.beside, "delay", "offset")
        pair = [self.fitted.z[self.rows], self.deviations[self.rows]]
        table = pd.DataFrame(pair, ["value", "sd"], keys)
        if self.found.delay <= self.setup.earliest:
            table.loc["sd", "delay"] = 0.0
        return table

    @property
    def size(self) -> float:
        """Standard deviation of the measured output [rad/s]."""
        return float(np.std(self.setup.log.y[self.setup.ok]))

    @property
    def left(self) -> float:
        """Standard deviation of the simulation error [rad/s]."""
        return float(np.std(self.fitted.residual[self.setup.ok]))

    @property
    def percent(self) -> float:
        """Fit of the simulation ŷ to the output y, 100 (1 − |y − ŷ|/|y − mean y|) [%]."""
        return 100 * (1 - self.left / max(self.size, 1e-300))

    @property
    def error(self) -> float:
        """Rms simulation error of the held-out samples [rad/s]."""
        return float(np.sqrt(np.mean(self.errors)))

    @cached_property
    def errors(self) -> Array:
        """Mean square of the simulation error in each part of the held-out samples."""
        held = self.setup.ok & ~self.fitted.problem.ok
        parts = np.array_split(self.fitted.residual[held] ** 2, len(HELD_OUT) * PARTS)
        return np.nan_to_num([np.mean(part) for part in parts], nan=np.inf, posinf=np.inf)

    @property
    def noise(self) -> float:
        """Standard deviation of the noise in the simulation error [rad/s]."""
        return max(noise_of(self.fitted.residual[self.setup.ok]), self.setup.log.rounding)

    @cached_property
    def lacks(self) -> bool:
        """Whether the model is incomplete, that is, its simulation error exceeds the noise."""
        return bool(self.error > max(RIGHT * self.noise, NOTHING * self.size))

    def better(self, other: Fit) -> bool:
        """Return whether `other` has a significantly smaller simulation error.

        The simulation error must also be smaller by at least 1 %.
        """
        with np.errstate(invalid="ignore"):  # errors of a fit that failed are infinite
            gain = self.errors - other.errors
            # errors of neighbouring samples are correlated, so the variance is computed from parts
            chance = BEYOND_CHANCE * gain.std() / np.sqrt(len(gain))
        return other.error < (1 - LEAST_GAIN) * self.error and not gain.mean() <= chance

    @cached_property
    def deviations(self) -> Array:
        """Standard deviations (q,) of the unknowns.

        A jackknife over pieces of the log measures the scatter of the estimates. If this scatter
        exceeds the scatter that white residuals would cause, the variance is increased accordingly.
        The pieces are intervals of time, of speed and of angle, because the errors of a friction
        law depend on speed and angle. The standard deviations also include the numerical errors due
        to rounding, incomplete convergence and the stepwise solution of friction laws.
        """
        fitted, log = self.fitted, self.setup.log
        white = np.diag(fitted.covariance)
        free, variance = white > 0, white.copy()
        # intervals of the measured speed would sort the samples by their noise, too
        for key in (None, abs(self.simulated), log.angle):
            scatter = jackknife(fitted.gradient[free], fitted.white, fitted.good, key)
            variance[free] += np.maximum(scatter**2 - white[free], 0.0)
        exact = np.full(len(white), EXACT)
        if fitted.problem.trajectory.in_steps:
            laws = self.setup.model.law_parameters
            exact[[i for i, name in enumerate(self.setup.names) if name in laws]] = STEPS
        off = np.maximum(abs(fitted.step()), exact * abs(fitted.z))
        return np.sqrt(variance + (off * free) ** 2)


def candidate(setup: Setup) -> Fit:
    """Fit a setup to the samples that are not held out."""
    return Fit(setup, setup.solve(without=held_out(setup), **SEARCHING))


def held_out(setup: Setup) -> Flags:
    """Return a mask (N,) of the held-out samples, which are used to test the simulation.

    The first samples after a gap are not held out, because they determine the initial state.
    """
    held = np.isin(pieces(setup.log.ok), HELD_OUT)
    for begin, end in pairwise([*setup.begins[1:], len(held)]):
        held[begin : begin + round(AGAIN * (end - begin))] = False
    return held
