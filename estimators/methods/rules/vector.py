"""
A forgetting factor for each parameter: P_ij ← P_ij/√(λ_i λ_j).

S. Sælid and B. Foss, *Adaptive controllers with a vector variable forgetting factor*, 22nd IEEE
Conference on Decision and Control (1983) 1488–1494.
"""

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import finite_vector
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetful import VECTOR, forgetful_filter
from flexaxis.estimators.filters.prediction_error import CALM, ROBUST
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

TIE = 1e-6  # relative; of parameters of which P(0) knows equally little none is the one


@inlined
def forget_each(state):
    """Do the time update."""
    P, rates = state.P, state.rates
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= np.sqrt(rates[i] * rates[j])


def _vector_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    rates: ArrayLike | None = None,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> CompiledFilter:
    """
    Make the method with a factor for each parameter.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    rates : (p,) array_like, optional
        1−λ_i over 1−λ: by default 1, and 1/2 for the parameter of
        which P(0) knows least, if that is one.
    robust, ceiling
        As for `flexaxis.estimators.Rpem`.
    """
    design = problem.forgetting_design("vector-forgetting", forgetting)
    if rates is None:  # in relative parameters, so that units do not choose
        share = np.diag(design.P0) / np.diag(design.P0).max()
        least = share >= 1 - TIE
        rates = np.where(least, 0.5 if least.sum() == 1 else 1.0, 1.0)
    factors = 1 - (1 - design.forgetting) * finite_vector("rates", rates, len(problem.identify))
    if not np.all((factors > 0) & (factors <= 1)):
        raise EstimatorError(
            f"rates are {rates!r}; give one for each parameter, with 1 − (1−λ) rate in (0, 1]"
        )
    return forgetful_filter(design, VECTOR, robust=robust, ceiling=ceiling, rates=factors)


ENTRIES = (
    Entry(
        "vector-forgetting",
        "a forgetting factor for each parameter",
        _vector_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=20,
    ),
)
