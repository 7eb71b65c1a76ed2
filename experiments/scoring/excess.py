"""Compute the excess error: the part of the prediction error that is due to parameter errors."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.scoring.bounds import noise_variance
from flexaxis.experiments.scoring.nominal_torque import nominal_torque
from flexaxis.experiments.scoring.parameter_names import nominal_theta, started_theta, true_theta
from flexaxis.experiments.scoring.scores import Track, finite
from flexaxis.experiments.scoring.true_model import linear_model, reads_encoder
from flexaxis.experiments.scoring.windows import remembered
from flexaxis.sim.parameters import LAW_NAMES
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

STEADY = 20.0  # time at the end of the nominal run over which ψψᵀ is averaged [s]


@remembered
def information(scenario: Scenario) -> Array | None:
    """Return the weighting matrix M (p, p) of the excess error θ̃ᵀMθ̃, with θ̃ in % of nominal.

    The excess error is the increase in the mean squared prediction error due to small errors in θ̂,
    divided by the noise variance. The excess error depends neither on the units nor on the choice
    of the parameters. The matrix M is E ψψᵀ/σ², where σ² is the noise variance. The predictor
    gradient ψ is taken with respect to all identified parameters, in % of nominal. The expectation
    E is a steady-state time average for the nominal axis during the scenario's reference motion.
    The model is linear, so the rows and columns of M for parameters of nonlinear laws are zero. The
    function returns None if there is no noise, or if the scenario identifies only parameters of
    nonlinear laws.
    """
    variance = noise_variance(scenario)
    if reads_encoder(scenario):  # predictors read the increments of an angle
        variance *= 2 / scenario.period**2
    linear = [name for name in scenario.identify if name not in LAW_NAMES]
    if not variance > 0 or not linear:
        return None
    model = linear_model(scenario, scenario.nominal).parametrize(linear)
    _, psi = predict(model, model.theta, nominal_torque(scenario), period=scenario.period)
    scaled = np.zeros((len(psi), len(scenario.identify)))
    places = [scenario.identify.index(name) for name in linear]
    scaled[:, places] = psi * abs(nominal_theta(scenario, linear)) / 100
    scaled = scaled[-round(STEADY / scenario.period) :]
    information: Array = scaled.T @ scaled / len(scaled) / variance
    return information


def excess_of(track: Track, i: int) -> float | None:
    """Return the mean excess error θ̃ᵀMθ̃ before the fault; all parameters have the same value."""
    del i
    M = information(track.scenario)
    if M is None or not track.quiet.size:
        return None
    asked = track.scenario.identify
    columns = track.scenario.parameter_names
    truth = true_theta(asked, track.true_parameters[track.quiet], columns)
    nominal = nominal_theta(track.scenario, asked)
    # A parameter that the estimator does not estimate keeps its initial value.
    error = 100 * (started_theta(track.scenario, asked) - truth) / abs(nominal)
    for column, name in enumerate(asked):
        if name in track.names:
            error[:, column] = track.percent[track.quiet, track.names.index(name)]
    each = np.einsum("ki,ij,kj->k", error, M, error)
    if track.lost is not None:  # errors of a diverged run must not cancel
        gone = track.quiet >= track.lost
        each[gone] = np.einsum("ki,ij,kj->k", abs(error[gone]), abs(M), abs(error[gone]))
    return finite(each.mean())
