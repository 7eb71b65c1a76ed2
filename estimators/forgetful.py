"""Prediction-error methods that differ from the paper's in the time update of P only."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.design import make_design
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.history import widened
from flexaxis.estimators.model import Model
from flexaxis.estimators.pattern import split
from flexaxis.estimators.rpem import filter_records
from flexaxis.estimators.signals import check_sample, check_signals
from flexaxis.estimators.updates import RULES, rule_loop, rule_state_type, rule_tuning_type

Array = NDArray[np.float64]


class ForgetfulRpem:
    """
    Prediction-error method with another rule of forgetting.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    rule : {"vector", "directional", "efra", "variable", "cusum"}
        A factor for each parameter; forgetting along the gradient only; exponential forgetting and
        resetting; a factor that follows the residual; P reset when a CUSUM raises an alarm. See
        `flexaxis.estimators.updates` for equations and sources.
    identify, theta0, P0, period, bounds, output
        As for `flexaxis.estimators.Rpem`.
    forgetting : float
        λ; of "variable" the largest, of "cusum" the one between alarms.
    rates : (p,) array_like, optional
        Factors λ_i of "vector".
    reset : float
        What P is reset to by "cusum", as a standard deviation relative to θ(0), for a noise
        of standard deviation 0.1.
    level : float, optional
        Alarm threshold of "cusum" [nats], 10; of "variable" how far the residual must exceed the
        noise, 2.

    Attributes
    ----------
    names, output, bounds
        As given.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        R̂ P/2, as the paper's method claims it.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    def __init__(
        self,
        model: Model,
        *,
        rule: str,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float = 0.005,
        forgetting: float = 0.995,
        rates: ArrayLike | None = None,
        reset: float = 0.1,
        level: float | None = None,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
    ) -> None:
        if rule not in RULES:
            raise EstimatorError(f"unknown rule {rule!r}: {did_you_mean(rule, RULES)}")
        design = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting,
            drift=None,
            regularization=0.0,
            bounds=bounds,
            output=output,
        )
        self.names, self.output = design.model.names, output
        self.bounds = design.lower, design.upper
        pattern, coefficients = split(design.model)
        tuning, start = filter_records(design, pattern, coefficients)
        self._tuning = widened(tuning, rule_tuning_type(pattern))
        self._start = widened(start, rule_state_type(pattern))
        factors = np.full(len(self.names), design.forgetting) if rates is None else rates
        factors = np.asarray(factors, float)
        if factors.shape != (len(self.names),) or not np.all((factors > 0) & (factors <= 1)):
            raise EstimatorError(f"rates are {rates!r}; give a factor in (0, 1] for each parameter")
        if not reset > 0:
            raise EstimatorError(f"reset is {reset}; it must be above 0")
        self._tuning["correct"] = float(rule == "cusum")  # P is large: the state has to follow
        self._tuning["rule"], self._tuning["rates"] = RULES.index(rule), factors
        wide = np.diag((reset * design.theta0 / 0.1) ** 2)
        self._tuning["reset_P"] = np.diag(np.diag(design.P0)) * 10 if rule == "efra" else wide
        self._tuning["level"] = (10.0 if rule == "cusum" else 2.0) if level is None else level
        self._loop = rule_loop(pattern)
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._state = self._start.copy()

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._state["theta"][0].copy()

    @property
    def P(self) -> Array:
        """P(t+1|t) (p, p), for a noise variance of one."""
        return self._state["P"][0].copy()

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._state["noise"][0] * self._state["P"][0] / 2

    def step(self, u: float, y: float | None) -> Array:
        """Take u[k] and y[k] (None in a gap) and return θ[k] (p,)."""
        check_sample(u, y)
        return self.run([u], [0.0 if y is None else y], [y is not None])[0]

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Take N samples, from the current state on, and return θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
        valid : (N,) array_like of bool, optional
            False where y is missing; nothing is forgotten there.
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), len(self.names)))
        self._loop(self._tuning, self._state, u, y, present, estimates)
        return estimates
