"""What theory allows after a jump of the live axis: the Cramér–Rao bound, as the scores have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.demo.racer import NAMES
from flexaxis.experiments.scoring.bounds import cramer_rao, lag_bound
from flexaxis.experiments.scoring.described import model_theta, sizes, tracked, true_model
from flexaxis.experiments.scoring.true_path import jump_gradient
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Jump:
    """A jump of one parameter, and where the axis was.

    Attributes
    ----------
    scenario : Scenario
        Laws of the axis.
    values : mapping of str to float
        All parameters after it.
    parameter : str
        The tracked parameter that has jumped, such as ``"1/J_a"``.
    size : float
        D = |θ_after − θ_before|.
    state : ndarray (5,)
        Of the axis, as `LiveAxis.state`; bristles begin anew, for they forget in milliseconds.
    noise : float
        Standard deviation of the measured speed [rad/s], more than zero.
    """

    scenario: Scenario
    values: Mapping[str, float]
    parameter: str
    size: float
    state: Array
    noise: float


@dataclass(frozen=True)
class Allowed:
    """Bounds after a jump.

    Attributes
    ----------
    error : ndarray (n, 2)
        Mean size of the error over that of the jump, n samples after it: for whoever knows which
        parameter has jumped, and for whoever does not.
    lag : tuple of float
        The same two, as lags up to the last of the samples [s].
    """

    error: Array
    lag: tuple[float, float]


def allowed(jump: Jump, torque: ArrayLike) -> Allowed:
    """Return what noise allows to whoever is told time and state of a jump.

    Parameters
    ----------
    jump : Jump
    torque : (n,) array_like
        Command from the jump on [N m].
    """
    scenario, names = jump.scenario, tracked(jump.scenario, NAMES)
    parameters = np.array([jump.values[name] for name in scenario.parameter_names])
    model = true_model(scenario, parameters).parametrize(names)
    theta = model_theta(scenario, names, parameters)
    x = np.zeros(model.states)
    x[: len(jump.state)] = jump.state
    psi = jump_gradient(model, theta, torque, x, period=PERIOD)
    scale, i = sizes(scenario, names, theta), names.index(jump.parameter)
    single = cramer_rao(psi[:, [i]], jump.noise**2, scale[[i]])[:, 0, 0]
    unknown = cramer_rao(psi, jump.noise**2, scale)[:, i, i]
    deviations = np.sqrt(np.stack([single, unknown], axis=1))
    lags = [lag_bound(each, jump.size, period=PERIOD) for each in deviations.T]
    error = np.minimum(1.0, np.sqrt(2 / np.pi) * deviations / jump.size)
    return Allowed(error=error, lag=(lags[0], lags[1]))
