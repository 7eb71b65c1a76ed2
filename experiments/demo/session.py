"""The session of the live demo: an axis, two estimators, and a list of parameter changes."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.demo.axis import EXCITATION, FRICTION, SENSORS, LiveAxis
from flexaxis.experiments.demo.racer import SETTLE, SHOWN, Racer
from flexaxis.experiments.demo.tracking import Change
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

MARK = 20
"""Number of samples between successive points of a curve on the web page."""
SPAN = 40.0
"""Length of the time window in the plots on the web page [s]."""
RECENT = SETTLE + sample_index(3.0, PERIOD)
"""Number of past samples that a newly selected estimator processes first."""
DEFAULT_RACERS = ("rpem-forgetting", RECOMMENDED)
"""Default estimators of the demo: the method of Östring and Gunnarsson, and the recommended one."""

BUTTONS: Mapping[str, tuple[str, float]] = {
    "motor friction f_m × 2": ("f_m", 2.0),
    "payload J_a × 1.25": ("J_a", 1.25),
    "weak motor k_T × 0.9": ("k_T", 0.9),
    "soft arm k_a × 0.9": ("k_a", 0.9),
}
"""For each fault button, the parameter that it changes and the ratio of new to nominal value."""


ACTIONS = (
    "inject", "repair", "set_friction", "set_excitation", "set_noise", "set_sensor", "tune",
    "choose",
)  # fmt: skip
"""Names of the session methods that a user or a lesson can call."""


class DemoSession:
    """A live axis and two estimators; the methods change the axis and tune the estimators.

    The caller determines when samples are simulated, and draws the results.

    Parameters
    ----------
    estimators : sequence of str
        Names and options of two estimators, in the format of `--estimator`.
    seed : int
        Random seed of the simulation. The same seed and the same user actions give the same
        results.

    Attributes
    ----------
    axis : LiveAxis
        The simulated axis.
    racers : list of Racer
        Estimators A and B.
    factors : dict of str to float
        Ratio of the current to the nominal value of each changed parameter, keyed by parameter.
    changes : list of Change
        All previous parameter changes, each with the subsequent errors of the estimators.
    message : str
        Description of the last user action or of the last error.

    Raises
    ------
    EstimatorError, FlexaxisError
        If the demo cannot run one of the estimators.
    """

    def __init__(self, estimators: Sequence[str] = DEFAULT_RACERS, *, seed: int = 0) -> None:
        if len(estimators) != 2:
            raise FlexaxisError(f"the demo needs 2 estimators, not {len(estimators)}")
        self.axis = LiveAxis(seed=seed)
        self.racers = [Racer(text, self.axis.nominal) for text in estimators]
        self.factors: dict[str, float] = {}
        self.changes: list[Change] = []
        self.message = "no fault: all parameters have their nominal values"
        self._marks: deque[tuple[Array, ...]] = deque(maxlen=round(SPAN / PERIOD / MARK))
        self._recent = np.empty((2, 0))

    def advance(self, samples: int) -> None:
        """Simulate the next samples, and run both estimators on the new samples."""
        while samples > 0:
            n = min(samples, MARK - self.axis.samples % MARK)
            torque, measured, excited = self.axis.advance(n)
            # A chunk ends at each multiple of `MARK`, so that the results do not depend on the
            # numbers of samples in successive calls.
            estimates = [racer.run(torque, measured) for racer in self.racers]
            self._recent = np.hstack([self._recent, [torque, measured]])[:, -RECENT:]
            if self.changes:
                self.changes[-1].take(estimates, torque, excited)
                self.changes[-1].findings = [racer.finding for racer in self.racers]
            if self.axis.samples % MARK == 0:
                self._mark([theta[-1] for theta in estimates])
            samples -= n

    def curves(self) -> dict[str, Array]:
        """Return the plotted curves of the last `SPAN` seconds, with one point per `MARK` samples.

        The array ``truth`` (M, 4) contains the true parameter values at the times ``time`` (M,).
        The arrays ``theta`` and ``deviation``, both (M, 2, 4), contain the estimates of both
        estimators and the standard deviations of these estimates. The last dimension of each array
        except ``time`` corresponds to the parameters in `SHOWN`. Missing values are 0.
        """
        names = ("time", "truth", "theta", "deviation")
        columns = [np.nan_to_num(column) for column in zip(*self._marks, strict=True)]
        return dict(zip(names, columns, strict=True))

    def do(self, action: str, *values: Any) -> bool:
        """Perform an action in `ACTIONS`, and return whether it has succeeded.

        The attribute `message` then describes the action or its error.
        """
        try:
            if action not in ACTIONS:
                raise FlexaxisError(unknown("action", action, ACTIONS))
            what = getattr(self, action)(*values)
        except (ValueError, TypeError) as error:  # all errors of flexaxis are ValueErrors
            self.message = str(error)
            return False
        self.message = f"at {self.axis.time:.1f} s: {what}"
        return True

    def inject(self, parameter: str, factor: float) -> str:
        """Set a parameter to `factor` times nominal, and start to record the estimation errors."""
        if parameter not in self.axis.nominal or not 0.5 <= factor <= 2:
            raise FlexaxisError(
                f"{parameter} × {factor:g}: use a parameter of the axis, and a factor between 0.5 "
                "and 2"
            )
        if self.factors.get(parameter) == factor:
            raise FlexaxisError(
                f"{parameter} is already {factor:g} times its nominal value: repair the axis first"
            )
        before, factors = self.axis.theta(SHOWN), self.factors | {parameter: factor}
        self.axis.set_factors(factors)
        self.factors = factors
        return self._follow(f"{parameter} × {factor:g}", before)

    def repair(self) -> str:
        """Set all parameters of the axis to their nominal values, but keep the friction model."""
        before, self.factors = self.axis.theta(SHOWN), {}
        self.axis.set_factors({})
        return self._follow("repaired", before)

    def set_friction(self, kind: str) -> str:
        """Use the friction model with the given label in `demo.axis.FRICTION`."""
        if kind not in FRICTION:
            raise FlexaxisError(unknown("friction", kind, FRICTION))
        before = self.axis.theta(SHOWN)
        self.axis.set_friction(kind)
        return self._follow(f"friction: {kind}", before)

    def set_excitation(self, mode: str) -> str:
        """Set the mode of the reference to on, stop-and-go or off (see `EXCITATION`)."""
        if mode not in EXCITATION:
            raise FlexaxisError(unknown("excitation", mode, EXCITATION))
        self.axis.excitation = mode
        return f"excitation {mode}"

    def set_noise(self, noise: float) -> str:
        """Set the standard deviation of the motor speed noise [rad/s]."""
        what = f"noise {noise:g} rad/s"  # fails if `noise` is not a number
        self.axis.noise = noise
        return what

    def set_sensor(self, kind: str) -> str:
        """Use the motor sensor with the given label in `demo.axis.SENSORS`.

        Both estimators restart at nominal parameter values, because the measured signal changes.
        """
        if kind not in SENSORS:
            raise FlexaxisError(unknown("sensor", kind, SENSORS))
        output = SENSORS[kind].get("output", "speed")
        racers = [Racer(r.text, self.axis.nominal, output, r.tuning) for r in self.racers]
        # Only the torque of these samples is used, because they contain readings of the old sensor.
        self._recent = self._recent[:, -SETTLE:]
        for racer in racers:
            racer.join(self._recent)
        self.axis.set_sensor(kind)
        self.racers = racers
        return self._follow(f"sensor: {kind}", self.axis.theta(SHOWN))

    def tune(self, racer: str, option: str, value: float) -> str:
        """Set an option of estimator A or B, without changing the current estimates."""
        self.racers["AB".index(racer)].tune(option, value, self._recent)
        return f"{racer}: {option} {value:g}"

    def choose(self, racer: str, estimator: str) -> str:
        """Replace estimator A or B by a new estimator, which starts at nominal values."""
        fresh = Racer(estimator, self.axis.nominal, self.axis.output)
        fresh.join(self._recent)
        self.racers["AB".index(racer)] = fresh
        return f"{racer} is now {estimator}"

    def _follow(self, what: str, before: Array) -> str:
        """Start to record the errors after a change, and return the description of the change."""
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
