"""What a filter knew before an alarm, as a past in which a change is looked for; its residual."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.fit import Past
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.rows import Stretch

Array = NDArray[np.float64]

OUTLIER = 6.0  # standard deviations of a lone residual that no change of a parameter makes, …
LONELY = 4.0  # … times larger than its neighbours


class Normal(NamedTuple):
    """
    What the residual was like before an alarm.

    Attributes
    ----------
    variance : float
        Of the noise.
    colour : (ORDER+1,) array
        As from `flexaxis.estimators.relocate.colour.write_colour`.
    """

    variance: float
    colour: Array


def past_of(before: Stretch, memory: Memory, normal: Normal) -> Past:
    """
    Return the past in which a change is looked for.

    Parameters
    ----------
    before : Stretch
        What the filter knew at each sample at which the change may have happened, as it was before
        anything was taken up.
    memory : Memory
        For what was measured since.
    normal : Normal
    """
    u, y, present = memory.signals(before.first)
    residuals = memory.read("epsilon", before.first - ORDER)
    alone = outliers(
        residuals, np.sqrt(normal.variance * memory.read("scale", before.first - ORDER))
    )
    epsilon = np.where(alone | np.isnan(residuals), 0.0, residuals)[: len(before.rows) + ORDER]
    weights, remains = normal.colour[:-1], normal.colour[-1]
    own = before.rows["epsilon"]
    known = ~np.isnan(own) & ~alone[ORDER : ORDER + len(own)]
    epsilon[ORDER:] = np.where(known, own, 0.0)
    white = whitened(epsilon, before.rows["scale"], known, normal)
    return Past(
        theta=before.theta,
        x=before.x,
        likelihood=likelihood(white, before.rows["scale"], known),
        u=u[:-1].copy(),
        y=y,
        present=present & ~alone[ORDER + 1 :],
        epsilon=epsilon,
        colour=weights,
        variance=float(remains * normal.variance),
    )


def residual(memory: Memory, first: int, normal: Normal) -> tuple[Array, float]:
    """Return the whitened residual of the filter from a sample on, and its log-likelihood."""
    raw, scale = memory.read("epsilon", first - ORDER), memory.read("scale", first)
    known = ~np.isnan(raw)
    known[ORDER:] &= ~outliers(raw, np.sqrt(normal.variance))[ORDER:]
    white = whitened(np.where(known, raw, 0.0), scale, known[ORDER:], normal)
    return white, float(likelihood(white, scale, known[ORDER:])[-1])


def whitened(epsilon: Array, scale: Array, known: NDArray[np.bool_], normal: Normal) -> Array:
    """
    Return the residual (N,) of unit variance, less what the last ones say of it; zero in gaps.

    Parameters
    ----------
    epsilon : (ORDER + N,) array
        From ORDER samples earlier on; zero in gaps.
    scale : (N,) array
        1 + ψᵀPψ.
    known : (N,) bool array
        False in gaps.
    normal : Normal
    """
    relative = epsilon / np.sqrt(np.r_[np.ones(ORDER), scale])
    white = np.convolve(relative, np.r_[1.0, -normal.colour[:-1]])[ORDER : len(relative)]
    return np.where(known, white, 0.0) / np.sqrt(normal.colour[-1] * normal.variance)


def likelihood(white: Array, scale: Array, known: NDArray[np.bool_]) -> Array:
    """Return the logarithm of the likelihood up to each sample, but for a constant [nats]."""
    return np.cumsum(-(white**2 + np.where(known, np.log(scale), 0.0)) / 2)


def outliers(epsilon: Array, deviation: Array | float) -> NDArray[np.bool_]:
    """
    Say which residuals stand alone, as no change of a parameter makes them.

    What a parameter does to y passes through the masses and is still there one sample later. The
    last residual has yet to show that.
    """
    size = np.nan_to_num(np.abs(epsilon))
    around = np.maximum(np.r_[0.0, size[:-1]], np.r_[size[1:], 0.0])
    return (size > OUTLIER * deviation) & (size > LONELY * np.maximum(around, deviation))
