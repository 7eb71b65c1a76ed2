"""How each registered estimator is made from nominal parameters, a period and its options."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import three_mass
from flexaxis.estimators.models.model import Model

if TYPE_CHECKING:
    from flexaxis.estimators.methods.frozen import Frozen
    from flexaxis.estimators.methods.literal import LiteralRpem
    from flexaxis.estimators.methods.oracle_reset import OracleReset
    from flexaxis.estimators.methods.rpem import Rpem
    from flexaxis.estimators.relocate.filter import Relocate

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
    from flexaxis.estimators import LiteralRpem, Rpem

    model = model_of(nominal)
    make = (
        LiteralRpem if literal else partial(Rpem, state_correction=state_correction, robust=robust)
    )
    return make(
        model,
        identify=identify,
        P0=forgetting_P(
            P0,
            torque,
            model,
            identify,
            period=period,
            forgetting=forgetting,
            output=output,
            regularization=regularization,
        ),
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
    from flexaxis.estimators import Rpem
    from flexaxis.estimators.offline import priors

    model = model_of(nominal)
    if not scale > 0:
        raise EstimatorError(f"scale is {scale}; the factor on Δ must be above 0")
    drift = scale * priors.default_drift(model, identify, period)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        drift=drift,
        regularization=regularization,
        output=output,
    )
    known = priors.stored_P(model, identify, period, forgetting=None, scale=scale)
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

    return Frozen(model_of(nominal), identify=identify, output=output)


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
    from flexaxis.estimators.methods.oracle_reset import OracleReset

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
    from flexaxis.estimators.offline import priors
    from flexaxis.estimators.relocate.filter import Relocate

    model = model_of(nominal)
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
        P0=_initial_P(
            P0, torque, recipe, priors.stored_P(model, identify, period, forgetting=forgetting)
        ),
        period=period,
        forgetting=forgetting,
        alarm=alarm,
        gain=gain,
        output=output,
    )


def forgetting_P(
    given: ArrayLike | None,
    torque: ArrayLike | None,
    model: Model,
    identify: Sequence[str],
    *,
    period: float,
    forgetting: float,
    output: str,
    regularization: float = 0.0,
) -> ArrayLike:
    """Return P(0) for a forgetting factor: as given, or by the recipe, or as is known."""
    from flexaxis.estimators.offline import priors

    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=forgetting,
        regularization=regularization,
        output=output,
    )
    known = priors.stored_P(model, identify, period, forgetting=forgetting)
    return _initial_P(given, torque, recipe, known)


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
        f"P(0) is known only for {', '.join(DEFAULT_IDENTIFY)} of the nominal axis at 5 ms; for "
        "another axis, other parameters or another period give P0, or the torque of a nominal run "
        "for the recipe"
    )


def model_of(nominal: Mapping[str, float] | Model) -> Model:
    """Return the model to use: that of the paper's axis, unless another one is given."""
    return nominal if isinstance(nominal, Model) else three_mass(nominal)
