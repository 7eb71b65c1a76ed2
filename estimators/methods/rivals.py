"""How the registered rivals of the paper's method are made, as `methods.recipes`."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.recipes import DEFAULT_IDENTIFY, forgetting_P, model_of
from flexaxis.estimators.models.model import Model

if TYPE_CHECKING:
    from flexaxis.estimators.recursion.filter import CompiledFilter


def joint(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    walk: float = 0.002,
    noise: float | None = None,
    spread: float = 0.2,
    unscented: bool = False,
) -> "CompiledFilter":
    """
    Make a joint Kalman filter, extended or unscented.

    Parameters
    ----------
    walk : float
        Standard deviation of the random walk of every θ after a second, relative to θ(0).
    noise : float, optional
        Standard deviation of the output, in its unit; else it is learnt from the innovations.
    spread : float
        Standard deviation of θ(0), relative to it.
    """
    from flexaxis.estimators.methods.ekf import joint_ekf
    from flexaxis.estimators.methods.ukf import joint_ukf

    model = model_of(nominal)
    P0, drift = _walk(model, identify, period, walk=walk, spread=spread)
    return (joint_ukf if unscented else joint_ekf)(
        model, identify=identify, P0=P0, drift=drift, noise=noise, period=period, output=output
    )


def imm(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    walk: float = 0.002,
    noise: float | None = None,
    spread: float = 0.2,
    jump: float = 0.1581,
    rate: float = 1e-3,
    hold: float = 0.05,
) -> "CompiledFilter":
    """
    Make the interacting-multiple-model filter.

    Parameters
    ----------
    walk, noise, spread : float
        As for `joint`; walk is that of the quiet mode.
    jump : float
        Standard deviation of a jump of θ_i, relative to θ(0).
    rate, hold : float
        How often a jump comes [1/s], and how long it lasts on average [s].
    """
    from flexaxis.estimators.methods.imm import joint_imm

    model = model_of(nominal)
    P0, drift = _walk(model, identify, period, walk=walk, spread=spread)
    return joint_imm(
        model,
        identify=identify,
        P0=P0,
        drift=drift,
        jump=period / hold * (jump * model.parametrize(identify).theta) ** 2,
        rate=rate,
        hold=hold,
        noise=noise,
        period=period,
        output=output,
    )


def _walk(
    model: Model, identify: Sequence[str], period: float, *, walk: float, spread: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return P(0) and W, from deviations relative to θ(0)."""
    if not walk > 0 or not spread > 0:
        raise EstimatorError(f"walk is {walk} and spread {spread}; both must be above 0")
    theta = model.parametrize(identify).theta
    return (spread * theta) ** 2, period * (walk * theta) ** 2


def forgetful(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    rule: str,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
    reset: float = 0.1,
    level: float = 10.0,
) -> "CompiledFilter":
    """Make a method with another rule of forgetting; "vector" forgets f_m at half the rate."""
    from flexaxis.estimators.methods.forgetful import forgetful_rpem

    model = model_of(nominal)
    slow = [1 - (1 - forgetting) * (0.5 if name == "f_m" else 1.0) for name in identify]
    return forgetful_rpem(
        model,
        rule=rule,
        identify=identify,
        P0=forgetting_P(
            P0, torque, model, identify, period=period, forgetting=forgetting, output=output
        ),
        period=period,
        forgetting=forgetting,
        rates=slow if rule == "vector" else None,
        reset=reset,
        level=level if rule == "cusum" else None,
        output=output,
    )


def horizon(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
    window: float = 1.0,
    every: float = 0.05,
) -> "CompiledFilter":
    """
    Make the least-squares fit over a moving window.

    Parameters
    ----------
    forgetting : float
        λ, of what lies before the window.
    window, every : float
        Length of a window, and from one to the next, of which it is a multiple [s].
    """
    from flexaxis.estimators.methods.moving_horizon import moving_horizon

    model = model_of(nominal)
    samples = max(1, round(every / period)) if np.isfinite(every) else 0
    return moving_horizon(
        model,
        identify=identify,
        P0=forgetting_P(
            P0, torque, model, identify, period=period, forgetting=forgetting, output=output
        ),
        period=period,
        forgetting=forgetting,
        window=samples * _multiple(window, every),
        every=samples,
        output=output,
    )


def _multiple(window: float, every: float) -> int:
    """Return how often ``every`` goes into ``window``, twice at least."""
    ratio = window / every if every > 0 else np.nan
    if not (np.isfinite(ratio) and ratio > 1.5 and abs(ratio - round(ratio)) < 1e-6):
        raise EstimatorError(
            f"window is {window} and every {every}; the window is a multiple of every, both in "
            "seconds, such as 1.0 and 0.05"
        )
    return round(ratio)
