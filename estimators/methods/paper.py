"""The paper's method as it is registered: with forgetting, with drift, regularised, corrected."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.methods.start import (
    CALM,
    ROBUST,
    Nominal,
    factor,
    forgetting_P,
    initial_P,
    model_of,
)
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.recursion.design import above_zero, at_least_zero, covariance_matrix


def rpem_forgetting(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float | None = None,
    regularization: float = 0.0,
    noise: float | None = None,
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
    noise, robust, ceiling
        As for `Rpem`.
    """
    model = model_of(nominal)
    weight = factor("rpem-forgetting", forgetting, model, period, identify)
    P = forgetting_P(P0, torque, model, identify, period=period, forgetting=weight, output=output)
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    diagonal = np.diag(covariance_matrix("P0", P, len(identify)))
    return Rpem(
        model,
        identify=identify,
        P0=P,
        period=period,
        forgetting=weight,
        regularization=share * (1 - weight) / diagonal,
        output=output,
        noise=noise,
        robust=robust,
        ceiling=ceiling,
    )


def rpem_corrected(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float | None = None,
    noise: float | None = None,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> Rpem:
    """
    Make the method with a forgetting factor and state correction.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    noise, robust, ceiling
        As for `Rpem`.
    """
    model = model_of(nominal)
    weight = factor("rpem-corrected", forgetting, model, period, identify)
    P = forgetting_P(P0, torque, model, identify, period=period, forgetting=weight, output=output)
    return Rpem(
        model,
        identify=identify,
        P0=P,
        period=period,
        forgetting=weight,
        output=output,
        noise=noise,
        state_correction=True,
        robust=robust,
        ceiling=ceiling,
    )


def rpem_drift(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    scale: float = 1.0,
    regularization: float = 0.0,
    noise: float | None = None,
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
    noise, robust, ceiling
        As for `Rpem`.
    """
    from flexaxis.estimators.offline import priors

    model = model_of(nominal)
    above_zero("period", period, "the sampling period in seconds")
    above_zero("scale", scale, "the factor on Δ")
    share = at_least_zero("regularization", regularization, "a share of the information in P(0)")
    drift = scale * priors.default_drift(model, identify, period, torque=torque, output=output)
    recipe = partial(
        priors.nominal_P, model, identify=identify, period=period, drift=drift, output=output
    )
    known = priors.stored_P(model, identify, period, forgetting=None, scale=scale)
    P = initial_P(P0, torque, recipe, known)
    diagonal = np.diag(covariance_matrix("P0", P, len(identify)))
    return Rpem(
        model,
        identify=identify,
        P0=P,
        period=period,
        drift=drift,
        regularization=share * drift / diagonal**2,
        output=output,
        noise=noise,
        robust=robust,
        ceiling=ceiling,
    )


REGULARIZATION = 0.01  # P below 100 P(0), or 10: no deviation beyond ten times that of the start

ENTRIES = (
    Entry(
        "rpem-forgetting",
        "the paper's method with a forgetting factor, eq. (13)",
        rpem_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=1,
    ),
    Entry(
        "rpem-drift",
        "the paper's method with covariance modification, eq. (14), (32)",
        rpem_drift,
        knob="scale",
        default=1.0,
        rank=2,
    ),
    Entry(
        "rpem-forgetting-mu",
        "rpem-forgetting, regularised against standstill, eq. (12)",
        partial(rpem_forgetting, regularization=REGULARIZATION),
        knob="1-forgetting",
        default=0.995,
        rank=3,
    ),
    Entry(
        "rpem-drift-mu",
        "rpem-drift, regularised against standstill, eq. (12)",
        partial(rpem_drift, regularization=REGULARIZATION),
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
