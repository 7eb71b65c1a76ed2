"""The paper's method as it is registered: with forgetting, with drift, regularised, corrected."""

from functools import partial

import numpy as np

from flexaxis.estimators.filters.design import above_zero, at_least_zero, covariance_matrix
from flexaxis.estimators.filters.prediction_error import CALM, ROBUST
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry


def _rpem_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    regularization: float = 0.0,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> Rpem:
    """
    Make the method with forgetting factor λ, eq. (13).

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    regularization : float
        m of μ_i = m (1−λ)/P(0)_ii, which keeps P_ii below P(0)_ii/m: free of units.
    robust, ceiling
        As for `Rpem`.
    """
    weight = problem.factor("rpem-forgetting", forgetting)
    P = problem.forgetting_P(weight)
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    diagonal = np.diag(covariance_matrix("P0", P, len(problem.identify)))
    return Rpem(
        problem.model,
        **problem.asked,
        P0=P,
        forgetting=weight,
        regularization=share * (1 - weight) / diagonal,
        robust=robust,
        ceiling=ceiling,
    )


def rpem_corrected(
    problem: Problem,
    *,
    forgetting: float | None = None,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> Rpem:
    """
    Make the method with a forgetting factor and state correction.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    robust, ceiling
        As for `Rpem`.
    """
    weight = problem.factor("rpem-corrected", forgetting)
    P = problem.forgetting_P(weight)
    return Rpem(
        problem.model,
        **problem.asked,
        P0=P,
        forgetting=weight,
        state_correction=True,
        robust=robust,
        ceiling=ceiling,
    )


def _rpem_drift(
    problem: Problem,
    *,
    scale: float = 1.0,
    regularization: float = 0.0,
    robust: float = ROBUST,
    ceiling: float = 10 * CALM,
) -> Rpem:
    """
    Make the method with covariance modification by ``scale`` times Δ, eq. (14), (32).

    Parameters
    ----------
    scale : float
        Factor on Δ.
    regularization : float
        m of μ_i = m Δ_ii/P(0)_ii², which keeps P_ii below P(0)_ii/√m: free of units.
    robust, ceiling
        As for `Rpem`.
    """
    from flexaxis.estimators.offline import priors

    above_zero("scale", scale, "the factor on Δ")
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    axis = problem.model, problem.identify, problem.period
    drift = scale * priors.default_drift(*axis, torque=problem.torque, output=problem.output)
    known = priors.stored_P(*axis, forgetting=None, scale=scale)
    P = problem.initial_P(known, drift=drift)
    diagonal = np.diag(covariance_matrix("P0", P, len(problem.identify)))
    return Rpem(
        problem.model,
        **problem.asked,
        P0=P,
        drift=drift,
        regularization=share * drift / diagonal**2,
        robust=robust,
        ceiling=ceiling,
    )


REGULARIZATION = 0.01  # P below 100 P(0), or 10: no deviation beyond ten times that of the start

ENTRIES = (
    Entry(
        "rpem-forgetting",
        "the paper's method with a forgetting factor, eq. (13)",
        _rpem_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=1,
    ),
    Entry(
        "rpem-drift",
        "the paper's method with covariance modification, eq. (14), (32)",
        _rpem_drift,
        knob="scale",
        default=1.0,
        rank=2,
    ),
    Entry(
        "rpem-forgetting-mu",
        "rpem-forgetting, regularised against standstill, eq. (12)",
        partial(_rpem_forgetting, regularization=REGULARIZATION),
        knob="1-forgetting",
        default=0.995,
        rank=3,
    ),
    Entry(
        "rpem-drift-mu",
        "rpem-drift, regularised against standstill, eq. (12)",
        partial(_rpem_drift, regularization=REGULARIZATION),
        knob="scale",
        default=1.0,
        rank=4,
    ),
    Entry(
        "rpem-corrected",
        "rpem-forgetting whose state follows every change of its parameters",
        rpem_corrected,
        knob="1-forgetting",
        default=0.995,
        rank=5,
    ),
)
