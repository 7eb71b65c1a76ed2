"""Lengths of time of a filter with a bank: all from one time scale, that of the axis."""

from dataclasses import replace

import numpy as np

from flexaxis.estimators.filters.design import at_least_zero
from flexaxis.estimators.glr.records import Timing
from flexaxis.estimators.models.model import Model

FIRST, REVIEW, MISFIT = 10.0, 2.6, 26.0  # time scales of the axis: of motion until structure is
# learnt, until a name is final, and of the memory of how well the model fits
SPAN, FINEST = 2.8, 80  # time scales that the bank covers at least, and its finest spacings in one
FEWEST, MOST = 80, 800  # samples of the time scale of an axis that does not swing
PASSES = 6  # through the first seconds, at most


def time_scale(model: Model, period: float) -> float:
    """
    Return the time in which an axis forgets [s]: that of its slowest oscillation.

    What does not swing has its slowest pole's, within `FEWEST` and `MOST` samples: how long a
    motor coasts says nothing of how soon a torque shows.

    Parameters
    ----------
    model : Model
    period : float
        Sampling period [s].
    """
    linear = replace(model, laws=())
    one = linear.parametrize(linear.parameters[:1])
    poles = np.linalg.eigvals(one.matrices(one.theta)[0])
    rates = np.abs(poles.real)
    moves = rates > 1e-6 * np.abs(poles).max(initial=0.0)
    swings = moves & (np.abs(poles.imag) > rates)
    if swings.any():
        return float(1.0 / rates[swings].min())
    slowest = 1.0 / rates[moves].min() if moves.any() else np.inf
    return float(np.clip(slowest, FEWEST * period, MOST * period))


def lengths(
    model: Model, period: float, budget: int, commissioning: float | None, known: bool
) -> Timing:
    """Return lengths in samples, from the time scale of the axis."""
    scale = time_scale(model, period)
    if commissioning is None:
        commissioning = 0.0 if known else FIRST * scale
    at_least_zero("commissioning", commissioning, "how long the first seconds are, in seconds")
    samples = scale / period
    base = max(1, round(samples / FINEST))
    levels = max(1, int(np.ceil(np.log2(SPAN * samples / (8 * base)))) + 1)
    return Timing(
        base=base,
        levels=levels,
        first=round(commissioning / period),
        review=round(REVIEW * samples),
        memory=round(MISFIT * samples),
        budget=budget,
        passes=PASSES,
    )
