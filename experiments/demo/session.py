"""The demo without a screen: an axis, two estimators that race on it, and what was changed."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.demo.axis import EXCITATION, FRICTION, LiveAxis
from flexaxis.experiments.demo.racer import SETTLE, SHOWN, Racer
from flexaxis.experiments.demo.tracking import Change
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

MARK = 20
"""Samples between two points of the curves."""
SPAN = 40.0
"""Time that the curves show [s]."""
RECENT = SETTLE + sample_index(3.0, PERIOD)
"""Samples that an estimator is shown when it joins."""
DEFAULT_RACERS = ("rpem-forgetting", RECOMMENDED)
"""The paper's method, and the recommended one."""

BUTTONS: Mapping[str, tuple[str, float]] = {
    "motor friction f_m × 2": ("f_m", 2.0),
    "payload J_a × 1.25": ("J_a", 1.25),
    "weak motor k_T × 0.9": ("k_T", 0.9),
    "soft arm k_a × 0.9": ("k_a", 0.9),
}
"""Faults with a button: parameter, and factor on nominal."""


ACTIONS = ("inject", "repair", "set_friction", "set_excitation", "set_noise", "tune", "choose")
"""Methods that a viewer or a lesson may call."""


class DemoSession:
    """A live axis, two racing estimators, faults and tuning; no screen, no clock of its own.

    Parameters
    ----------
    estimators : sequence of str
        Two estimators, as for `--estimator`.
    seed : int
        The same seed and the same actions give the same run.

    Attributes
    ----------
    axis : LiveAxis
    racers : list of Racer
        A and B.
    factors : dict of str to float
        Faults that act now.
    changes : list of Change
    message : str
        What happened last.

    Raises
    ------
    EstimatorError, FlexaxisError
        If an estimator cannot race.
    """

    def __init__(self, estimators: Sequence[str] = DEFAULT_RACERS, *, seed: int = 0) -> None:
        if len(estimators) != 2:
            raise FlexaxisError(f"two estimators race, not {len(estimators)}: give two")
        self.axis = LiveAxis(seed=seed)
        self.racers = [Racer(text, self.axis.nominal) for text in estimators]
        self.factors: dict[str, float] = {}
        self.changes: list[Change] = []
        self.message = "no fault: the estimates stay at the truth"
        self._marks: deque[tuple[Array, ...]] = deque(maxlen=round(SPAN / PERIOD / MARK))
        self._recent = np.empty((2, 0))

    def advance(self, samples: int) -> None:
        """Simulate and estimate some samples."""
        while samples > 0:
            n = min(samples, MARK - self.axis.samples % MARK)
            torque, speed, excited = self.axis.advance(n)
            # As every chunk ends at a mark, results do not depend on how often this is called.
            estimates = [racer.run(torque, speed) for racer in self.racers]
            self._recent = np.hstack([self._recent, [torque, speed]])[:, -RECENT:]
            if self.changes:
                self.changes[-1].take(estimates, torque, excited)
                self.changes[-1].findings = [racer.finding for racer in self.racers]
            if self.axis.samples % MARK == 0:
                self._mark([theta[-1] for theta in estimates])
            samples -= n

    def curves(self) -> dict[str, Array]:
        """Return the last seconds, a row every `MARK` samples.

        They are ``time`` (M,), ``truth`` (M, 4), and of both racers ``theta`` and ``deviation``
        (M, 2, 4) of `SHOWN`; 0 where a racer has none.
        """
        names = ("time", "truth", "theta", "deviation")
        columns = [np.nan_to_num(column) for column in zip(*self._marks, strict=True)]
        return dict(zip(names, columns, strict=True))

    def do(self, action: str, *values: Any) -> None:
        """Call one of `ACTIONS`, which returns what has happened; an error becomes the message."""
        try:
            if action not in ACTIONS:
                raise FlexaxisError(unknown("action", action, ACTIONS))
            what = getattr(self, action)(*values)
        except (ValueError, TypeError) as error:  # every error of ours is a ValueError
            self.message = str(error)
        else:
            self.message = f"at {self.axis.time:.1f} s: {what}"

    def inject(self, parameter: str, factor: float) -> str:
        """Set a parameter to a factor times nominal, and follow how the estimators find it."""
        if parameter not in self.axis.nominal or not 0.5 <= factor <= 2:
            raise FlexaxisError(f"{parameter} × {factor:g}: give a parameter, and 0.5 to 2")
        if self.factors.get(parameter) == factor:
            raise FlexaxisError(f"{parameter} is already at {factor:g} × nominal: repair first")
        before, factors = self.axis.theta(SHOWN), self.factors | {parameter: factor}
        self.axis.set_factors(factors)
        self.factors = factors
        return self._follow(f"{parameter} × {factor:g}", before)

    def repair(self) -> str:
        """Set all parameters to nominal; dry friction stays."""
        before, self.factors = self.axis.theta(SHOWN), {}
        self.axis.set_factors({})
        return self._follow("repaired", before)

    def set_friction(self, kind: str) -> str:
        """Set the law of dry friction, one of `flexaxis.experiments.demo.axis.FRICTION`."""
        if kind not in FRICTION:
            raise FlexaxisError(unknown("friction", kind, FRICTION))
        before = self.axis.theta(SHOWN)
        self.axis.set_friction(kind)
        return self._follow(f"friction: {kind}", before)

    def set_excitation(self, mode: str) -> str:
        """Let the reference move, stop and go, or stand."""
        if mode not in EXCITATION:
            raise FlexaxisError(unknown("excitation", mode, EXCITATION))
        self.axis.excitation = mode
        return f"excitation {mode}"

    def set_noise(self, noise: float) -> str:
        """Set the standard deviation of the measured speed [rad/s]."""
        self.axis.noise = noise
        return f"noise {noise:g} rad/s"

    def tune(self, racer: str, option: str, value: float) -> str:
        """Set an option of racer A or B, which goes on from its estimate."""
        self.racers["AB".index(racer)].tune(option, value, self._recent)
        return f"{racer}: {option} {value:g}"

    def choose(self, racer: str, estimator: str) -> str:
        """Put another estimator into the race as A or B, from nominal on."""
        fresh = Racer(estimator, self.axis.nominal)
        fresh.join(self._recent)
        self.racers["AB".index(racer)] = fresh
        return f"{racer}: {estimator} joins"

    def _follow(self, what: str, before: Array) -> str:
        """Follow a change of the truth from now on, and return it in words."""
        change = Change(self.axis, what, before)
        self.changes.append(change)
        for racer in self.racers:
            racer.watch()
        return what if change.parameter else f"{what}: no estimated parameter has changed"

    def _mark(self, estimates: Sequence[Array]) -> None:
        self._marks.append(
            (
                np.array(self.axis.time),
                self.axis.theta(SHOWN),
                np.array(estimates),
                np.array([racer.deviation for racer in self.racers]),
            )
        )
