"""One attempt at a log: a model, how its torque is meant, and what its residuals leave out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import ROUNDS, Fitted, Problem, fit
from flexaxis.estimators.offline.trajectory import course
from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH = 1e3  # times and parts of its start that a parameter of the linear model may come to
LATEST = 0.01, 4  # s, and samples: delays up to the greater of them are looked for
EARLIEST = -2.0  # samples, of a smooth torque


@dataclass(frozen=True)
class Log:
    """What of a record an identification reads.

    Attributes
    ----------
    u, y : ndarray (N,)
        Torque as logged, and the output.
    ok : ndarray (N,) of bool
        Usable samples.
    period : float
        [s].
    output : {"speed", "increment"}
    smooth : bool
        Whether the torque goes on changing between samples.
    resting : bool
        Whether it begins at rest.
    """

    u: Array
    y: Array
    ok: Flags
    period: float
    output: str
    smooth: bool
    resting: bool

    def part(self, most: int) -> Log:
        """Return the liveliest stretch of that many samples, or all."""
        if len(self.u) <= most:
            return self
        energy = np.cumsum(np.where(self.ok, self.u, 0.0) ** 2)
        begins = np.linspace(0, len(self.u) - most, 9).astype(int)
        begin = int(begins[np.argmax(energy[begins + most - 1] - energy[begins])])
        chosen = slice(begin, begin + most)
        return replace(
            self,
            u=self.u[chosen],
            y=self.y[chosen],
            ok=self.ok[chosen],
            resting=self.resting and begin == 0,
        )

    def smoothed(self) -> Log:
        """Return the log with its torque taken as samples of a smooth one: means of a spline."""
        times = np.arange(len(self.u) + 1.0)
        integral = CubicSpline(times[:-1], self.u).antiderivative()
        means = np.append(np.diff(integral(times[:-1])), self.u[-1])
        return replace(self, u=means, smooth=True)


def log_of(record: Record, axis: Axis) -> Log:
    """Return what of a record is read, with its torque as the axis knows it to be."""
    output = output_of(record)
    log = Log(
        u=record.torque,
        y=np.asarray(getattr(record, output)),
        ok=usable(record),
        period=record.period,
        output=output,
        smooth=is_smooth(record),
        resting=record.burn_in == 0,
    )
    return log.smoothed() if axis.torque_is == "smooth" and not log.smooth else log


@dataclass(frozen=True)
class Attempt:
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
    lower, upper : mapping of str to float
        Boxes of parameters of laws.
    """

    log: Log
    model: Model
    names: tuple[str, ...]
    delay: float | None = None
    whiten: bool = True
    highpass: float | None = None
    lower: Mapping[str, float] = field(default_factory=dict)
    upper: Mapping[str, float] = field(default_factory=dict)
    tell: Callable[[], None] = lambda: None

    @property
    def earliest(self) -> float:
        """Least delay to look for [s]: none of a torque that is held, which acts when it is set."""
        return EARLIEST * self.log.period if self.log.smooth else 0.0

    @property
    def latest(self) -> float:
        """Greatest delay to look for [s]."""
        return min(max(LATEST[0], LATEST[1] * self.log.period), 0.1 * len(self.log.u))

    def problem(self, without: Flags | None = None) -> Problem:
        """Return it as a problem, without some samples if these are held out."""
        log = self.log
        # a state that is forgotten before the first usable sample could be any
        begin = 0 if log.resting else int(np.argmax(log.ok))
        along = course(
            self.model,
            self.names,
            log.u,
            period=log.period,
            output=log.output,
            smooth=log.smooth,
            resting=log.resting,
            begin=begin,
        )
        lower, upper = self._box(along.q)
        held = np.zeros(along.q, bool)
        held[-1] = self.delay is not None
        # how bristles are bent at first is forgotten once they have given, and seen by nothing
        held[along.p + len(self.model.states) : -2] = True
        ok = log.ok.copy()
        ok[begin] = False  # an increment has no past there, and a state no consequence yet
        if without is not None:
            ok &= ~without
        return Problem(
            along, log.y, ok, lower, upper, held, self.whiten, self.highpass, tell=self.tell
        )

    def _box(self, q: int) -> tuple[Array, Array]:
        theta = self.model.parametrize(self.names).theta
        lower, upper = np.full(q, -np.inf), np.full(q, np.inf)
        for i, name in enumerate(self.names):
            if name in self.model.law_parameters:
                lower[i] = self.lower.get(name, 0.0)
                upper[i] = self.upper.get(name, np.inf)
            else:
                lower[i], upper[i] = np.sort([theta[i] / REACH, theta[i] * REACH])
        lower[-1], upper[-1] = self.earliest, self.latest
        return lower, upper

    def solve(
        self,
        start: Array | None = None,
        lag: float = 0.0,
        *,
        without: Flags | None = None,
        rounds: int = ROUNDS,
        fine: bool = True,
        plain: bool = False,
    ) -> Fitted:
        """Fit it from parameters and a delay [s], or from where another fit came to; see `fit`.

        By default it starts at the nominal values.
        """
        problem, p = self.problem(without), len(self.names)
        begin = self.model.parametrize(self.names).theta if start is None else start
        lag = float(np.clip(lag if self.delay is None else self.delay, self.earliest, self.latest))
        if len(begin) == problem.course.q:
            z = np.clip(begin, problem.lower, problem.upper)
        else:
            theta = np.clip(begin[:p], problem.lower[:p], problem.upper[:p])
            z = problem.start(theta, float(begin[-1]) if len(begin) > p else lag)
        return fit(problem, z, rounds=rounds, fine=fine, plain=plain)

    def having(self, values: Mapping[str, float]) -> Attempt:
        """Return it from other nominal values."""
        nominal = dict(self.model.nominal) | dict(values)
        return replace(self, model=replace(self.model, nominal=nominal))

    def values(self, fitted: Fitted) -> dict[str, float]:
        """Return the parameters of a fit by name."""
        return dict(zip(self.names, fitted.z[: len(self.names)].tolist(), strict=True))


def explored(attempt: Attempt, places: Sequence[tuple[Array, float]]) -> Fitted:
    """Return the best of a few rounds from each place, noise taken for white at first or not."""
    return best(
        [
            attempt.solve(*place, rounds=2, fine=False, plain=plain)
            for place in places
            for plain in ((False, True) if attempt.whiten else (False,))
        ]
    )


def best(fits: Sequence[Fitted]) -> Fitted:
    """Return the fit that predicts best."""
    return min(fits, key=lambda fitted: fitted.square)
