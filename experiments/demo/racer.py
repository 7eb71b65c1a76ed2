"""An estimator in the demo, which users can tune during the simulation."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axis_models import PAPER
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
"""Names of the parameters on the web page; only some estimators also estimate f_c."""
HYPOTHESES = (*SHOWN, "another")
"""Parameters that may have jumped; "another" is the most probable of all other parameters."""
WATCHED = sample_index(5.0, PERIOD)
"""Number of samples after a change at which the hypothesis probabilities are recorded."""
SETTLE = sample_index(2.0, PERIOD)
"""Settling time of a new predictor [samples], which is five times its longest time constant."""

TUNING: Mapping[str, tuple[str, float, float, float]] = {
    "forgetting": ("λ", 0.97, 0.9995, 0.0005),
    "scale": ("Δ / Δ of eq. (32)", 0.05, 10.0, 0.05),
    "regularization": ("μ", 0.0, 1.0, 0.01),
}
"""Label, smallest value, largest value and step of the slider for each tunable option."""


class Racer:
    """An estimator in the demo, together with the current values of its options.

    Parameters
    ----------
    text : str
        Name and options of the estimator, in the format of `--estimator`.
    nominal : AxisParameters
        Nominal parameter values that the estimator receives.
    output : str
        Name of the measured signal that the estimator receives.
    tuning : mapping of str to float, optional
        Values of the options in `TUNING` (default: the default values of the estimator).

    Attributes
    ----------
    text : str
        Name and options of the estimator, in the format of `--estimator`.
    tuning : dict of str to float
        Current values of the tunable options of the estimator, keyed by option.
    theta : ndarray (p,)
        Current estimates.
    thoughts : list of ndarray (5,)
        Jump probabilities of the parameters in `HYPOTHESES`, as one array per sample since the last
        call of `watch`.

    Raises
    ------
    EstimatorError, FlexaxisError
        If the estimator does not exist, or does not estimate the parameters in `NAMES` from the
        signal `output`.
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
                f"{text} estimates {', '.join(names)} from the {self._estimator.output}, but "
                f"the demo needs an estimator of {', '.join(NAMES)} from the {output}"
            )
        self._columns = [names.index(name) if name in names else len(names) for name in SHOWN]

    @property
    def deviation(self) -> Array:
        """Standard deviations (4,) of the `SHOWN` parameters; NaN if the estimator reports none."""
        covariance = getattr(self._estimator, "covariance", None)
        if covariance is None:
            return np.full(len(SHOWN), np.nan)
        return self.shown(np.sqrt(np.maximum(np.diag(covariance), 0.0)))

    @property
    def finding(self) -> str:
        """First change reported since the last call of `watch`, with its delay; empty if none."""
        for finding in getattr(self._estimator, "findings", None) or ():
            if finding.alarm >= self._changed:
                changes = zip(finding.parameters, finding.ratio, strict=False)
                what = ", ".join(f"{name} × {ratio:.3g}" for name, ratio in changes) or "unknown"
                return f"{what} after {(finding.alarm + 1 - self._changed) * PERIOD:.2g} s"
        return ""

    def shown(self, values: Array) -> Array:
        """Return the columns of `values` for the parameters in `SHOWN`, as an array (…, 4).

        The array `values` (…, p) has one column for each parameter that the estimator estimates. If
        the estimator does not estimate a parameter in `SHOWN`, the returned column of this
        parameter is NaN.
        """
        missing = np.full((*values.shape[:-1], 1), np.nan)
        columns: Array = np.concatenate([values, missing], axis=-1)[..., self._columns]
        return columns

    def watch(self) -> None:
        """Delete recorded probabilities and detections, and start a new recording."""
        self.thoughts, self._changed = [], self._seen

    def run(self, torque: Array, measured: Array) -> Array:
        """Process the next samples, and return the estimates of the parameters in `SHOWN`."""
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
        """Change an option of the estimator; keep its estimates and its matrix P.

        Parameters
        ----------
        option : str
            Name of the option, which must be a key of `tuning`.
        value : float
            New value of the option.
        recent : ndarray (2, n)
            Torque [N m] and measured signal at the most recent samples.

        Raises
        ------
        EstimatorError, FlexaxisError
            If the estimator does not have the option, or does not accept the option value. After an
            error, the estimator keeps its old options.
        """
        if option not in self.tuning:
            raise FlexaxisError(f"the estimator {self.text} has no tunable option {option}")
        old, tuning = self._estimator, self.tuning | {option: value}
        self._estimator, self.tuning = self._build(tuning), tuning
        self.join(recent, P=getattr(old, "P", None))

    def join(self, recent: Array, P: Array | None = None) -> None:
        """Run a new estimator on recent samples, because the axis is already in motion.

        The two rows of the array `recent` (2, n) contain the torque [N m] and the measured signal.
        The first measured samples are marked as missing. At a missing sample, the predictor uses
        only the torque. Therefore the initial state error of the predictor decays during the
        missing samples.
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
        """Create an estimator that has the options `tuning` and starts at the current estimates."""
        values = dict(self._nominal)
        for (parameter, exponent), value in zip(map(physical, NAMES), self.theta, strict=False):
            values[parameter] = float(value) ** exponent
        spec = replace(self._spec, options={**self._spec.options, **tuning})
        # P(0) is computed for the nominal axis, even if the estimates are far from nominal.
        P0 = known_P(NAMES, forgetting=tuning.get("forgetting"), scale=tuning.get("scale", 1))
        return make_estimator(spec, values, PERIOD, P0=P0, output=self._output)
