"""The estimation problem, which consists of the parameters to estimate and the prior knowledge."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import (
    Design,
    above_zero,
    forgetting_factor,
    make_design,
)
from flexaxis.estimators.knob import tunings
from flexaxis.estimators.models.axis_models import PAPER, three_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import moves_as_nominal, moving_poles
from flexaxis.estimators.offline.structure import matrices
from flexaxis.estimators.signals import find_signal

SHORT = 0.1  # shortest memory relative to the slowest time constant of the axis. With a memory of
# 1 s, estimates diverge on an axis that coasts for 13.5 s, but not on one that coasts for 4 s
TORQUE_NOISE = 0.3  # initial standard deviation of unmodelled torque relative to the rms torque,
# used if y is an angle. Without this noise, the first exact readings make k_T wrong by 30 %; with
# 0.1 to 0.3, the error of k_T is at most 0.1 % (erob80, seeds 0-3)
PERIODS_AGREE = 1e-6  # largest relative difference of equal periods
Array = NDArray[np.float64]
Nominal = Mapping[str, float] | Model


@dataclass(frozen=True, eq=False)
class Problem:
    """
    A parameter estimation problem, which an estimator has to solve.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Either an axis model, or the nominal parameter values of the three-mass axis, including any
        data-sheet values.
    period : float
        Sampling period [s].
    identify : sequence of str
        Names of the parameters or inverse parameters to estimate.
    output : str
        Name of the output signal y, as listed in `flexaxis.estimators.signals.SIGNALS`.
    P0 : (p,) or (p, p) array_like, optional
        Initial matrix P(0), or only its diagonal.
    torque : (N,) array_like, optional
        Motor torque of a nominal motion [N m], from which
        `flexaxis.estimators.offline.priors.nominal_P` computes P(0). The torque also determines the
        expected magnitude of friction.
    noise : float, optional
        Standard deviation of the noise in y, in the unit of y.
    bounds : (lower, upper), optional
        Lower and upper bounds of θ; by default, the filter's own bounds.

    Attributes
    ----------
    model : Model
        The axis model that was passed as ``nominal``, or otherwise the linear model of the
        three-mass axis.

    Raises
    ------
    EstimatorError
        If the period, output or noise is invalid. Parameter names and P(0) are checked later,
        because an estimator can add torque laws to the model.
    """

    nominal: Nominal
    period: float
    _: KW_ONLY
    identify: Sequence[str] = PAPER
    output: str = "speed"
    P0: ArrayLike | None = None
    torque: ArrayLike | None = None
    noise: float | None = None
    bounds: tuple[ArrayLike, ArrayLike] | None = None

    def __post_init__(self) -> None:
        above_zero("period", self.period, "the sampling period [s]")
        unit = find_signal(self.output).unit
        if self.noise is not None:
            above_zero("noise", self.noise, f"the standard deviation of the noise in y [{unit}]")

    @cached_property
    def model(self) -> Model:  # noqa: D102
        return self.nominal if isinstance(self.nominal, Model) else three_mass(self.nominal)

    @property
    def asked(self) -> dict[str, Any]:
        """Options ``identify, period, output, noise, bounds``, which every filter accepts."""
        names = ("identify", "period", "output", "noise", "bounds")
        return {name: getattr(self, name) for name in names}

    @property
    def theta(self) -> Array:
        """Initial parameter estimate θ(0) (p,)."""
        return self.model.parametrize(self.identify).theta

    def tuned(self, name: str) -> float | None:
        """Return an estimator's tuned option value, or None if no value was tuned for the axis."""
        tuned = tunings().get(name)
        if (
            tuned
            and sorted(tuned["identify"]) == sorted(self.identify)
            and abs(self.period / tuned["period"] - 1) < PERIODS_AGREE
            and moves_as_nominal(self.model)
        ):
            return float(tuned["value"])
        return None

    def factor(self, name: str, forgetting: float | None) -> float:
        """
        Return the forgetting factor; warn if it is too small.

        If ``forgetting`` is None, the method uses the tuned value, or else the default value.
        """
        usual = self.tuned(name) if forgetting is None else forgetting
        weight = forgetting_factor(usual, self.period)
        rates = np.abs(moving_poles(self.model).real)
        memory, slowest = self.period / max(1 - weight, 1e-300), 1 / rates.min(initial=np.inf)
        if memory < SHORT * slowest:
            warnings.warn(
                f"the estimator {name} has a memory of {memory:.3g} s for λ = {weight:g}, but "
                f"the slowest pole of the axis has a time constant of {slowest:.3g} s. The "
                f"estimates can diverge; set forgetting={1 - self.period / slowest:.6g} or more, "
                "or use the estimator glr",
                stacklevel=2,
            )
        return weight

    def initial_P(self, *, scale: float = 1.0, **time_update: Any) -> ArrayLike:
        """
        Return P(0).

        If the attribute ``P0`` is set, the method returns ``P0``. Otherwise
        `flexaxis.estimators.offline.priors.nominal_P` computes P(0) from the torque of a nominal
        motion. If no torque is given, the method returns the stored P(0) of the nominal axis.

        Parameters
        ----------
        scale : float
            Factor that multiplies the covariance Δ of equation (32).
        **time_update : float or array_like
            Value of the option ``forgetting`` or ``drift`` of
            `flexaxis.estimators.offline.priors.nominal_P`.
        """
        from flexaxis.estimators.offline import priors

        if self.P0 is not None:
            return self.P0
        if self.torque is not None:
            return priors.nominal_P(
                self.model,
                self.torque,
                identify=self.identify,
                period=self.period,
                output=self.output,
                **time_update,
            )
        known = priors.stored_P(
            self.model,
            self.identify,
            self.period,
            forgetting=time_update.get("forgetting"),
            scale=scale,
        )
        if known is not None:
            return known
        raise EstimatorError(
            f"P(0) is known only for the parameters {', '.join(PAPER)} of the nominal axis with a "
            "sampling period of 5 ms; in all other cases, specify P0 or the torque of a nominal run"
        )

    def forgetting_options(self, name: str, forgetting: float | None) -> dict[str, Any]:
        """Return the options in `asked`, the forgetting factor λ, and P(0)."""
        weight = self.factor(name, forgetting)
        return self.asked | {"forgetting": weight, "P0": self.initial_P(forgetting=weight)}

    def torque_noise(self, model: Model) -> dict[str, float]:
        """
        Return the torque noise settings for `joint_arrays`, or {} if y is not an angle.

        The settings contain the index of the state that the motor torque drives, and the variance
        that the torque noise adds to this state in every sample.
        """
        if self.output != "angle":
            return {}
        effect = matrices(model)[1] * self.period
        driven = int(np.argmax(np.abs(effect)))
        square = np.mean(np.square(1.0 if self.torque is None else self.torque))
        variance = float((TORQUE_NOISE * effect[driven]) ** 2 * square)
        return {"driven": driven, "torque_noise": variance, "first_torque_noise": variance}

    def walk_design(self, name: str, usual: float, *, walk: float | None, spread: float) -> Design:
        """
        Return the design of a Kalman filter that models θ as a random walk.

        The argument ``walk`` is the standard deviation of the random walk after one second,
        relative to θ(0). If ``walk`` is None, the method uses the tuned value, or ``usual`` for an
        axis without a tuned value.
        """
        if walk is None:
            walk = self.tuned(name) or usual
        above_zero("walk", walk, "the standard deviation of the random walk")
        above_zero("spread", spread, "the initial standard deviation of θ relative to θ(0)")
        prior, drift = (spread * self.theta) ** 2, self.period * (walk * self.theta) ** 2
        return make_design(self.model, **self.asked, P0=prior, drift=drift, corrects=True)
