"""What is measured of an estimator in one run on an axis with friction, findings included."""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import gettempdir

import numpy as np

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.catalogue.find import find_scenario, scenario_names
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.case import warm
from flexaxis.experiments.scoring.case import Track, lag_of, rms, t10_of
from flexaxis.experiments.scoring.limits import lag_bound_with_structure
from flexaxis.experiments.scoring.theory import limits_of
from flexaxis.experiments.scoring.theta import known_names, physical
from flexaxis.experiments.scoring.windows import Window, windows
from flexaxis.sim.events import Event
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

TIMELY = 0.5  # s between fault and stated onset: half of what the reference remembers
LATER = 1.0  # s after the alarm at which a change is named again


@dataclass(frozen=True)
class Found:
    """
    The finding that met a fault.

    Attributes
    ----------
    delay : float
        From the fault to the alarm [s].
    named, renamed : tuple of str
        Physical parameters that it named at the alarm, and `LATER`.
    covered : bool or None
        Whether the interval of its size, as stated `LATER`, holds the truth; None where it states
        none, or names something else.
    """

    delay: float
    named: tuple[str, ...]
    renamed: tuple[str, ...]
    covered: bool | None


@dataclass(frozen=True)
class Judged:
    """
    One estimator on one record.

    Attributes
    ----------
    bias, std : dict of str to float
        Before the fault [% of nominal]: mean, and root mean square about zero.
    lag, t10 : float or None
        Of the parameter that changed [s].
    bounds : dict of str to float
        Lags on the bound [s], by what is unknown: "one" parameter alone, what is "tracked" (of
        which f_c is one), and the "structure" besides; empty where there is no bound.
    faults : tuple of str
        Physical parameters that changed.
    found : tuple of Found or None
        One for each of them; None where it was missed.
    alarms, false : int
        All findings, and those outside the windows of faults.
    calm : float
        Time outside them [s].
    cost : float
        [µs a sample].
    lost : bool
    """

    bias: dict[str, float]
    std: dict[str, float]
    lag: float | None
    t10: float | None
    bounds: dict[str, float]
    faults: tuple[str, ...]
    found: tuple[Found | None, ...]
    alarms: int
    false: int
    calm: float
    cost: float
    lost: bool


def in_catalogue(names: Iterable[str]) -> list[str]:
    """The scenarios among these that the catalogue has; the others are told of."""
    names, there = list(names), scenario_names()
    if missing := [name for name in names if name not in there]:
        print(f"not in the catalogue: {', '.join(missing)}")
    return [name for name in names if name in there]


@cache
def drawn(name: str, first: int, last: int) -> tuple[Scenario, list[Record]]:
    """A scenario and its records of some seeds, kept in a folder from one call to the next."""
    scenario = find_scenario(name)
    folder = os.environ.get("FLEXAXIS_CACHE") or Path(gettempdir()) / "flexaxis_acceptance"
    return scenario, records(scenario, range(first, last), RecordCache(Path(folder)))[0]


def judged(name: str, spec: str, first: int, last: int) -> list[Judged]:
    """Every run of an estimator on a scenario, seeds ``first`` to ``last`` − 1."""
    scenario, runs = drawn(name, first, last)
    warm(parse(spec), scenario)
    return [judge(Run(spec, scenario, record)) for record in runs]


@dataclass(frozen=True)
class Run:
    """An estimator, as typed, and the record that it is to run on."""

    spec: str
    scenario: Scenario
    record: Record

    def estimator(self):
        return build(parse(self.spec), self.scenario)

    def on(self, estimator, span: slice) -> np.ndarray:
        """Estimates of a piece of the record, from where the estimator is."""
        record = self.record
        valid = None if record.valid is None else record.valid[span]
        y = getattr(record, self.scenario.output)[span]
        return run_estimator(estimator, record.torque[span], y, valid)


def judge(run: Run) -> Judged:
    """One estimator on one record, with its findings as they stood at the alarm and later."""
    scenario, estimator = run.scenario, run.estimator()
    start = time.perf_counter()
    theta = run.on(estimator, slice(None))
    cost = 1e6 * (time.perf_counter() - start) / len(theta)
    findings = tuple(getattr(estimator, "findings", ()))
    track = track_of(run, tuple(estimator.names), theta)
    spans = windows(scenario, scenario.identify)
    events = [event for event in scenario.events() if any(met(event, span) for span in spans)]
    calm = np.ones(len(theta), bool)
    for span in spans:
        calm[span.start : span.stop] = False
    moved = [i for i in range(len(track.names)) if track.mine(i)]
    of = {physical(n)[0]: i for i, n in enumerate(track.names)}
    return Judged(
        bias={p: float(track.percent[track.quiet, i].mean()) for p, i in of.items()},
        std={p: float(rms(track.percent[track.quiet, i])) for p, i in of.items()},
        lag=lag_of(track, moved[0]) if moved else None,
        t10=t10_of(track, moved[0]) if moved else None,
        bounds=lag_bounds(track, moved[0]) if moved else {},
        faults=tuple(event.parameter for event in events),
        found=tuple(
            meeting(run, findings, event, span)
            for event in events
            for span in spans
            if met(event, span)
        ),
        alarms=len(findings),
        false=sum(bool(calm[finding.alarm]) for finding in findings),
        calm=float(calm.sum()) * scenario.period,
        cost=cost,
        lost=track.lost is not None,
    )


def lag_bounds(track: Track, i: int) -> dict[str, float]:
    """What theory allows: lags on the bound [s], by what is unknown."""
    allowed, scenario, name = limits_of(track, i), track.scenario, track.names[i]
    if allowed.lag_bound is None:
        return {}
    found = {
        "one": allowed.lag_bound_single,
        "tracked": allowed.lag_bound,
        "structure": lag_bound_with_structure(scenario, name, track.torque),
    }
    return {known: lag for known, lag in found.items() if lag is not None}


def met(event: Event, span: Window) -> bool:
    return event.parameter == span.parameter and span.start <= event.index < span.stop


def track_of(run: Run, names: tuple[str, ...], theta: np.ndarray) -> Track:
    """The estimates of those parameters of which the truth is known."""
    known = known_names(run.scenario, names)
    return Track(
        scenario=run.scenario,
        names=known,
        theta=theta[:, [names.index(name) for name in known]],
        true_parameters=run.record.true_parameters,
        torque=run.record.torque,
    )


def meeting(run: Run, findings: Sequence, event: Event, span: Window) -> Found | None:
    """The first finding in the window that is right about the time, named as it was then."""
    period = run.scenario.period
    near = TIMELY / period
    mine = [
        f
        for f in findings
        if span.start <= f.alarm < span.stop and abs(onset(f) - event.index) <= near
    ]
    if not mine:
        return None
    alarm = mine[0].alarm
    first, later = map(said, states(run, alarm, ages=(0, round(LATER / period))))
    return Found(
        delay=period * (alarm - event.index),
        named=first[0],
        renamed=later[0],
        covered=covers(later[1], event),
    )


def onset(finding) -> int:
    """When it says that the change was; the alarm for one that does not say."""
    return getattr(finding, "onset", finding.alarm)


def states(run: Run, alarm: int, ages: Sequence[int]) -> Iterator:
    """The finding of an alarm as it stood so many samples after it, by a run that ends there."""
    estimator, done = run.estimator(), 0
    for age in ages:
        stop = min(alarm + 1 + age, run.scenario.samples)
        run.on(estimator, slice(done, stop))
        done = stop
        yield next((f for f in estimator.findings if f.alarm == alarm), None)


def said(finding) -> tuple[tuple[str, ...], dict[str, tuple[float, float]]]:
    """What a finding names, as physical parameters, and the interval of each ratio."""
    if finding is None:  # taken back, or not causal: then it named nothing at that time
        return (), {}
    names = [physical(name) for name in finding.parameters]
    intervals = getattr(finding, "interval", None) or ()
    ratios = {
        name: tuple(sorted(end**exponent for end in ends))
        for (name, exponent), ends in zip(names, intervals, strict=False)
    }
    return tuple(name for name, _ in names), ratios


def covers(intervals: dict[str, tuple[float, float]], event: Event) -> bool | None:
    if list(intervals) != [event.parameter]:
        return None
    low, high = intervals[event.parameter]
    return bool(low <= event.after / event.before <= high)
