"""Build the model with the true laws and parameters of an axis, and differentiate its output."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.axis_models import (
    BRISTLES,
    COGGING,
    GEAR_FRICTION,
    GEAR_SPRING,
    LIMIT,
    STATIC,
    with_angle,
)
from flexaxis.estimators.models.discretisation import law_steps
from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.simulation import along, simulation
from flexaxis.estimators.signals import SIGNALS, counted_angle
from flexaxis.experiments.scoring.parameter_names import axis_model, has_model, true_theta
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

STIFF = 1e5  # bristle stiffness for Coulomb friction [N m/rad]; 1e4 changes a bound by 1–2 %


@dataclass(frozen=True)
class Described:
    """Nonlinear law by which the estimators' models represent one scenario table.

    Attributes
    ----------
    law : Law
        Nonlinear law that represents the scenario table in the estimators' models.
    values : callable
        The call ``values(table)`` returns the law parameters that are not plant parameters.
    beside : tuple of Law
        Other nonlinear laws that the model needs in order to describe the scenario table. For
        example, gear friction depends on the load torque, which the spring law provides.
    """

    law: Law
    values: Callable[[Any], Mapping[str, float]]
    beside: tuple[Law, ...] = ()


PRIOR = 0.5  # relative standard deviation of a parameter before the first measurement
PHASES = ("c_sin", "c_cos")
SHARES = ("mu_m", "mu_e", "mu_ms", "mu_es", "sharpness")
COULOMB = {"f_s": 0.0, "v_s": 0.0, "sigma_0": STIFF, "sigma_1": 0.0, "v_0": 0.0}


def _shares(table: Any) -> dict[str, float]:
    """Return the parameters of load-dependent friction that are not plant parameters."""
    shares = {"mu_m": table.motor, "mu_e": table.external}
    slow = {"mu_ms": table.motor_slow, "mu_es": table.external_slow}
    return shares | slow | {"sharpness": table.alpha}


DESCRIBED: Mapping[str, Described] = {
    "friction": Described(BRISTLES, lambda table: COULOMB),
    "lugre": Described(BRISTLES, lambda table: {"v_0": 0.0}),
    "static_friction": Described(STATIC, lambda table: {}),
    "gear_friction": Described(
        GEAR_FRICTION,
        lambda table: _shares(table) | {"v_0": table.smooth, "kappa": 0.0, "gap": 0.0},
        (GEAR_SPRING,),
    ),
    "stiffening": Described(GEAR_SPRING, lambda table: {"gap": 0.0}),
    "backlash": Described(GEAR_SPRING, lambda table: {"kappa": 0.0}),
    "cogging": Described(
        COGGING,
        lambda table: {"c_sin": table.amplitude, "c_cos": 0.0, "poles": float(table.poles)},
    ),
    "saturation": Described(LIMIT, lambda table: {"torque_limit": table.torque}),
}
"""Nonlinear laws that represent scenario tables in the estimators' models, keyed by table name."""

DRY = ("friction", "lugre", "static_friction", "gear_friction")
"""Names of the scenario tables with dry friction; a model can describe only one of them."""


def describes(scenario: Scenario) -> bool:
    """Return whether a model with the true parameters describes a scenario's records exactly."""
    tables = scenario.tables
    known = has_model(scenario) and all(t.exact or key in DESCRIBED for key, t in tables.items())
    return known and sum(key in tables for key in DRY) <= 1


def reads_encoder(scenario: Scenario) -> bool:
    """Return whether estimators read an encoder angle or angle increments."""
    return scenario.output in {"angle", "increment"}


def linear_model(scenario: Scenario, values: Mapping[str, float]) -> Model:
    """Return the linear model of an axis whose output is the signal that the predictors use."""
    return SIGNALS[scenario.output].predicted(axis_model(scenario, values), scenario.period)


def true_model(scenario: Scenario, parameters: Array) -> Model:
    """Return the axis model with its nonlinear laws; the output is a speed or an encoder angle."""
    laws: list[Law] = []
    for part in _described(scenario).values():
        laws += [law for law in (part.law, *part.beside) if law not in laws]
    model = axis_model(scenario, _values(scenario, parameters))
    if COGGING in laws:
        model = with_angle(model)
    model = replace(model, laws=tuple(laws)) if laws else model
    return counted_angle(model) if reads_encoder(scenario) else model


def _values(scenario: Scenario, parameters: Array) -> dict[str, float]:
    """Return the values of all model parameters, given the plant parameters (P,)."""
    values: dict[str, float] = {}
    for key, part in _described(scenario).items():
        values |= part.values(scenario.tables[key])
    return values | dict(zip(scenario.parameter_names, parameters.tolist(), strict=True))


def model_theta(scenario: Scenario, names: Sequence[str], parameters: Array) -> Array:
    """Return the values (p,) of the estimated parameters, given the plant parameters (P,)."""
    values = _values(scenario, parameters)
    return true_theta(names, np.array(list(values.values())), tuple(values))


def tracked(scenario: Scenario, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of all parameters unknown after a jump, including Coulomb friction f_c."""
    return (*names, *(name for name in ("f_c",) if name in scenario.laws and name not in names))


def untold(scenario: Scenario, names: Sequence[str]) -> dict[str, float]:
    """Return the prior relative errors of all parameters that estimators do not know exactly.

    The result does not contain the parameters in `names`. A prior error is the prior standard
    deviation of a parameter divided by its value. For parameters that estimators know with an
    error, the prior error is the rms relative error of all known values. For other parameters of
    nonlinear laws, the prior error has the default value `PRIOR`.
    """
    model, factors = true_model(scenario, scenario.unchanged), scenario.known_factors
    error = float(np.sqrt(np.mean(np.square(np.log([1.0, *factors.values()])))))
    errors = dict.fromkeys((*scenario.laws, *SHARES, *PHASES), PRIOR)
    errors |= {name: error if x != 1 else 0.0 for name, x in factors.items()}
    errors |= {name.removeprefix("1/"): 0.0 for name in names}
    return {n: errors[n] for n in model.parameters if errors.get(n) and model.nominal[n]}


def sizes(scenario: Scenario, names: Sequence[str], theta: Array) -> Array:
    """Return the scales of the parameters (p,), by which prior standard deviations are divided.

    The scale of a parameter is its value in `theta`. If the value is zero, the scale is the initial
    value of the parameter. If a cogging coefficient is zero, its scale is the initial cogging
    amplitude.
    """
    nominal = np.array(list(scenario.initial.values()))
    values = _values(scenario, nominal)
    cogging = np.hypot(values.get("c_sin", 0.0), values.get("c_cos", 0.0))
    before = [
        cogging if name in PHASES else size
        for name, size in zip(names, model_theta(scenario, names, nominal), strict=True)
    ]
    return np.where(theta == 0, before, theta)


def _described(scenario: Scenario) -> dict[str, Described]:
    return {key: DESCRIBED[key] for key in scenario.tables if key in DESCRIBED}


FINER = 2
"""Number of integration steps per sample, divided by the number in estimators with nonlinear laws.

With twice as many steps as in the estimators, the errors of the bounds are at most 3 % in tests.
Coulomb friction is an exception, because it is almost discontinuous. The lag bound for Coulomb
friction differs by up to 7 % from the lag bound with 16 times as many steps.
"""


def jump_gradient(
    model: Parametrization,
    theta: ArrayLike,
    u: ArrayLike,
    x: ArrayLike,
    *,
    period: float,
) -> Array:
    """
    Return the predictor gradient ψ₀ (N, p) at the first N samples after a jump.

    The state at the jump does not depend on the new θ, so the sensitivities of the state to θ start
    at zero. As a result, the data provide information about θ more slowly than in steady state.

    Parameters
    ----------
    model : Parametrization
        Model with the parameters that are unknown after the jump.
    theta : (p,) array_like
        Parameters after the jump.
    u : (N,) array_like
        Torque after the jump [N m].
    x : (n,) array_like
        State of the model at the jump, including the states of nonlinear laws.
    period : float
        Sampling period T [s].
    """
    return _travel(model, theta, u, x, period)[0]


def _travel(
    model: Parametrization, theta: ArrayLike, u: ArrayLike, x: ArrayLike, period: float
) -> tuple[Array, Array]:
    """Return the predictor gradient (N, p) and the final state (n,) for a torque (N,)."""
    steps = FINER * law_steps(model, period)
    simulated = simulation(model, theta, period, steps=steps)
    X = simulated["X"]  # the derivatives with respect to θ start at zero
    X[: model.states, 0] = x
    gradient = np.zeros((len(u), len(model.names)))  # type: ignore[arg-type]
    gradient[1:] = along(simulated, np.ascontiguousarray(u, float))[:-1, 1 : 1 + len(model.names)]
    return gradient, X[: model.states, 0]


def state_at(scenario: Scenario, truth: Array, u: Array, index: int) -> Array:
    """Return the true state (n,) at a sample, including the effects of earlier parameter changes.

    The function simulates the model from rest, with the true parameters (N, P) and the torque (N,)
    of a record.
    """
    edges = [0, *(np.flatnonzero((np.diff(truth[:index], axis=0) != 0).any(axis=1)) + 1), index]
    x = np.zeros(true_model(scenario, truth[0]).parametrize(["k_T"]).states)
    for first, last in pairwise(edges):
        model = true_model(scenario, truth[first]).parametrize(["k_T"])
        x = _travel(model, model.theta, u[first:last], x, scenario.period)[1]
    return x
