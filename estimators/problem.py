"""The task of an estimator: the parameters to estimate, and the prior knowledge."""

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
from flexaxis.estimators.models.axes import PAPER, three_mass
from flexaxis.estimators.models.meaning import moves_as_nominal, moving_poles
from flexaxis.estimators.models.model import Model
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
    A task for an estimator.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Nominal values of the paper's axis, including data-sheet values, or a model.
    period : float
        Sampling period [s].
    identify : sequence of str
        Names of the parameters to estimate, or their inverses.
    output : str
        Name of the signal y in `flexaxis.estimators.signals.SIGNALS`.
    P0 : (p,) or (p, p) array_like, optional
        Initial matrix P(0) or its diagonal.
    torque : (N,) array_like, optional
        Torque of a nominal run [N m], used to compute P(0) by the paper's recipe and the expected
        size of friction.
    noise : float, optional
        Standard deviation of the noise of y, in the unit of y.
    bounds : (lower, upper), optional
        Bounds of θ; the filter's default bounds if omitted.

    Attributes
    ----------
    model : Model
        Model passed as ``nominal``, or the linear model of the paper's axis.

    Raises
    ------
    EstimatorError
        If the period, output or noise is invalid. Names and P(0) are checked later, because an
        estimator may add laws to the model.
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
        above_zero("period", self.period, "the sampling period in seconds")
        unit = find_signal(self.output).unit
        if self.noise is not None:
            above_zero("noise", self.noise, f"the standard deviation of y in {unit}")

    @cached_property
    def model(self) -> Model:  # noqa: D102
        return self.nominal if isinstance(self.nominal, Model) else three_mass(self.nominal)

    @property
    def asked(self) -> dict[str, Any]:
        """Options that every filter accepts: ``identify, period, output, noise, bounds``."""
        names = ("identify", "period", "output", "noise", "bounds")
        return {name: getattr(self, name) for name in names}

    @property
    def theta(self) -> Array:
        """Initial estimate θ(0) (p,)."""
        return self.model.parametrize(self.identify).theta

    def tuned(self, name: str) -> float | None:
        """Return the tuned value of an estimator's knob for this axis, or None if there is none."""
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
        """Return λ (specified, tuned or default); warn if its memory is short for the axis."""
        usual = self.tuned(name) if forgetting is None else forgetting
        weight = forgetting_factor(usual, self.period)
        rates = np.abs(moving_poles(self.model).real)
        memory, slowest = self.period / max(1 - weight, 1e-300), 1 / rates.min(initial=np.inf)
        if memory < SHORT * slowest:
            warnings.warn(
                f"{name} has a memory of {memory:.3g} s (forgetting {weight:g}), but the slowest "
                f"pole of the axis has a time constant of {slowest:.3g} s. The estimates may "
                f"diverge; set forgetting={1 - self.period / slowest:.6g} or more, or use glr",
                stacklevel=2,
            )
        return weight

    def initial_P(self, *, scale: float = 1.0, **time_update: Any) -> ArrayLike:
        """
        Return P(0).

        P(0) is the attribute ``P0`` if it is set. Otherwise the paper's recipe computes P(0) from
        the torque of a nominal run. Without a torque, the stored P(0) of the nominal axis is used.

        Parameters
        ----------
        scale : float
            Factor by which Δ of eq. (32) is multiplied.
        **time_update
            The recipe's option ``forgetting`` or ``drift``.
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
            f"P(0) is known only for {', '.join(PAPER)} of the nominal axis at 5 ms; for another "
            "axis, other parameters or another period, specify P0 or the torque of a nominal run, "
            "from which P(0) is computed"
        )

    def forgetting_options(self, name: str, forgetting: float | None) -> dict[str, Any]:
        """Return the options of `asked`, together with λ and P(0), for a method with forgetting."""
        weight = self.factor(name, forgetting)
        return self.asked | {"forgetting": weight, "P0": self.initial_P(forgetting=weight)}

    def torque_noise(self, model: Model) -> dict[str, float]:
        """
        Return the initial torque noise for `joint_arrays`; empty if y is not an angle.

        The result contains the index of the state that the torque drives, and the variance that the
        noise adds to this state per sample.
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
        Return the design of a Kalman filter with a random walk of θ, relative to θ(0).

        ``walk`` is the standard deviation of the random walk after one second. If it is None, the
        tuned value is used, or ``usual`` if no tuned value exists.
        """
        if walk is None:
            walk = self.tuned(name) or usual
        above_zero("walk", walk, "the standard deviation of θ after a second, relative to θ(0)")
        above_zero("spread", spread, "the standard deviation of θ(0), relative to θ(0)")
        prior, drift = (spread * self.theta) ** 2, self.period * (walk * self.theta) ** 2
        return make_design(self.model, **self.asked, P0=prior, drift=drift, corrects=True)
