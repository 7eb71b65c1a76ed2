"""The demo without a screen: an axis, two estimators that race on it, and what is to be shown."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.demo.history import KEPT, History, HistoryLine, dragged
from flexaxis.experiments.demo.live_axis import NO_SAMPLES, Friction, LiveAxis, Samples
from flexaxis.experiments.demo.racer import NAMES, REPLAY, SETTLE, SHOWN, KnobSettings, Racer
from flexaxis.experiments.demo.tracking import LEAST, Jump, Point, Tracking, allowed
from flexaxis.experiments.running.estimators import Spec
from flexaxis.experiments.scoring.scores import rms
from flexaxis.experiments.scoring.windows import QUIET
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

MARK = 20
"""Samples between two points of the curves."""
SPAN = 40.0
"""Seconds that the curves show."""
DEFAULT_RACERS = ("rpem-forgetting", RECOMMENDED)
"""The paper's method, and what is recommended for a real axis."""


BUTTONS: Mapping[str, tuple[str, float]] = {
    "worn gear f_m × 2": ("f_m", 2.0),
    "payload J_a × 1.25": ("J_a", 1.25),
    "weak motor k_T × 0.9": ("k_T", 0.9),
    "soft arm k_a × 0.9": ("k_a", 0.9),
}
"""Faults that can be injected with one click: parameter, and factor on nominal."""


@dataclass(frozen=True)
class Curves:
    """The last seconds, a row every `MARK` samples; parameters in the order of `SHOWN`.

    Attributes
    ----------
    time : ndarray (M,)
        Simulated time [s].
    truth : ndarray (M, 4)
        True values.
    theta, deviation : ndarray (M, 2, 4)
        Estimates of both racers, and the standard deviations they claim; NaN where one has none.
    P : ndarray (M, 2, 3)
        The diagonals of P, of the parameters in `NAMES`.
    """

    time: Array
    truth: Array
    theta: Array
    deviation: Array
    P: Array


class DemoSession:
    """A live axis, two racing estimators, faults and knobs; no screen, no clock of its own.

    Parameters
    ----------
    estimators : sequence of str
        Two estimators, as for `--estimator`.
    seed : int
        The same seed and the same actions give the same run.

    Attributes
    ----------
    axis : LiveAxis
        Set its `noise` and `excitation` while it runs.
    racers : list of Racer
        The two.
    points : list of Point
        One for each racer and each fault that was scored.
    said : str
        What happened last, in words.
    factors : dict of str to float
        Faults that act now: parameter and factor on nominal.
    history : History
        All that was done, and what came of it.

    Raises
    ------
    EstimatorError, FlexaxisError
        If an estimator cannot race.
    """

    def __init__(self, *, estimators: Sequence[str] = DEFAULT_RACERS, seed: int = 0) -> None:
        if len(estimators) != 2:
            raise FlexaxisError(f"two estimators race, not {len(estimators)}: give two")
        self.axis = LiveAxis(seed=seed)
        self.racers = [Racer(text, self.axis.nominal) for text in estimators]
        self.points: list[Point] = []
        self.factors: dict[str, float] = {}
        self.history = History()
        self.said = "no fault: the estimates stay at the truth"
        self._began = tuple(estimators), seed
        self._nominal = self.axis.theta(NAMES)
        self._quiet = np.empty((0, len(self.racers), len(NAMES)))
        self._marks: deque[tuple[Array, ...]] = deque(maxlen=round(SPAN / PERIOD / MARK))
        self._recent = NO_SAMPLES

    def advance(self, samples: int) -> None:
        """Simulate and estimate some samples."""
        while samples > 0:
            n = min(samples, MARK - self.axis.samples % MARK)
            self._take(self.axis.advance(n))
            if self.axis.samples % MARK == 0:
                self._mark()
            samples -= n

    def prepare(self) -> None:
        """Compile what the first fault needs, before anybody waits for it."""
        axis = self.axis
        allowed(Jump(axis.scenario, axis.values, NAMES[0], 1.0, axis.state, 1.0), np.zeros(2))

    def inject(self, parameter: str, factor: float) -> None:
        """Set a parameter to a factor times nominal, and score how the racers follow."""
        if self.factors.get(parameter) == factor:
            self.said = f"{parameter} is at {factor:g} × nominal already; repair first"
            return
        before = self.axis.theta(SHOWN)
        self.axis.set_factors(self.factors | {parameter: factor})
        self.factors[parameter] = factor
        what = f"{parameter} × {factor:g}"
        self._changed(before, what, {"fault": parameter, "factor": factor}, key=what)
        size = np.abs(self.axis.theta(NAMES) - before[: len(NAMES)])
        quiet, self._quiet = self._quiet, self._quiet[:0]
        if not size.any():  # what is not estimated shows up in what is
            self.said += ", which nobody estimates: watch what it is taken for"
        elif len(quiet) < LEAST:
            self.said += "; no dot, for it was not quiet long enough before"
        elif (last := self.history.last) and last.tracking:
            column = int(np.argmax(size))
            last.tracking.std = 100 * rms(quiet[:, :, column]) / self._nominal[column]

    def repair(self) -> None:
        """Put all parameters of the axis back to nominal; dry friction is as it is."""
        before = self.axis.theta(SHOWN)
        self.axis.set_factors({})
        self.factors.clear()
        self._changed(before, "repaired", {"repair": True}, key="repair")
        self._quiet = self._quiet[:0]

    def rub(self, friction: Friction) -> None:
        """Let another dry friction act from now on."""
        if friction.acts_as(self.axis.friction):
            self.axis.set_friction(friction)
            return
        before = self.axis.theta(SHOWN)
        self.axis.set_friction(friction)
        turned = {name: getattr(friction, name) for name in friction.knobs}
        act = {"friction": friction.kind, **turned}
        self._changed(before, f"friction: {friction.in_words()}", act, key="friction")
        self._quiet = self._quiet[:0]

    def excite(self, mode: str) -> None:
        """Let the reference move, stop and go, or stand."""
        self.axis.excitation = mode
        self._noted("excitation", f"excitation {mode}", {"excitation": mode})

    def disturb(self, noise: float) -> None:
        """Set the standard deviation of the measured speed [rad/s]."""
        self.axis.noise = noise
        self._noted("noise", f"noise {noise:g} rad/s", {"noise": noise})

    def tune(self, racer: int, tuning: KnobSettings) -> None:
        """Turn the knobs of a racer; it goes on from where it is."""
        mine = self.racers[racer]
        mine.tune(tuning, self._recent)
        self._quiet = self._quiet[:0]
        if mine.knobs:
            letter, turned = "AB"[racer], {key: getattr(tuning, key) for key in mine.knobs}
            self._noted(f"knobs {letter}", f"{letter}: {mine.label}", {"racer": letter, **turned})

    def choose(self, racer: int, estimator: str | Spec) -> None:
        """Put another estimator into the race, from nominal on."""
        fresh = Racer(estimator, self.axis.nominal)
        fresh.join(self._recent)
        self.racers[racer] = fresh
        self._quiet = self._quiet[:0]
        self._close()
        letter = "AB"[racer]
        act = {"racer": letter, "estimator": fresh.text}
        self._noted(f"choice {letter}", f"{letter}: {fresh.text} joins", act)
        self.said = f"{fresh.text} joins"

    def curves(self) -> Curves:
        """Return what the curves show."""
        if not self._marks:
            empty = np.empty((0, len(self.racers), len(SHOWN)))
            return Curves(np.empty(0), empty[:, 0], empty, empty, empty[..., : len(NAMES)])
        return Curves(*(np.array(column) for column in zip(*self._marks, strict=True)))

    def lesson(self) -> str:
        """Return all that was done as a lesson, which does the same again."""
        estimators, seed = self._began
        return self.history.lesson(estimators=estimators, seed=seed, now=self.axis.samples)

    def _changed(self, before: Array, what: str, act: Mapping[str, Any], *, key: str) -> None:
        """Begin to follow a change of the truth, and take it down."""
        self.said = f"at {self.axis.time:.1f} s: {what}"
        entry = self._entry(key, what)
        last = self.history.entries[-1] if self.history.entries else None
        if last and last.tracking and dragged(self.history.entries, entry):
            before = last.tracking.before  # nobody has followed yet
        self._close()
        after = self.axis.theta(SHOWN)
        entry.tracking = Tracking(before, after, len(self.racers), self._jump(before, after))
        self.history.add(entry, act)
        for racer in self.racers:
            racer.thoughts.clear()

    def _jump(self, before: Array, after: Array) -> Jump | None:
        """Return what the bound needs, where exactly one of what is shown has changed."""
        axis, columns = self.axis, np.flatnonzero(before != after)
        if len(columns) != 1 or axis.noise <= 0:
            return None
        parameter, size = SHOWN[columns[0]], float(np.abs(after - before)[columns[0]])
        if parameter == "f_c" and not axis.friction.knobs:
            return None  # it has gone, and with it the law that the bound would need
        return Jump(axis.scenario, axis.values, parameter, size, axis.state, axis.noise)

    def _noted(self, key: str, what: str, act: Mapping[str, Any]) -> None:
        self.said = f"at {self.axis.time:.1f} s: {what}"
        self.history.add(self._entry(key, what), act)

    def _entry(self, key: str, what: str) -> HistoryLine:
        return HistoryLine(self.axis.samples, key, what, tuple(racer.text for racer in self.racers))

    def _close(self) -> None:
        """End what is followed, because something else changes; it gives points for what it had."""
        if (last := self.history.last) and last.tracking:
            self.points += last.tracking.close()
            del self.points[:-KEPT]

    def _take(self, samples: Samples) -> None:
        # Enough of the past to let a fresh estimator find the state of the axis.
        self._recent = self._recent.then(samples, keep=SETTLE + REPLAY)
        truth = self.axis.theta(NAMES)
        estimates = [racer.shown(racer.run(samples)) for racer in self.racers]
        last = self.history.last
        tracking = last.tracking if last else None
        if tracking is None or not tracking.scored:
            errors = np.stack(estimates, axis=1)[samples.excited, :, : len(NAMES)] - truth
            quiet = sample_index(QUIET, PERIOD)
            self._quiet = np.concatenate([self._quiet, errors])[-quiet:]
        if last and tracking and tracking.open:
            tracking.take(estimates, samples.torque, samples.excited)
            self._listen(last, estimates)
            if not tracking.open:
                self._close()

    def _listen(self, entry: HistoryLine, estimates: Sequence[Array]) -> None:
        """Take down what the racers say of a change."""
        changed = entry.tracking.changed if entry.tracking else None
        if changed is not None:
            column = SHOWN.index(changed)
            entry.estimates = [float(theta[-1, column]) for theta in estimates]
        since = self.axis.samples - entry.at
        entry.found = [
            [((since - 1 - ago) * PERIOD, what) for ago, what in racer.findings if ago < since]
            for racer in self.racers
        ]

    def _mark(self) -> None:
        self._marks.append(
            (
                np.array(self.axis.time),
                self.axis.theta(SHOWN),
                np.array([racer.shown(racer.theta) for racer in self.racers]),
                np.array([racer.shown(racer.deviation) for racer in self.racers]),
                np.array([racer.P for racer in self.racers]),
            )
        )
