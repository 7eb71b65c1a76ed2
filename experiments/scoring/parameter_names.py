"""Map the names of estimated parameters θ to physical parameters and models."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axis_models import MODELS
from flexaxis.estimators.models.model import Model
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import Scenario


def physical(name: str) -> tuple[str, int]:
    """Return the physical parameter and its exponent, such as J_a and −1 for the name "1/J_a"."""
    return (name[2:], -1) if name.startswith("1/") else (name, 1)


def true_theta(
    names: Sequence[str],
    parameters: NDArray[np.float64],
    columns: Sequence[str] = PARAMETER_NAMES,
) -> NDArray[np.float64]:
    """Return the true estimated parameters (…, p), given all physical parameters (…, P).

    The argument `columns` lists the names of the physical parameters. By default, `columns`
    contains the parameters of the three-mass axis.
    """
    powers = [physical(name) for name in names]
    return np.stack([parameters[..., columns.index(p)] ** float(e) for p, e in powers], axis=-1)


def nominal_theta(scenario: Scenario, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the true values (p,) of the estimated parameters before any fault."""
    return true_theta(names, scenario.unchanged, scenario.parameter_names)


def theta_over_time(scenario: Scenario, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the true values (N, p) of the estimated parameters at every sample."""
    return true_theta(names, scenario.true_parameters(), scenario.parameter_names)


def known_names(scenario: Scenario, names: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters whose initial value is nonzero, because errors are divided by it."""
    return tuple(name for name in names if scenario.initial.get(physical(name)[0]))


def started_nominal(scenario: Scenario) -> dict[str, float]:
    """Return the nominal values that an estimator receives.

    The nominal value of an identified parameter is its true initial value times the factor `start`.
    The nominal value of any other parameter is its true initial value times its factor in `known`,
    which is 1 by default. The nominal values also include data-sheet values. Estimators do not know
    which nonlinear laws act on the axis. Therefore the parameters of a nonlinear law are included
    only if `known` contains them.
    """
    values = scenario.nominal.as_dict()
    for parameter, factor in scenario.known_factors.items():
        values[parameter] = factor * values.get(parameter, scenario.laws.get(parameter, np.nan))
    for name in scenario.identify:
        parameter, exponent = physical(name)
        if parameter in scenario.nominal:
            values[parameter] *= scenario.start ** float(exponent)
    return values | scenario.data_sheet


def started_theta(scenario: Scenario, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the initial estimates θ(0) (p,) of an estimator that starts at its nominal values.

    If a nonlinear-law parameter has no nominal value, its initial estimate is its true value.
    """
    told = scenario.laws | started_nominal(scenario)
    columns = scenario.parameter_names
    return true_theta(names, np.array([told[name] for name in columns]), columns)


def has_model(scenario: Scenario) -> bool:
    """Return whether an estimator model has the same name and parameters as the plant."""
    shipped = MODELS.get(scenario.model)
    return shipped is not None and set(shipped.factory(shipped.rough).parameters) == set(
        scenario.nominal
    )


def check_model(scenario: Scenario) -> None:
    """Raise a ScenarioError if no estimator model describes the plant."""
    if not has_model(scenario):
        raise ScenarioError(
            f"{scenario.name}: estimators have no model {scenario.model} with the parameters "
            f"{', '.join(scenario.nominal)}. Estimates and bounds need a model with all parameters "
            "of the plant. Add a model to estimators/models/axis_models.py (see docs/extending.md) "
            "or use `flexaxis simulate`, which needs no model, to record only the plant"
        )


def axis_model(scenario: Scenario, values: Mapping[str, float]) -> Model:
    """Return the linear model that estimators use for a plant; raise an error if there is none."""
    check_model(scenario)
    return MODELS[scenario.model].factory(values)
