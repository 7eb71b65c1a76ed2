"""How each registered estimator is made from nominal parameters, a period and its options."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.model import Model, three_mass

if TYPE_CHECKING:
    from flexaxis.estimators.ekf import JointEkf
    from flexaxis.estimators.forgetful import ForgetfulRpem
    from flexaxis.estimators.frozen import Frozen
    from flexaxis.estimators.oracle_reset import OracleReset
    from flexaxis.estimators.reference import LiteralRpem
    from flexaxis.estimators.relocate import Relocate
    from flexaxis.estimators.rpem import Rpem

DEFAULT_IDENTIFY = ("k_T", "1/J_a", "f_m")


def rpem_forgetting(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
    regularization: float = 0.0,
    literal: bool = False,
    state_correction: bool = False,
    robust: float = 0.0,
) -> "Rpem | LiteralRpem":
    """Make the method with forgetting factor λ, eq. (13); the registry's `Entry` explains."""
    from flexaxis.estimators import LiteralRpem, Rpem, priors

    model = _model(nominal)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=forgetting,
        regularization=regularization,
        output=output,
    )
    known = priors.known_P(identify, forgetting=forgetting)
    make = (
        LiteralRpem if literal else partial(Rpem, state_correction=state_correction, robust=robust)
    )
    return make(
        model,
        identify=identify,
        P0=_initial_P(P0, torque, recipe, known),
        period=period,
        forgetting=forgetting,
        regularization=regularization,
        output=output,
    )


def rpem_drift(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    scale: float = 1.0,
    regularization: float = 0.0,
    robust: float = 0.0,
) -> "Rpem":
    """Make the method with covariance modification by ``scale`` times Δ, eq. (14), (32)."""
    from flexaxis.estimators import Rpem, priors

    model = _model(nominal)
    if not scale > 0:
        raise EstimatorError(f"scale is {scale}; the factor on Δ must be above 0")
    drift = scale * priors.default_drift(identify, model.parametrize(identify).theta)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        drift=drift,
        regularization=regularization,
        output=output,
    )
    known = priors.known_P(identify, forgetting=None, scale=scale)
    return Rpem(
        model,
        identify=identify,
        P0=_initial_P(P0, torque, recipe, known),
        period=period,
        drift=drift,
        regularization=regularization,
        output=output,
        robust=robust,
    )


def frozen(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
) -> "Frozen":
    """Make the estimator that never moves; only ``nominal``, ``identify`` and ``output`` matter."""
    from flexaxis.estimators import Frozen

    return Frozen(_model(nominal), identify=identify, output=output)


def ekf(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    walk: float = 0.0018,
    noise: float = 0.1,
    spread: float = 0.2,
) -> "JointEkf":
    """
    Make the joint extended Kalman filter.

    Parameters
    ----------
    walk : float
        Standard deviation of the random walk of every θ after a second, relative to θ(0). The
        default has the variance of `rpem-forgetting` on the nominal axis, as geometric mean over
        the paper's three parameters (16 runs of 40 s, seeds 0 to 15).
    noise : float
        Standard deviation of the output [rad/s].
    spread : float
        Standard deviation of θ(0), relative to it.
    """
    from flexaxis.estimators.ekf import JointEkf

    if not walk > 0 or not spread > 0:
        raise EstimatorError(f"walk is {walk} and spread {spread}; both must be above 0")
    model = _model(nominal)
    theta = model.parametrize(identify).theta
    return JointEkf(
        model,
        identify=identify,
        P0=(spread * theta) ** 2,
        drift=period * (walk * theta) ** 2,
        noise=noise,
        period=period,
        output=output,
    )


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
) -> "ForgetfulRpem":
    """Make a method with another rule of forgetting; "vector" forgets f_m at half the rate."""
    from flexaxis.estimators import priors
    from flexaxis.estimators.forgetful import ForgetfulRpem

    model = _model(nominal)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=forgetting,
        output=output,
    )
    slow = [1 - (1 - forgetting) * (0.5 if name == "f_m" else 1.0) for name in identify]
    return ForgetfulRpem(
        model,
        rule=rule,
        identify=identify,
        P0=_initial_P(P0, torque, recipe, priors.known_P(identify, forgetting=forgetting)),
        period=period,
        forgetting=forgetting,
        rates=slow if rule == "vector" else None,
        reset=reset,
        output=output,
    )


def oracle_reset(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    onsets: Sequence[int] = (),
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
) -> "OracleReset":
    """Make the control that is told the samples at which a true parameter changes."""
    from flexaxis.estimators.oracle_reset import OracleReset

    rpem = rpem_forgetting(
        nominal,
        period,
        identify=identify,
        output=output,
        P0=P0,
        torque=torque,
        forgetting=forgetting,
        state_correction=True,
    )
    return OracleReset(rpem, onsets=onsets)  # type: ignore[arg-type]  # not a literal one


def relocate(
    nominal: Mapping[str, float] | Model,
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
    alarm: float = 10.0,
    gain: float = 14.0,
) -> "Relocate":
    """
    Make the filter that detects, rewinds and refits; every parameter but r is a suspect.

    Parameters
    ----------
    alarm, gain : float
        Evidence at which the residual is looked into, and that a change needs [nats].
    """
    from flexaxis.estimators import priors
    from flexaxis.estimators.relocate import Relocate

    model = _model(nominal)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=forgetting,
        output=output,
    )
    return Relocate(
        model,
        identify=identify,
        suspects=[name for name in model.parameters if name != "r"],
        P0=_initial_P(P0, torque, recipe, priors.known_P(identify, forgetting=forgetting)),
        period=period,
        forgetting=forgetting,
        alarm=alarm,
        gain=gain,
        output=output,
    )


def _initial_P(
    given: ArrayLike | None,
    torque: ArrayLike | None,
    recipe: Callable[[ArrayLike], NDArray[np.float64]],
    known: NDArray[np.float64] | None,
) -> ArrayLike:
    if given is not None:
        return given
    if torque is not None:
        return recipe(torque)
    if known is not None:
        return known
    raise EstimatorError(
        f"P(0) is known only for {', '.join(DEFAULT_IDENTIFY)}; for other parameters give P0, "
        "or the torque of a nominal run for the recipe"
    )


def _model(nominal: Mapping[str, float] | Model) -> Model:
    """Return the model to use: that of the paper's axis, unless another one is given."""
    return nominal if isinstance(nominal, Model) else three_mass(nominal)
