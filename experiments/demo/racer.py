"""An estimator of the demo that can be tuned while it runs."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.running.estimators import make_estimator, parse
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import AxisParameters
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

NAMES = PAPER
SHOWN = (*NAMES, "f_c")
"""Names of the parameters on the page. Only estimators that track dry friction estimate f_c."""
HYPOTHESES = (*SHOWN, "another")
"""Hypotheses on the page; "another" stands for the most likely of the other parameters."""
WATCHED = sample_index(5.0, PERIOD)
"""Number of samples after a change for which the hypotheses' probabilities are recorded."""
SETTLE = sample_index(2.0, PERIOD)
"""Settling time of a new predictor [samples]: five times its longest time constant."""

TUNING: Mapping[str, tuple[str, float, float, float]] = {
    "forgetting": ("λ", 0.97, 0.9995, 0.0005),
    "scale": ("Δ / Δ of eq. (32)", 0.05, 10.0, 0.05),
    "regularization": ("μ", 0.0, 1.0, 0.01),
}
"""Slider of each option that can be tuned: label, smallest value, largest value and step."""


class Racer:
    """An estimator of the demo, and the current values of its options.

    Parameters
    ----------
    text : str
        Name of the estimator and its options, as for `--estimator`.
    nominal : AxisParameters
        Nominal parameter values for the estimator.
    output : str
        Name of the signal that the estimator receives.
    tuning : mapping of str to float, optional
        Values of options in `TUNING` (default: the estimator's own values).

    Attributes
    ----------
    text : str
        Name of the estimator and its options, as for `--estimator`.
    tuning : dict of str to float
        Current values of the options in `TUNING` that the estimator has, keyed by option.
    theta : ndarray (p,)
        Current estimates.
    thoughts : list of ndarray (5,)
        Probabilities that each parameter in `HYPOTHESES` has jumped, with one array for each sample
        since the last call of `watch`.

    Raises
    ------
    EstimatorError, FlexaxisError
        If the estimator does not exist, or does not estimate `NAMES` from this signal.
    """

    def __init__(
        self,
        text: str,
        nominal: AxisParameters,
        output: str = "speed",
        tuning: Mapping[str, float] | None = None,
    ) -> None:
        self.text, self._spec, self._nominal = text, parse(text), nominal.as_dict()
        self._output = output
        usual = {} if self._spec.is_users else REGISTRY[self._spec.name].options
        options = {**usual, **self._spec.options, **(tuning or {})}
        self.tuning = {name: options[name] for name in TUNING if name in options}
        self.theta = np.array([self._nominal[p] ** float(e) for p, e in map(physical, NAMES)])
        self.thoughts: list[Array] = []
        self._seen = self._changed = 0
        self._estimator = self._build(self.tuning)
        names = tuple(self._estimator.names)
        if names[: len(NAMES)] != NAMES or self._estimator.output != output:
            raise FlexaxisError(
                f"{text} estimates {', '.join(names)} from the {self._estimator.output}; "
                f"the demo needs estimators of {', '.join(NAMES)} from the {output}"
            )
        self._columns = [names.index(name) if name in names else len(names) for name in SHOWN]

    @property
    def deviation(self) -> Array:
        """Reported standard deviations (4,) of the parameters `SHOWN`; NaN if not reported."""
        covariance = getattr(self._estimator, "covariance", None)
        if covariance is None:
            return np.full(len(SHOWN), np.nan)
        return self.shown(np.sqrt(np.maximum(np.diag(covariance), 0.0)))

    @property
    def finding(self) -> str:
        """Description and delay of the first change reported since the last call of `watch`."""
        for finding in getattr(self._estimator, "findings", None) or ():
            if finding.alarm >= self._changed:
                changes = zip(finding.parameters, finding.ratio, strict=False)
                what = ", ".join(f"{name} × {ratio:.3g}" for name, ratio in changes) or "unknown"
                return f"{what} after {(finding.alarm + 1 - self._changed) * PERIOD:.2g} s"
        return ""

    def shown(self, values: Array) -> Array:
        """Return the columns (…, 4) of the parameters `SHOWN`, given all columns (…, p).

        A column is NaN if the estimator does not estimate the parameter.
        """
        missing = np.full((*values.shape[:-1], 1), np.nan)
        columns: Array = np.concatenate([values, missing], axis=-1)[..., self._columns]
        return columns

    def watch(self) -> None:
        """Delete old probabilities and detections, and start to record new ones."""
        self.thoughts, self._changed = [], self._seen

    def run(self, torque: Array, measured: Array) -> Array:
        """Process the next samples (n,), and return the estimates (n, 4) of `SHOWN`."""
        each = hasattr(self._estimator, "beliefs") and len(self.thoughts) < WATCHED
        estimates = []
        for part in np.split(np.stack([torque, measured]), len(torque) if each else 1, axis=1):
            estimates.append(run_estimator(self._estimator, *part))
            if each:
                self.thoughts.append(self._thought())
        self._seen += len(torque)
        self.theta = estimates[-1][-1]
        return self.shown(np.concatenate(estimates))

    def tune(self, option: str, value: float, recent: Array) -> None:
        """Change an option of the estimator, but keep its estimates and its matrix P.

        Parameters
        ----------
        option : str
            Name of the option, a key of `tuning`.
        value : float
            New value of the option.
        recent : ndarray (2, n)
            Torque [N m] and measured signal of the most recent samples.

        Raises
        ------
        EstimatorError, FlexaxisError
            If the estimator has no such option or rejects the value. The estimator then keeps its
            options.
        """
        if option not in self.tuning:
            raise FlexaxisError(f"{self.text} has no option {option} to tune")
        old, tuning = self._estimator, self.tuning | {option: value}
        self._estimator, self.tuning = self._build(tuning), tuning
        self.join(recent, P=getattr(old, "P", None))

    def join(self, recent: Array, P: Array | None = None) -> None:
        """Run a new estimator on recent samples, because the axis is already moving.

        `recent` (2, n) contains the torque [N m] and the measured signal. The first readings
        are marked as missing. During this gap, the predictor uses only the torque, and the error of
        its initial state (at rest) decays.
        """
        self._seen = 0
        torque, measured = recent
        if len(torque) < SETTLE or self._spec.is_users:  # user code may not support gaps
            return
        gap = torque[:SETTLE]
        run_estimator(self._estimator, gap, np.zeros(SETTLE), np.zeros(SETTLE, bool))
        if P is not None:
            with suppress(AttributeError):  # some estimators do not allow setting P
                self._estimator.P = P  # type: ignore[attr-defined]
        self._seen = SETTLE
        if len(torque) > SETTLE:
            self.run(torque[SETTLE:], measured[SETTLE:])
        self.watch()

    def _thought(self) -> Array:
        bank = dict(self._estimator.beliefs)  # type: ignore[attr-defined]
        known = [bank.pop(name, 0.0) for name in SHOWN]
        return np.array([*known, max(bank.values(), default=0.0)])

    def _build(self, tuning: Mapping[str, float]) -> Estimator:
        """Make a new estimator with the options `tuning` that starts at the current estimates."""
        values = dict(self._nominal)
        for (parameter, exponent), value in zip(map(physical, NAMES), self.theta, strict=False):
            values[parameter] = float(value) ** exponent
        spec = replace(self._spec, options={**self._spec.options, **tuning})
        # P(0) is computed for the nominal axis, even if the estimates are far from nominal.
        P0 = known_P(NAMES, forgetting=tuning.get("forgetting"), scale=tuning.get("scale", 1))
        return make_estimator(spec, values, PERIOD, P0=P0, output=self._output)
