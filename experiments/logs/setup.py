"""One model of a log: what is identified, within which bounds, and the fit of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import ROUNDS, Fitted, Problem, fit
from flexaxis.estimators.offline.trajectory import Trajectory, trajectory
from flexaxis.experiments.logs.signals import CLEAR, FIRST, Log, noise_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH = 1e3  # times and parts of its start that a parameter of the linear model may come to
LATEST = 0.01, 4  # s, and samples: delays up to the greater of them are looked for
SETTLING = 4  # steps to the state that a log begins in, where all else is known
FAR = 100.0  # times what was measured, that a state may come to
EARLIEST = -2.0  # samples, of a smooth torque


@dataclass(frozen=True)
class Setup:
    """A model for a log.

    Attributes
    ----------
    log : Log
    model : Model
        Its nominal values are the start.
    names : tuple of str
        What is identified.
    delay : float or None
        Known delay of the torque [s].
    whiten : bool
    highpass : float or None
        Corner [Hz] below which residuals do not count.
    box : mapping of str to (float, float)
        Bounds of parameters, where they are not `REACH` about the start.
    beside : mapping of str to ndarray (N,)
        What acts beside the torque in proportion to a gain of that name.
    early : float
        Samples that a held torque may act before it is logged.
    """

    log: Log
    model: Model
    names: tuple[str, ...]
    delay: float | None = None
    whiten: bool = True
    highpass: float | None = None
    box: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    beside: Mapping[str, Array] = field(default_factory=dict)
    early: float = 0.0

    @cached_property
    def begins(self) -> list[int]:
        """Where stretches begin, each with a state of its own: the log, and what follows gaps.

        Behind a high-pass nothing is seen of the states that a line leads to; and of bristles that
        are not stiff, and of an angle, nobody knows where they begin.
        """
        bends = any(isinstance(law.parameters.get("stiffness"), str) for law in self.model.laws)
        turns = any(name.startswith("angle") for name in self.model.states)
        none = self.highpass is not None or bends or turns
        return self.log.begins(0 if none else len(self.model.states), self._later)

    @property
    def _later(self) -> int:
        """Samples behind a gap in which its torque may still act."""
        latest = self.latest if self.delay is None else max(self.delay, 0.0)
        return int(np.ceil(latest / self.log.period - 1e-9)) + self.log.smooth

    @cached_property
    def ok(self) -> Flags:
        """Usable samples (N,) but for those in which the torque of a gap may act."""
        ok = self.log.ok.copy()
        for begin in self.begins[1:]:
            ok[begin - self._later : begin] = False
        return ok

    @property
    def counted(self) -> Flags:
        """Samples (N,) that count: where a stretch begins an increment has no past."""
        ok = self.ok.copy()
        ok[self.begins] = False
        return ok

    @property
    def earliest(self) -> float:
        """Least delay to look for [s]."""
        return (EARLIEST if self.log.smooth else 0.0 - self.early) * self.log.period

    @property
    def latest(self) -> float:
        """Greatest delay to look for [s]."""
        return min(max(LATEST[0], LATEST[1] * self.log.period), 0.1 * len(self.log.u))

    @property
    def start(self) -> Array:
        """The nominal values of what is identified."""
        return self.model.parametrize(self.names).theta

    def problem(self, without: Flags | None = None) -> Problem:
        """Return it as a problem, without some samples if these are held out."""
        log = self.log
        along = trajectory(
            self.model, self.names, log.u, period=log.period, output=log.output,
            smooth=log.smooth, resting=log.resting, begins=self.begins,
            beside=np.array([*self.beside.values()]).reshape(-1, len(log.u)),
        )  # fmt: skip
        held = np.zeros(along.q, bool)
        held[-2:] = self.highpass is not None, self.delay is not None  # no offset passes a filter
        for state in along.states:
            # how bristles are bent at first is forgotten once they have given, and seen by nothing
            held[state.start + len(self.model.states) : state.stop] = True
        ok = self.counted if without is None else self.counted & ~without
        return Problem(along, log.y, ok, *self._bounds(along), held, self.whiten, self.highpass)

    def _bounds(self, along: Trajectory) -> tuple[Array, Array]:
        """Return the box (q,): states stay near what was measured, on its side of zero."""
        lower, upper, log = np.full(along.q, -np.inf), np.full(along.q, np.inf), self.log
        for i, (name, start) in enumerate(zip(self.names, self.start, strict=True)):
            lawful = name in self.model.law_parameters
            usual = (0.0, np.inf) if lawful else np.sort([start / REACH, start * REACH])
            lower[i], upper[i] = self.box.get(name, usual)
        lower[-1], upper[-1] = min(self.earliest, self.delay or 0.0), self.latest
        # a start of a search may be an axis whose load is seen by nothing
        speed, angle = FAR * float(abs(log.y[log.ok]).max()), FAR * float(np.ptp(log.angle))
        most = [speed if name.startswith("speed") else angle for name in self.model.states]
        for state, speeds in zip(along.states, self._speeds(along), strict=True):
            if state.stop > state.start and len(along.begins) > 1:
                upper[state][: len(most)] = most
                lower[state][: len(most)] = np.negative(most)
            # on the wrong side of dry friction's sign a fit would stay there
            lower[state][speeds > 0] = upper[state][speeds < 0] = 0.0
        return lower, upper

    def _speeds(self, along: Trajectory) -> list[Array]:
        """Return the measured speed where it is of a state, of all stretches; 0 in noise."""
        noise, result = noise_of(self.log.y[self.log.ok]), []
        for begin, state in zip(along.begins, along.states, strict=True):
            y = self.log.y[begin : begin + FIRST]
            # of a straight line: an axis moves on from the first sample to the fifth
            speed = float(np.polyfit(np.arange(len(y)), y, 1)[1]) if len(y) > 1 else 0.0
            speeds = np.zeros(state.stop - state.start)
            if len(speeds) and abs(speed) > CLEAR * noise:
                speeds[: len(self.model.C)] = [speed * (entry == "1") for entry in self.model.C]
            result.append(speeds)
        return result

    def solve(
        self,
        start: Array | None = None,
        lag: float = 0.0,
        *,
        without: Flags | None = None,
        rounds: int = ROUNDS,
        search: bool = False,
        plain: bool = False,
    ) -> Fitted:
        """Fit it from parameters and a delay [s], or from where another fit came to; see `fit`.

        By default it starts at the nominal values.
        """
        problem, z = self.problem(without), self.start if start is None else start
        if len(z) != problem.trajectory.q:
            z = self._begun(problem, z, 0.0, lag if self.delay is None else self.delay).z
        return fit(problem, z, rounds=rounds, search=search, plain=plain)

    def begun(self, offset: float, delay: float) -> Fitted:
        """Return the fit of how a log begins, and goes on behind gaps, where all else is known."""
        problem = self.problem()
        problem.held[-2] = True
        return self._begun(problem, self.start, offset, delay)

    def _begun(self, problem: Problem, theta: Array, offset: float, delay: float) -> Fitted:
        """Return a few steps to all but parameters and delay, in white noise."""
        along, held = problem.trajectory, problem.held.copy()
        held[: len(theta)] = held[-1] = True
        rest, states = replace(problem, held=held), np.concatenate(self._speeds(along))
        z = np.r_[theta, np.zeros(along.first - len(theta)), states, offset, delay]
        return rest.descend(rest.at(z), SETTLING)[0]

    def having(self, values: Mapping[str, float]) -> Setup:
        """Return it from other nominal values."""
        nominal = dict(self.model.nominal) | dict(values)
        return replace(self, model=replace(self.model, nominal=nominal))

    def values(self, fitted: Fitted) -> dict[str, float]:
        """Return the parameters of a fit by name."""
        return dict(zip(self.names, fitted.z[: len(self.names)].tolist(), strict=True))

    def part(self, most: int) -> Setup:
        """Return it for the stretch of that many samples with the greatest torque, or all."""
        piece = self.log.part(most)
        beside = {name: values[piece] for name, values in self.beside.items()}
        return replace(self, log=self.log.cut(piece), beside=beside)
