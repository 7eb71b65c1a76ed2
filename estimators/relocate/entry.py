"""`relocate` in the registry."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.methods.start import Nominal, factor, forgetting_P, model_of
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
    Make the filter that detects, rewinds and refits; every parameter that can change is a suspect.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    alarm, gain : float
        Evidence at which the residual is looked into, and that a change needs [nats].
    noise : float, optional
        Standard deviation of y, in its unit; estimated from the residual by default.
    """
    model = model_of(nominal)
    weight = factor("relocate", forgetting, model, period, identify)
    return Relocate(
        model,
        identify=identify,
        suspects=[name for name in model.parameters if name not in model.fixed],
        P0=forgetting_P(
            P0, torque, model, identify, period=period, forgetting=weight, output=output
        ),
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
