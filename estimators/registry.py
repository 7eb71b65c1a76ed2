"""The estimators by name: one entry each, with its options and the knob that trades its speed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.model import three_mass

if TYPE_CHECKING:
    from flexaxis.estimators.ekf import JointEkf
    from flexaxis.estimators.frozen import Frozen
    from flexaxis.estimators.protocol import Estimator
    from flexaxis.estimators.reference import LiteralRpem
    from flexaxis.estimators.rpem import Rpem

REGULARIZATION = 0.3
"""
μ of the ``-mu`` entries, chosen for the nominal axis in stop-and-go operation.

Simulated: 10 s of excitation, 20 s of standstill with f_m +50 % inside it, then excitation again;
λ = 0.995. Without μ the standstill takes P to 1e5 and the restart throws an estimate to hundreds of
times its value, if the box lets it. μ = 0.3 keeps P below (1−λ)/μ = 0.017, no other parameter
leaves its value by more than 2.5 % at the restart (30 % at μ = 1e-3), the lag of f_m is within
0.01 s of the best μ, and the standard deviations without a pause fall by less than 1.5 % (4 % at
μ = 1). It is meant for parameters of the order of one; scale it for others, as 1/θ².
"""

DEFAULT_IDENTIFY = ("k_T", "1/J_a", "f_m")


@dataclass(frozen=True)
class Entry:
    """
    A registered estimator.

    Attributes
    ----------
    name : str
    summary : str
        One line for lists and reports.
    factory : callable
        ``factory(nominal, period, *, identify, output, P0=None, torque=None, <options>)``. θ(0) is
        read from ``nominal``, a mapping of physical parameters to values; ``P0`` is used if given,
        else the paper's recipe on ``torque``, the (N,) torque of a nominal run, else the known
        P(0) of the paper's three parameters.
    options : mapping
        Names of the options with their defaults.
    knob : str or None
        The option that trades tracking speed against variance.
    """

    name: str
    summary: str
    factory: Callable[..., "Estimator"]
    options: Mapping[str, float]
    knob: str | None = None


def entry(name: str) -> Entry:
    """
    Return the registered estimator of this name.

    Raises
    ------
    EstimatorError
        If there is none, with the nearest name.
    """
    if name not in REGISTRY:
        raise EstimatorError(f"unknown estimator {name!r}: {did_you_mean(name, REGISTRY)}")
    return REGISTRY[name]


def rpem_forgetting(
    nominal: Mapping[str, float],
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float = 0.995,
    regularization: float = 0.0,
    literal: bool = False,
) -> "Rpem | LiteralRpem":
    """Make the method with forgetting factor λ, eq. (13); see `Entry` for the arguments."""
    from flexaxis.estimators import LiteralRpem, Rpem, priors

    model = three_mass(nominal)
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
    return (LiteralRpem if literal else Rpem)(
        model,
        identify=identify,
        P0=_initial_P(P0, torque, recipe, known),
        period=period,
        forgetting=forgetting,
        regularization=regularization,
        output=output,
    )


def rpem_drift(
    nominal: Mapping[str, float],
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    scale: float = 1.0,
    regularization: float = 0.0,
) -> "Rpem":
    """Make the method with covariance modification by ``scale`` times Δ, eq. (14), (32)."""
    from flexaxis.estimators import Rpem, priors

    model = three_mass(nominal)
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
    )


def frozen(
    nominal: Mapping[str, float],
    period: float,
    *,
    identify: Sequence[str] = DEFAULT_IDENTIFY,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
) -> "Frozen":
    """Make the estimator that never moves; only ``nominal``, ``identify`` and ``output`` matter."""
    from flexaxis.estimators import Frozen

    return Frozen(three_mass(nominal), identify=identify, output=output)


def ekf(
    nominal: Mapping[str, float],
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
    model = three_mass(nominal)
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


REGISTRY: Mapping[str, Entry] = {
    entry.name: entry
    for entry in (
        Entry(
            "rpem-forgetting",
            "the paper's method with a forgetting factor, eq. (13)",
            rpem_forgetting,
            {"forgetting": 0.995, "regularization": 0.0},
            "forgetting",
        ),
        Entry(
            "rpem-drift",
            "the paper's method with covariance modification, eq. (14), (32)",
            rpem_drift,
            {"scale": 1.0, "regularization": 0.0},
            "scale",
        ),
        Entry(
            "rpem-forgetting-mu",
            "rpem-forgetting, regularised against standstill, eq. (12)",
            partial(rpem_forgetting, regularization=REGULARIZATION),
            {"forgetting": 0.995, "regularization": REGULARIZATION},
            "forgetting",
        ),
        Entry(
            "rpem-drift-mu",
            "rpem-drift, regularised against standstill, eq. (12)",
            partial(rpem_drift, regularization=REGULARIZATION),
            {"scale": 1.0, "regularization": REGULARIZATION},
            "scale",
        ),
        Entry(
            "literal-rpem",
            "rpem-forgetting with a matrix exponential in every sample: slow, the oracle",
            partial(rpem_forgetting, literal=True),
            {"forgetting": 0.995, "regularization": 0.0},
            "forgetting",
        ),
        Entry(
            "ekf",
            "joint extended Kalman filter for state and parameters",
            ekf,
            {"walk": 0.0018, "noise": 0.1, "spread": 0.2},
            "walk",
        ),
        Entry("frozen", "never moves: what doing nothing scores", frozen, {}),
    )
}
