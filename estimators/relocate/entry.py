"""`relocate` in the registry."""

from collections.abc import Sequence
from functools import partial

from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.methods.start import Nominal, factor, initial_P, model_of
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.relocate.filter import Relocate


def relocate(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float | None = None,
    alarm: float = 10.0,
    gain: float = 14.0,
    noise: float | None = None,
) -> Relocate:
    """
    Make the filter that detects, rewinds and refits; every parameter but r is a suspect.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    alarm, gain : float
        Evidence at which the residual is looked into, and that a change needs [nats].
    noise : float, optional
        Standard deviation of y, in its unit; estimated from the residual by default.
    """
    from flexaxis.estimators.offline import priors

    model, weight = model_of(nominal), factor("relocate", forgetting, period)
    recipe = partial(
        priors.nominal_P,
        model,
        identify=identify,
        period=period,
        forgetting=weight,
        output=output,
    )
    return Relocate(
        model,
        identify=identify,
        suspects=[name for name in model.parameters if name != "r"],
        P0=initial_P(P0, torque, recipe, priors.known_P(identify, forgetting=weight)),
        period=period,
        forgetting=weight,
        alarm=alarm,
        gain=gain,
        output=output,
        noise=noise,
    )


ENTRIES = (
    Entry(
        "relocate",
        "detects a jump, rewinds to it and refits whichever physical parameter explains it",
        relocate,
        knob="forgetting",
        default=0.995,
        look=("#882255", "*"),
        rank=30,
    ),
)
