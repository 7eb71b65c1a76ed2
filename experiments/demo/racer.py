"""An estimator in the race: built by name, turned by its knobs while it runs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import DRIFT, known_P
from flexaxis.estimators.protocol import Estimator, Finding, run_estimator
from flexaxis.estimators.registry import DEFAULT_IDENTIFY, REGISTRY
from flexaxis.experiments.demo.live_axis import Samples
from flexaxis.experiments.running.estimators import Spec, make_estimator, parse
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import AxisParameters
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

NAMES = tuple(DEFAULT_IDENTIFY)
SHOWN = (*NAMES, "f_c")
"""What is shown; the level of dry friction only of estimators that track it."""
SETTLE = sample_index(2.0, PERIOD)
"""Samples in which a fresh predictor finds the state of the axis: five times its slowest decay."""
WATCHED = sample_index(WINDOW, PERIOD)
"""Samples after a change in which a bank of hypotheses is looked into."""
REPLAY = sample_index(3.0, PERIOD)
"""Samples that an estimator without a P to hand over sees again."""


@dataclass(frozen=True)
class KnobSettings:
    """The knobs of the method; each estimator uses those that it has.

    Attributes
    ----------
    forgetting : float
        λ, eq. (9).
    drift : mapping of str to float
        Diagonal of Δ, eq. (10), by parameter.
    regularization : float
        m of μ, eq. (12), relative to the information in P(0), as in the registry.
    """

    forgetting: float = 0.995
    drift: Mapping[str, float] = field(default_factory=lambda: dict(DRIFT))
    regularization: float = 0.0


class Racer:
    """An estimator with its tuning, at the axis from some time on.

    Parameters
    ----------
    estimator : str or Spec
        As for `--estimator`: a name of the registry, or ``path/file.py:Class``, with options; or
        what was made of that.
    nominal : AxisParameters
        What it is told, and where it starts.

    Attributes
    ----------
    text : str
        As given.
    spec : Spec
        What it stands for.
    tuning : KnobSettings
        Where its knobs stand.
    knobs : tuple of str
        Which of the fields of `KnobSettings` it has.
    theta : ndarray (p,)
        Its estimate.
    thoughts : list of dict of str to (float, float)
        Of an estimator with a bank of hypotheses, sample by sample since the last change: with
        which probability a parameter has jumped, and how many samples ago.

    Raises
    ------
    EstimatorError, FlexaxisError
        If there is no such estimator, or it is not one of the three parameters and the speed.
    """

    def __init__(self, estimator: str | Spec, nominal: AxisParameters) -> None:
        self.spec = estimator if isinstance(estimator, Spec) else parse(estimator)
        self.text, self._nominal = self.spec.text, nominal
        self.name = self.text.partition("[")[0].strip()
        options = dict(getattr(REGISTRY.get(self.name), "options", {})) | dict(self.spec.options)
        self._knobs = {
            key: options[key] for key in ("forgetting", "regularization") if key in options
        }
        if self.name == "rpem-drift":
            self._knobs["drift"] = {name: options["scale"] * DRIFT[name] for name in NAMES}
        self.knobs = tuple(self._knobs)
        self.tuning = replace(KnobSettings(), **self._knobs)
        self.theta = np.array([getattr(nominal, p) ** float(e) for p, e in map(physical, NAMES)])
        self._seen = 0
        self.thoughts: list[dict[str, tuple[float, float]]] = []
        self._estimator = self._build()
        known = tuple(self._estimator.names)[: len(NAMES)] == NAMES
        if not known or self._estimator.output != "speed":
            raise FlexaxisError(
                f"{self.text} estimates {', '.join(self._estimator.names)} from the "
                f"{self._estimator.output}; the demo races {', '.join(NAMES)} from the speed"
            )

    @property
    def label(self) -> str:
        """Name and where the knobs stand, in a few characters."""
        tuning, words = self.tuning, []
        if "forgetting" in self.knobs:
            words.append(f"λ {tuning.forgetting:g}")
        if "drift" in self.knobs:
            words.append("Δ " + "/".join(f"{tuning.drift[name]:.0e}" for name in NAMES))
        if "regularization" in self.knobs:
            words.append(f"μ {tuning.regularization:g}")
        return f"{self.text} {', '.join(words)}".strip()

    @property
    def P(self) -> Array:
        """Diagonal of P (3,), for a noise variance of one; NaN where the estimator has none."""
        P = getattr(self._estimator, "P", None)
        return np.full(len(NAMES), np.nan) if P is None else np.diag(P)[: len(NAMES)].copy()

    @property
    def deviation(self) -> Array:
        """Standard deviations (p,) that the estimator claims; NaN where it claims none."""
        covariance = getattr(self._estimator, "covariance", None)
        if covariance is None:
            return np.full(len(self.theta), np.nan)
        return np.sqrt(np.maximum(np.diag(covariance), 0.0))

    @property
    def findings(self) -> list[tuple[int, str]]:
        """Changes that it has found: how many samples ago, and what, in a few characters."""
        found = getattr(self._estimator, "findings", None) or ()
        return [(self._seen - 1 - each.alarm, in_words(each)) for each in found]

    def shown(self, values: ArrayLike) -> Array:
        """Return values (…, p) of its parameters as those of `SHOWN`; NaN where it has none."""
        values = np.asarray(values, float)
        names = list(self._estimator.names)
        columns = [names.index(name) if name in names else len(names) for name in SHOWN]
        missing = np.full((*values.shape[:-1], 1), np.nan)
        return np.concatenate([values, missing], axis=-1)[..., columns]

    def run(self, samples: Samples) -> Array:
        """Take samples and return the estimates (n, p)."""
        torque, speed = samples.torque, samples.speed
        if hasattr(self._estimator, "hypotheses") and len(self.thoughts) < WATCHED:
            estimates = np.concatenate(
                [self._watched(u, y) for u, y in zip(torque, speed, strict=True)]
            )
        else:
            estimates = run_estimator(self._estimator, torque, speed)
        self._seen += len(samples.torque)
        self.theta = np.array(estimates[-1])
        return estimates

    def _watched(self, u: float, y: float) -> Array:
        """Take one sample, and look into the bank of hypotheses."""
        found = run_estimator(self._estimator, [u], [y])
        thought = {}
        for name, bank in self._estimator.hypotheses.items():  # type: ignore[attr-defined]
            ago, weight = bank[:, 0], bank[:, 1]
            likely = float(weight.sum())
            thought[name] = likely, float(weight @ ago) / likely if likely else np.nan
        self.thoughts.append(thought)
        return found

    def tune(self, tuning: KnobSettings, recent: Samples) -> None:
        """Turn the knobs, and go on from the same estimate and the same P.

        Parameters
        ----------
        tuning : KnobSettings
            New values; those of knobs that it has not are ignored.
        recent : Samples
            The last seconds, from which the predictor finds the state of the axis again.

        Raises
        ------
        EstimatorError
            If a value is not allowed; then nothing has changed.
        """
        before, old = self.tuning, self._estimator
        if not self.knobs or all(getattr(tuning, k) == getattr(before, k) for k in self.knobs):
            return
        self.tuning = tuning
        try:
            fresh = self._build()
        except ValueError:
            self.tuning = before
            raise
        self._estimator = fresh
        self.join(recent)
        with suppress(AttributeError):  # not every estimator has a P, or lets it be set
            fresh.P = old.P  # type: ignore[attr-defined]

    def join(self, recent: Samples) -> None:
        """Let a fresh estimator find the state of the axis that is running already.

        In a gap of the measurement a predictor follows the torque and forgets that it began at
        rest. An estimator that has no P is then shown the end of the past once more.
        """
        if self.name not in REGISTRY or not len(recent.torque):  # others need not know gaps
            return
        gap = slice(-SETTLE - REPLAY, -REPLAY)
        if hasattr(self._estimator, "P"):
            gap = slice(-SETTLE, None)
        torque = recent.torque[gap]
        self._seen = len(torque)
        run_estimator(self._estimator, torque, np.zeros(len(torque)), np.zeros(len(torque), bool))
        if gap.stop is not None:
            self.run(replace(recent, torque=recent.torque[-REPLAY:], speed=recent.speed[-REPLAY:]))

    def _build(self) -> Estimator:
        """Make the estimator with the knobs where they stand, starting at the present estimate."""
        values = self._nominal.as_dict()
        known = self.theta[: len(NAMES)]
        for (parameter, exponent), value in zip(map(physical, NAMES), known, strict=True):
            values[parameter] = value ** float(exponent)
        turned = {key: getattr(self.tuning, key) for key in self.knobs}
        spec = replace(self.spec, options=dict(self.spec.options) | turned)
        if "drift" in self.knobs:  # the registry knows only one factor on all of Δ
            spec = replace(spec, session=_with_drift, options=turned)
        offered = {}
        if "forgetting" in turned:  # known of the nominal axis, however far the estimate is by now
            offered["P0"] = known_P(NAMES, forgetting=turned["forgetting"])
        return make_estimator(spec, values, PERIOD, **offered)


def in_words(finding: Finding) -> str:
    """Return what an estimator has found, in a few characters."""
    changes = zip(finding.parameters, finding.ratio, strict=False)
    return ", ".join(f"{name} × {ratio:.3g}" for name, ratio in changes) or "something unknown"


def _with_drift(
    nominal: Mapping[str, float],
    period: float,
    *,
    drift: Mapping[str, float],
    regularization: float,
) -> Estimator:
    """Return the paper's method with a Δ for each parameter, and the P(0) that goes with them."""
    diagonal = np.array([drift[name] for name in NAMES])
    scale = float(np.exp(np.mean(np.log(diagonal / [DRIFT[name] for name in NAMES]))))
    P0 = known_P(NAMES, forgetting=None, scale=scale)
    assert P0 is not None  # these are the paper's parameters
    return Rpem(
        three_mass(nominal),
        identify=NAMES,
        P0=P0,
        period=period,
        drift=diagonal,
        regularization=regularization * diagonal / P0**2,  # as the registry has it
        ceiling=np.inf,  # for the slider of μ to show what it does
    )
