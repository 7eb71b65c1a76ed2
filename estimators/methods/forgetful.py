"""Prediction-error methods that differ from the paper's in the time update of P only."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.methods.rpem import filter_records
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import make_design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.recursion.updates import (
    RULES,
    rule_loop,
    rule_state_type,
    rule_tuning_type,
)
from flexaxis.estimators.relocate.memory import widened
from flexaxis.estimators.sampling.pattern import split

Array = NDArray[np.float64]


def forgetful_rpem(
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
) -> CompiledFilter:
    """
    Make a prediction-error method with another rule of forgetting; it claims R̂ P/2.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    rule : {"vector", "directional", "efra", "variable", "cusum"}
        A factor for each parameter; forgetting along the gradient only; exponential forgetting and
        resetting; a factor that follows the residual; P reset when a CUSUM raises an alarm.
        The modules of `flexaxis.estimators.methods.rules` have equations and sources.
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

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
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
    pattern, coefficients = split(design.model)
    tuning, start = filter_records(design, pattern, coefficients)
    tuning = widened(tuning, rule_tuning_type(pattern))
    factors = np.full(pattern.p, design.forgetting) if rates is None else np.asarray(rates, float)
    if factors.shape != (pattern.p,) or not np.all((factors > 0) & (factors <= 1)):
        raise EstimatorError(f"rates are {rates!r}; give a factor in (0, 1] for each parameter")
    if not reset > 0:
        raise EstimatorError(f"reset is {reset}; it must be above 0")
    tuning["correct"] = float(rule == "cusum")  # P is large: the state has to follow
    tuning["rule"], tuning["rates"] = RULES.index(rule), factors
    wide = np.diag((reset * design.theta0 / 0.1) ** 2)
    tuning["reset_P"] = np.diag(np.diag(design.P0)) * 10 if rule == "efra" else wide
    tuning["level"] = (10.0 if rule == "cusum" else 2.0) if level is None else level
    start = widened(start, rule_state_type(pattern))
    return CompiledFilter(rule_loop(pattern), tuning, start, design, _read)


def _read(state: NDArray[np.void]) -> tuple[Array, Array]:
    return state["theta"][0], state["noise"][0] * state["P"][0] / 2
