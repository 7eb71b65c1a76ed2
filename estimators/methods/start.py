"""What the registered estimators start from: a model, λ, and P(0) by the paper's recipe."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import PAPER, three_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import (
    Design,
    above_zero,
    forgetting_factor,
    make_design,
)
from flexaxis.estimators.tuned import tuned

Array = NDArray[np.float64]
Nominal = Mapping[str, float] | Model

ROBUST = 30.0  # standard deviations from which on a residual can only be an outlier: a fault that
# the suite knows makes ten at most, and one outlier at this limit moves no parameter by 2 %
CALM = 1e-3  # (Δθ/θ(0))², ceiling of R̂ P_ii: a deviation of 3 %, from which an axis is followed
# after a standstill. From 10 % and more one restart in ten ends in a local minimum or at the box;
# of 320 from 3 % none did (two axes, five kinds of standstill, seeds 0 to 15)


def model_of(nominal: Nominal) -> Model:
    """Return the model to use: that of the paper's axis, unless another one is given."""
    return nominal if isinstance(nominal, Model) else three_mass(nominal)


def factor(
    name: str, forgetting: float | None, model: Model, period: float, identify: Sequence[str]
) -> float:
    """Return λ: as given, as tuned for this axis, or that of a time constant of 1 s."""
    above_zero("period", period, "the sampling period in seconds")
    if forgetting is None:
        forgetting = tuned(name, model, period, identify)
    return forgetting_factor(forgetting, period)


def forgetting_P(
    given: ArrayLike | None,
    torque: ArrayLike | None,
    model: Model,
    identify: Sequence[str] = PAPER,
    *,
    period: float,
    forgetting: float,
    output: str,
) -> ArrayLike:
    """Return P(0) for a forgetting factor: as given, or by the recipe, or as is known."""
    from flexaxis.estimators.offline import priors

    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=forgetting,
        output=output,
    )
    known = priors.stored_P(model, identify, period, forgetting=forgetting)
    return initial_P(given, torque, recipe, known)


def forgetting_design(
    name: str,
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str],
    output: str,
    P0: ArrayLike | None,
    torque: ArrayLike | None,
    forgetting: float | None,
    noise: float | None,
) -> Design:
    """Return what a registered method with a forgetting factor starts from, options checked."""
    model = model_of(nominal)
    weight = factor(name, forgetting, model, period, identify)
    P = forgetting_P(P0, torque, model, identify, period=period, forgetting=weight, output=output)
    return make_design(
        model,
        identify=identify,
        theta0=None,
        P0=P,
        period=period,
        forgetting=weight,
        output=output,
        noise=noise,
    )


def initial_P(
    given: ArrayLike | None,
    torque: ArrayLike | None,
    recipe: Callable[[ArrayLike], Array],
    known: Array | None,
) -> ArrayLike:
    """Return P(0): as given, or by a recipe on a torque, or as is known."""
    if given is not None:
        return given
    if torque is not None:
        return recipe(torque)
    if known is not None:
        return known
    raise EstimatorError(
        f"P(0) is known only for {', '.join(PAPER)} of the nominal axis at 5 ms; for another "
        "axis, other parameters or another period give P0, or the torque of a nominal run for the "
        "recipe"
    )


def random_walk(
    name: str,
    usual: float,
    model: Model,
    identify: Sequence[str],
    period: float,
    *,
    walk: float | None,
    spread: float,
) -> tuple[Array, Array]:
    """Return P(0) and W from deviations relative to θ(0); ``usual`` is the walk where untuned."""
    above_zero("period", period, "the sampling period in seconds")
    if walk is None:
        walk = tuned(name, model, period, identify) or usual
    above_zero("walk", walk, "the standard deviation of θ after a second, relative to θ(0)")
    above_zero("spread", spread, "the standard deviation of θ(0), relative to it")
    theta = model.parametrize(identify).theta
    return (spread * theta) ** 2, period * (walk * theta) ** 2
