"""How the registered rivals of the paper's method are made, as `methods.recipes`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.start import Nominal, factor, forgetting_P, model_of
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import above_zero
from flexaxis.estimators.tuned import tuned

if TYPE_CHECKING:
    from flexaxis.estimators.recursion.filter import CompiledFilter


def extended(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    walk: float | None = None,
    noise: float | None = None,
    spread: float = 0.2,
) -> "CompiledFilter":
    """
    Make the joint extended Kalman filter.

    Parameters
    ----------
    P0, torque
        Taken as by every entry, and left: P(0) is that of ``spread``.
    walk : float
        Standard deviation of the random walk of every θ after a second, relative to θ(0).
    noise : float, optional
        Standard deviation of the output, in its unit; else it is learnt from the innovations.
    spread : float
        Standard deviation of θ(0), relative to it.
    """
    from flexaxis.estimators.methods.ekf import joint_ekf

    model = model_of(nominal)
    prior, drift = _walk("ekf", model, identify, period, walk=walk, spread=spread)
    return joint_ekf(
        model, identify=identify, P0=prior, drift=drift, noise=noise, period=period, output=output
    )


def unscented(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    walk: float | None = None,
    noise: float | None = None,
    spread: float = 0.2,
) -> "CompiledFilter":
    """
    Make the joint unscented Kalman filter.

    Parameters
    ----------
    P0, torque, walk, noise, spread
        As for `extended`.
    """
    from flexaxis.estimators.methods.ukf import joint_ukf

    model = model_of(nominal)
    prior, drift = _walk("ukf", model, identify, period, walk=walk, spread=spread)
    return joint_ukf(
        model, identify=identify, P0=prior, drift=drift, noise=noise, period=period, output=output
    )


def imm(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    walk: float | None = None,
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
    P0, torque, walk, noise, spread
        As for `extended`; walk is that of the quiet mode.
    jump : float
        Standard deviation of a jump of θ_i, relative to θ(0).
    rate, hold : float
        How often a jump comes [1/s], and how long it lasts on average [s].
    """
    from flexaxis.estimators.methods.imm import joint_imm

    model = model_of(nominal)
    prior, drift = _walk("imm", model, identify, period, walk=walk, spread=spread)
    above_zero("rate", rate, "how often a jump comes, in 1/s")
    above_zero("jump", jump, "the standard deviation of a jump, relative to θ(0)")
    above_zero("hold", hold, "how long a jump lasts, in seconds")
    return joint_imm(
        model,
        identify=identify,
        P0=prior,
        drift=drift,
        jump=period / hold * (jump * model.parametrize(identify).theta) ** 2,
        rate=rate,
        hold=hold,
        noise=noise,
        period=period,
        output=output,
    )


WALK = {"ekf": 0.002, "ukf": 0.002, "imm": 0.0015}  # 1/√s, where no tuning is known


def _walk(
    name: str,
    model: Model,
    identify: Sequence[str],
    period: float,
    *,
    walk: float | None,
    spread: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return P(0) and W, from deviations relative to θ(0)."""
    above_zero("period", period, "the sampling period in seconds")
    if walk is None:
        walk = tuned(name, model, period, identify) or WALK[name]
    above_zero("walk", walk, "the standard deviation of θ after a second, relative to θ(0)")
    above_zero("spread", spread, "the standard deviation of θ(0), relative to it")
    theta = model.parametrize(identify).theta
    return (spread * theta) ** 2, period * (walk * theta) ** 2


def horizon(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float | None = None,
    noise: float | None = None,
    window: float = 1.0,
    every: float = 0.05,
) -> "CompiledFilter":
    """
    Make the least-squares fit over a moving window.

    Parameters
    ----------
    forgetting : float
        λ, of what lies before the window.
    noise : float, optional
        Standard deviation of the output, in its unit, for the claim; else that of the residual.
    window, every : float
        Length of a window, and from one to the next, of which it is a multiple [s].
    """
    from flexaxis.estimators.methods.moving_horizon import moving_horizon

    model = model_of(nominal)
    above_zero("period", period, "the sampling period in seconds")
    forgetting = factor("moving-horizon", forgetting, model, period, identify)
    samples = round(above_zero("every", every, "the time between windows, in seconds") / period)
    if samples < 1:
        raise EstimatorError(f"every is {every}, less than a sample of {period} s; give more")
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
        noise=noise,
        output=output,
    )


def _multiple(window: float, every: float) -> int:
    """Return how often ``every`` goes into ``window``, twice at least."""
    ratio = above_zero("window", window, "the length of a window, in seconds") / every
    if ratio < 1.5 or abs(ratio - round(ratio)) > 1e-6:
        raise EstimatorError(
            f"window is {window} and every {every}; the window is a multiple of every, both in "
            "seconds, such as 1.0 and 0.05"
        )
    return round(ratio)


ENTRIES = (
    Entry(
        "ekf",
        "joint extended Kalman filter for state and parameters",
        extended,
        "walk",
        0.002,
        ("#009E73", "o"),
        7,
    ),
    Entry(
        "ukf",
        "joint unscented Kalman filter for state and parameters, in square-root form",
        unscented,
        "walk",
        0.002,
        ("#117733", "s"),
        8,
    ),
    Entry(
        "imm",
        "interacting multiple models: joint Kalman filters, a quiet one and one for each jump",
        imm,
        "walk",
        0.0015,
        ("#66AA55", "D"),
        9,
    ),
    Entry(
        "moving-horizon",
        "nonlinear least squares over a moving window, with an arrival cost",
        horizon,
        "forgetting",
        0.995,
        ("#332288", "P"),
        10,
    ),
)
