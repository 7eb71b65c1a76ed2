"""One setup at a log: a model, how its torque is meant, and what its residuals leave out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.stats import median_abs_deviation

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.colour import colourless
from flexaxis.estimators.offline.descent import Problem
from flexaxis.estimators.offline.prediction_error import ROUNDS, Fitted, finished, fit
from flexaxis.estimators.offline.trajectory import course
from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH = 1e3  # times and parts of its start that a parameter of the linear model may come to
LATEST = 0.01, 4  # s, and samples: delays up to the greater of them are looked for
SETTLING = 4  # steps to the state that a log begins in, where all else is known
EARLIEST = -2.0  # samples, of a smooth torque
SIDED = 0.01  # s, over which the speed is a mean whose sign counts
RESTING = 0.05  # of the deviation of the speed, below which an axis rests
FIRST, CLEAR = 5, 3.0  # samples by which the first speed is told, and times their noise


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
    angle : ndarray (N,)
        Of the load by the gear ratio, as measured at the motor, or from where it starts.
    """

    u: Array
    y: Array
    ok: Flags
    period: float
    output: str
    smooth: bool
    resting: bool
    angle: Array

    def smoothed(self) -> Log:
        """Return the log with its torque taken as samples of a smooth one: means of a spline."""
        times = np.arange(len(self.u) + 1.0)
        integral = CubicSpline(times[:-1], self.u).antiderivative()
        means = np.append(np.diff(integral(times[:-1])), self.u[-1])
        return replace(self, u=means, smooth=True)


def log_of(record: Record, axis: Axis) -> Log:
    """Return what of a record is read, with its torque as the axis knows it to be."""
    output = output_of(record)
    y = np.asarray(getattr(record, output))
    angle = np.cumsum(y) * record.period if record.angle is None else record.angle
    angle = axis.model.nominal.get("r", 1.0) * angle
    beside = columns_beside(angle, y, record.period) if axis.beside else {}
    # but for its noise
    still = abs(float(np.mean(y[:FIRST]))) < RESTING * float(np.std(y)) + CLEAR * noise_of(y)
    log = Log(
        u=record.torque + sum(gain * beside[name] for name, gain in axis.beside.items()),
        y=y,
        ok=usable(record),
        period=record.period,
        output=output,
        smooth=is_smooth(record),
        resting=record.burn_in == 0 and still,
        angle=angle,
    )
    return log.smoothed() if axis.torque_is == "smooth" and not log.smooth else log


def columns_beside(angle: Array, speed: Array, period: float) -> dict[str, Array]:
    """Return what acts beside a torque (N,), by the name of its gain.

    −sin φ and −cos φ of gravity, φ half way to the next sample; −|v| of viscous friction that is
    greater forwards than backwards.
    """
    half = (angle + np.append(angle[1:], angle[-1])) / 2
    length = max(round(SIDED / period), 1)
    mean = np.convolve(np.append(speed[1:], speed[-1]), np.ones(length) / length, "same")
    return {"g_sin": -np.sin(half), "g_cos": -np.cos(half), "f_sided": -abs(mean)}


def noise_of(y: Array) -> float:
    """Return the standard deviation of white noise on a motion, from differences over a sample."""
    return float(median_abs_deviation(y[2:] - y[:-2], scale="normal")) / np.sqrt(2)


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
    lower, upper : mapping of str to float
        Boxes of parameters, where there are narrower ones.
    beside : mapping of str to ndarray (N,)
        What acts beside the torque in proportion to a gain of that name.
    """

    log: Log
    model: Model
    names: tuple[str, ...]
    delay: float | None = None
    whiten: bool = True
    highpass: float | None = None
    lower: Mapping[str, float] = field(default_factory=dict)
    upper: Mapping[str, float] = field(default_factory=dict)
    beside: Mapping[str, Array] = field(default_factory=dict)

    @property
    def counted(self) -> Flags:
        """Samples (N,) that count: where a log begins an increment has no past."""
        ok = self.log.ok.copy()
        ok[0 if self.log.resting else int(np.argmax(ok))] = False
        return ok

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
            beside=np.array([*self.beside.values()]).reshape(-1, len(log.u)),
        )
        lower, upper = self._box(along.q, 0 if log.resting else begin)
        held = np.zeros(along.q, bool)
        held[-2:] = self.highpass is not None, self.delay is not None  # no offset passes a filter
        # how bristles are bent at first is forgotten once they have given, and seen by nothing
        held[along.p + along.m + len(self.model.states) : -2] = True
        ok = self.counted
        if without is not None:
            ok &= ~without
        return Problem(along, log.y, ok, lower, upper, held, self.whiten, self.highpass)

    def _box(self, q: int, begin: int) -> tuple[Array, Array]:
        theta = self.model.parametrize(self.names).theta
        lower, upper = np.full(q, -np.inf), np.full(q, np.inf)
        for i, name in enumerate(self.names):
            least, most = np.sort([theta[i] / REACH, theta[i] * REACH])
            if name in self.model.law_parameters:
                least, most = 0.0, np.inf
            lower[i], upper[i] = self.lower.get(name, least), self.upper.get(name, most)
        lower[-1], upper[-1] = self.earliest, self.latest
        for i, speed in enumerate([] if self.log.resting else self._speeds(begin)):
            # on the wrong side of dry friction's sign a fit would stay there
            place = len(self.names) + len(self.beside) + i
            lower[place] = 0.0 if speed > 0 else -np.inf
            upper[place] = 0.0 if speed < 0 else np.inf
        return lower, upper

    def _speeds(self, begin: int) -> Array:
        """Return the measured speed (n,) of the state that it is of; 0 where noise hides it."""
        y = self.log.y[begin : begin + FIRST]
        noise = noise_of(self.log.y[self.log.ok])
        # of a straight line: an axis moves on from the first sample to the fifth
        speed = float(np.polyfit(np.arange(len(y)), y, 1)[1]) if len(y) > 1 else 0.0
        seen = [float(entry == "1") for entry in self.model.C]
        return np.array(seen) * (speed if abs(speed) > CLEAR * noise else 0.0)

    def first(self) -> Array | None:
        """Return the state (n,) to start from where a log begins in motion: its measured speed."""
        return None if self.log.resting else self._speeds(int(np.argmax(self.log.ok)))

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
            z = problem.start(theta, float(begin[-1]) if len(begin) > p else lag, self.first())
        return fit(problem, z, rounds=rounds, fine=fine, plain=plain)

    def at(self, z: Array, without: Flags | None = None, *, fixed: int) -> Fitted:
        """Return the fit at unknowns z (q,), of which the first stay and the others are sought."""
        problem = self.problem(without)
        colour = colourless(self.highpass, self.log.period)
        held = problem.held.copy()
        held[:fixed], held[-2:] = True, True
        rest = replace(problem, held=held)
        point, _ = rest.descend(rest.at(z, colour), colour, SETTLING)
        if not np.isfinite(point.square):
            return finished(problem, point, colour, False)
        point = problem.at(point.z, colour)
        white = problem.colour(point.residual)
        return finished(problem, problem.weighed(point, white), white)

    def having(self, values: Mapping[str, float]) -> Setup:
        """Return it from other nominal values."""
        nominal = dict(self.model.nominal) | dict(values)
        return replace(self, model=replace(self.model, nominal=nominal))

    def values(self, fitted: Fitted) -> dict[str, float]:
        """Return the parameters of a fit by name."""
        return dict(zip(self.names, fitted.z[: len(self.names)].tolist(), strict=True))

    def part(self, most: int) -> Setup:
        """Return it for the stretch of that many samples with the greatest torque, or all."""
        log = self.log
        if len(log.u) <= most:
            return self
        energy = np.cumsum(np.where(log.ok, log.u, 0.0) ** 2)
        begins = np.linspace(0, len(log.u) - most, 9).astype(int)
        begin = int(begins[np.argmax(energy[begins + most - 1] - energy[begins])])
        chosen = slice(begin, begin + most)
        sides = {name: getattr(log, name)[chosen] for name in ("u", "y", "ok", "angle")}
        beside = {name: values[chosen] for name, values in self.beside.items()}
        log = replace(log, **sides, resting=log.resting and begin == 0)
        return replace(self, log=log, beside=beside)
