"""How well a model explains a log, and what it means that it explains another one less well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.prediction_error import Fitted

Array = NDArray[np.float64]

POOR = 10.0  # points of fit: worse than on its own log by more than that is another axis


@dataclass(frozen=True)
class Fits:
    """How well simulation and prediction do, above the corner of the axis where it has one.

    Attributes
    ----------
    simulation, prediction : float
        100 (1 − |y − ŷ|/|y − mean y|), from the torque alone and over one sample.
    simulation_error, prediction_error : float
        Standard deviations of y − ŷ [rad/s].
    """

    simulation: float
    prediction: float
    simulation_error: float
    prediction_error: float


def fits(y: Array, fitted: Fitted) -> Fits:
    """Return the fits of a course to the measured output (N,)."""
    good, high = fitted.good, fitted.colour.high
    size = float(np.std(high(y)[good]))
    error = high(fitted.colour.bridged(fitted.residual, good))
    errors = [float(np.std(e[good])) for e in (error, fitted.white)]
    simulation, prediction = (100 * (1 - error / size) for error in errors)
    return Fits(simulation, prediction, *errors)


def contradictions(own: Fits, other: Fits) -> tuple[str, ...]:
    """Return what another log says against an axis that was identified from its own.

    A log with less motion has a poorer fit from the same errors, so that errors have to be larger
    as well.
    """
    found = []
    for name in ("simulation", "prediction"):
        mine, theirs = getattr(own, name), getattr(other, name)
        larger = getattr(other, f"{name}_error") > getattr(own, f"{name}_error")
        if theirs < 0 or (theirs < mine - POOR and larger):
            found.append(
                f"on the other log the fit of a {name} is {theirs:.1f} %, and {mine:.1f} % on the "
                "one that it was identified from: it is another axis, or a motion that this log "
                "did not show; identify from a log of both, or try another --model or --friction"
            )
    return tuple(found)
