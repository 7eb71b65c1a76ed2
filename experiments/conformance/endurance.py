"""What may happen to an axis and its sensor in a year, each followed by a minute of good data.

`flexaxis check --long` runs an estimator through all of it: it has to stay finite, say nothing
where nothing can be learnt, and be back at the truth when the minute is over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.conformance.requirements import Rule, Seen, knows_gaps
from flexaxis.experiments.conformance.subject import Subject, step
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.scoring.parameter_names import theta_over_time
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

BEFORE = 20.0  # s of good data
PAUSE = 10.0  # s of standstill under control, in which the drive may be switched off
AFTER = 60.0  # s of good data: what "back" means
LAST = 5.0  # s at the end, over which the error is taken
BACK = 0.05  # share of nominal: the least that a user of a parameter would call wrong
STATED = ("covariance", "innovation_variance")  # what an estimator may say beside θ
TIMES = 3.0  # as wrong as without any disturbance, and no more


@dataclass(frozen=True)
class Disturbed:
    """Signals with a disturbance.

    Attributes
    ----------
    u, y : ndarray (N,)
        Torque [N m] and what the estimator reads; y is of no meaning where it is missing.
    valid : ndarray (N,) of bool
        False where y is missing.
    rest : (first, stop)
        Samples in which nothing can be learnt.
    """

    u: Array
    y: Array
    valid: NDArray[np.bool_]
    rest: tuple[int, int] = (0, 0)


class Axis:
    """Good data of a nominal axis without a fault: what the disturbances are made on."""

    def __init__(self, subject: Subject, store: RecordCache | None) -> None:
        self._subject, self._store = subject, store
        self.period = subject.scenario.period

    def samples(self, seconds: float) -> int:
        """Return the number of samples in so many seconds."""
        return round(seconds / self.period)

    @cached_property
    def moving(self) -> Disturbed:
        """Motion all along."""
        return self._signals(BEFORE + 20.0 + AFTER, [])

    @cached_property
    def pausing(self) -> Disturbed:
        """Motion with a standstill under control in it, drive on, the sensor noisy."""
        return self._signals(BEFORE + PAUSE + AFTER, [[BEFORE, BEFORE + PAUSE]])

    @cached_property
    def undisturbed(self) -> tuple[float, tuple[str, ...]]:
        """Error of a run without any disturbance, and what of `STATED` is finite after it."""
        estimator = self._subject.make()
        theta = run_estimator(estimator, self.moving.u, self.moving.y)
        return self.error(theta), tuple(name for name in STATED if _is_finite(estimator, name))

    def error(self, theta: Array) -> float:
        """Return the largest mean error over the last seconds, as a share of nominal."""
        known = self._subject.known
        last = theta[-self.samples(LAST) :, known]
        found = np.abs(last.mean(axis=0) - self._truth) / self._subject.nominal[known]
        return float(np.max(found, initial=0.0))

    @cached_property
    def _truth(self) -> Array:
        names = [self._subject.names[i] for i in self._subject.known]
        return theta_over_time(self._subject.scenario, names)[0]

    def _signals(self, seconds: float, pauses: list[list[float]]) -> Disturbed:
        changes = {"duration": seconds, "excitation.pause": pauses, "fault": []}
        scenario = self._subject.scenario.override({"name": "check-long", **changes})
        record: Record = records(scenario, [0], self._store)[0][0]
        y: Array = getattr(record, scenario.output)
        return Disturbed(record.torque, y, np.ones(len(y), bool))


def standstill(axis: Axis) -> Disturbed:
    """Hold the reference: the axis stands still under control."""
    given = axis.pausing
    rest = (axis.samples(BEFORE + 1.0), axis.samples(BEFORE + PAUSE))
    return Disturbed(given.u, given.y, given.valid, rest)


def drive_off(axis: Axis, *, seconds: float) -> Disturbed:
    """Switch the drive off at standstill: torque and speed are exactly zero."""
    given = axis.pausing
    at, nothing = axis.samples(BEFORE + PAUSE - 1.0), np.zeros(axis.samples(seconds))
    u, y = (np.insert(signal, at, nothing) for signal in (given.u, given.y))
    rest = (axis.samples(BEFORE + 1.0), at + len(nothing))
    return Disturbed(u, y, np.ones(len(u), bool), rest)


def at_rest_first(axis: Axis, *, seconds: float) -> Disturbed:
    """Leave the drive off before the axis moves for the first time."""
    given, nothing = axis.moving, np.zeros(axis.samples(seconds))
    u, y = (np.r_[nothing, signal] for signal in (given.u, given.y))
    return Disturbed(u, y, np.ones(len(u), bool), (0, len(nothing)))


def gap(axis: Axis, *, seconds: float) -> Disturbed:
    """Leave outputs out while the axis goes on."""
    given = axis.moving
    valid, span = given.valid.copy(), _span(axis, seconds)
    valid[span] = False
    return Disturbed(given.u, np.where(valid, given.y, 0.0), valid, (span.start, span.stop))


def outlier(axis: Axis, *, times: float) -> Disturbed:
    """Make one output nonsense, so many times as large as outputs usually are."""
    given = axis.moving
    y = given.y.copy()
    y[axis.samples(BEFORE)] = times * y.std()
    return Disturbed(given.u, y, given.valid)


def sensor_fails(axis: Axis, *, how: Callable[[Array], Array | float]) -> Disturbed:
    """Let the sensor read something else for 20 s, while the axis goes on."""
    given = axis.moving
    y, span = given.y.copy(), _span(axis, 20.0)
    y[span] = how(y[span])
    return Disturbed(given.u, y, given.valid)


def in_mid_motion(axis: Axis) -> Disturbed:
    """Start the estimator while the axis moves."""
    given, first = axis.moving, axis.samples(7.3)
    return Disturbed(given.u[first:], given.y[first:], given.valid[first:])


def _span(axis: Axis, seconds: float) -> slice:
    return slice(axis.samples(BEFORE), axis.samples(BEFORE + seconds))


def _saturated(y: Array) -> Array:
    return np.clip(y, -0.5 * y.std(), 0.5 * y.std())


DISTURBANCES: Mapping[str, Callable[[Axis], Disturbed]] = {
    "a minute at rest first": partial(at_rest_first, seconds=60.0),
    "start in mid-motion": in_mid_motion,
    "a standstill": standstill,
    "off for 20 minutes": partial(drive_off, seconds=1200.0),
    "y missing for 20 s": partial(gap, seconds=20.0),
    "one y 1e3 times too large": partial(outlier, times=1e3),
    "one y 1e9 times too large": partial(outlier, times=1e9),
    "one y of 1e300": partial(outlier, times=1e300),
    "sensor constant for 20 s": partial(sensor_fails, how=np.std),
    "sensor stuck for 20 s": partial(sensor_fails, how=lambda y: float(y[0])),
    "sensor saturated for 20 s": partial(sensor_fails, how=_saturated),
}


def rules() -> Iterator[Rule]:
    """Yield a rule for each disturbance, over good data of the subject's axis."""
    for name in DISTURBANCES:
        yield Rule(
            name,
            "an axis runs for years: an estimator that this throws is of no use on the day after",
            "bound P and the estimates, do not forget without excitation, limit a single residual "
            "by what was predicted, and begin anew when something is not finite",
            partial(_survives, name),
        )


@lru_cache(1)
def _axis(subject: Subject) -> Axis:
    return Axis(subject, subject.store)


def _survives(name: str, subject: Subject) -> Seen:
    axis, estimator = _axis(subject), subject.make()
    given = DISTURBANCES[name](axis)
    with np.errstate(all="ignore"):  # what comes of an overflow is judged below
        theta = _estimates(estimator, given)
    wrong = np.flatnonzero(~np.isfinite(theta).all(axis=1))
    if wrong.size:
        return False, f"not finite from {wrong[0] * axis.period:.1f} s on"
    usual, stated = axis.undisturbed
    for each in stated:  # θ may stand still, and all else be lost
        if not _is_finite(estimator, each):
            return False, f"its {each} is not finite"
    first, stop = given.rest
    alarms = [f for f in getattr(estimator, "findings", ()) if first <= f.alarm < stop]
    if alarms:
        seconds = alarms[0].alarm * axis.period
        return False, f"a finding at {seconds:.1f} s, where nothing can be learnt"
    error, allowed = axis.error(theta), max(BACK, TIMES * usual)
    return error < allowed, f"{100 * error:.2g} % off a minute later ({100 * allowed:.2g} allowed)"


def _is_finite(estimator: Estimator, name: str) -> bool:
    return bool(np.isfinite(getattr(estimator, name, np.nan)).all())


def _estimates(estimator: Estimator, given: Disturbed) -> Array:
    u, y = given.u.copy(), given.y.copy()
    if given.valid.all():
        return run_estimator(estimator, u, y)
    if knows_gaps(estimator):
        return run_estimator(estimator, u, y, given.valid)
    missing = np.flatnonzero(~given.valid)
    return step(estimator, u, y, slice(int(missing[0]), int(missing[-1]) + 1))
