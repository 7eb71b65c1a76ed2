"""Relocate, until it brings its own entry."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.methods.start import Nominal, initial_P, model_of
from flexaxis.estimators.models.axes import PAPER

if TYPE_CHECKING:
    from flexaxis.estimators.relocate.filter import Relocate


def relocate(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
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
        P0=initial_P(
            P0, torque, recipe, priors.stored_P(model, identify, period, forgetting=forgetting)
        ),
        period=period,
        forgetting=forgetting,
        alarm=alarm,
        gain=gain,
        output=output,
    )


ENTRIES = (
    Entry(
        "relocate",
        "detects a jump, rewinds to it and refits whichever physical parameter explains it",
        relocate,
        "forgetting",
        0.995,
        ("#882255", "*"),
        30,
    ),
)
