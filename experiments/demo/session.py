"""The demo without a screen: an axis, two estimators that race on it, and what is to be shown."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.building.specs import Spec
from flexaxis.experiments.demo.dots import Dot, Scorer
from flexaxis.experiments.demo.live_axis import NO_SAMPLES, LiveAxis, Samples
from flexaxis.experiments.demo.racer import NAMES, REPLAY, SETTLE, KnobSettings, Racer
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]

MARK = 20
"""Samples between two points of the curves."""
SPAN = 40.0
"""Seconds that the curves show."""
DEFAULT_RACERS = ("rpem-forgetting", "rpem-drift")


@dataclass(frozen=True)
class FaultButton:
    """A fault that can be injected with one click."""

    label: str
    parameter: str
    factor: float


BUTTONS = (
    FaultButton("Gearbox wear: f_m × 2", "f_m", 2.0),
    FaultButton("Payload: J_a × 1.25", "J_a", 1.25),
    FaultButton("Weak motor: k_T × 0.9", "k_T", 0.9),
    FaultButton("Soft arm coupling: k_a × 0.9", "k_a", 0.9),
)


@dataclass(frozen=True)
class Curves:
    """The last seconds, a row every `MARK` samples; parameters in the order of `NAMES`.

    Attributes
    ----------
    time : ndarray (M,)
        Simulated time [s].
    truth : ndarray (M, p)
        True values.
    theta, deviation, P : ndarray (M, 2, p)
        Estimates of both racers, the standard deviations they claim, and the diagonals of P.
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
    dots : list of Dot
        One for each racer and each fault that was scored.
    said : str
        What happened last, in words.
    factors : dict of str to float
        Faults that act now: parameter and factor on nominal.

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
        self.dots: list[Dot] = []
        self.factors: dict[str, float] = {}
        self.said = "no fault: the estimates stay at the truth"
        self._scorer = Scorer(NAMES, self.axis.theta(NAMES), len(self.racers))
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

    def inject(self, parameter: str, factor: float) -> None:
        """Set a parameter to a factor times nominal, and score how the racers follow.

        Raises
        ------
        FlexaxisError
            If the parameter or the factor is not allowed; then nothing has changed.
        """
        if self.factors.get(parameter) == factor:
            self.said = f"{parameter} is at {factor:g} × nominal already; repair first"
            return
        before = self.axis.theta(NAMES)
        self.axis.set_factors(self.factors | {parameter: factor})
        self.factors[parameter] = factor
        self.said = f"t = {self.axis.time:.1f} s: {parameter} × {factor:g}"
        size = np.abs(self.axis.theta(NAMES) - before)
        if not size.any():  # what is not estimated shows up in what is
            self.dots += self._scorer.event()
            self._scorer.forget_quiet()
            self.said += ", which nobody estimates: watch what it is taken for"
            return
        column = int(np.argmax(size))
        labels = [racer.label for racer in self.racers]
        self.dots += self._scorer.fault(NAMES[column], float(size[column]), labels)
        if not self._scorer.open:
            self.said += "; no dot, for it was not quiet long enough before"

    def repair(self) -> None:
        """Put all parameters back to nominal."""
        self.axis.set_factors({})
        self.factors.clear()
        self.dots += self._scorer.event()
        self._scorer.forget_quiet()
        self.said = f"t = {self.axis.time:.1f} s: repaired"

    def tune(self, racer: int, tuning: KnobSettings) -> None:
        """Turn the knobs of a racer; it goes on from where it is."""
        self.racers[racer].tune(tuning, self._recent)
        self._scorer.forget_quiet()

    def choose(self, racer: int, estimator: str | Spec) -> None:
        """Put another estimator into the race, from nominal on."""
        fresh = Racer(estimator, self.axis.nominal)
        fresh.join(self._recent)
        self.racers[racer] = fresh
        self._scorer.event()
        self._scorer.forget_quiet()
        self.said = f"{fresh.text} joins"

    def curves(self) -> Curves:
        """Return what the curves show."""
        if not self._marks:
            empty = np.empty((0, len(self.racers), len(NAMES)))
            return Curves(np.empty(0), empty[:, 0], empty, empty, empty)
        return Curves(*(np.array(column) for column in zip(*self._marks, strict=True)))

    def _take(self, samples: Samples) -> None:
        # Enough of the past to let a fresh estimator find the state of the axis.
        self._recent = self._recent.then(samples, keep=SETTLE + REPLAY)
        truth = self.axis.theta(NAMES)
        estimates = np.stack([racer.run(samples) for racer in self.racers], axis=1)
        self.dots += self._scorer.take(estimates - truth, samples.excited)

    def _mark(self) -> None:
        self._marks.append(
            (
                np.array(self.axis.time),
                self.axis.theta(NAMES),
                np.array([racer.theta for racer in self.racers]),
                np.array([racer.deviation for racer in self.racers]),
                np.array([racer.P for racer in self.racers]),
            )
        )
