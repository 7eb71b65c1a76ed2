"""The bank of hypotheses before the first sample, and times in samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.constrained import Told
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.glr.bank import MORE, NEVER, PER_LEVEL, Columns
from flexaxis.estimators.glr.cogging import Waves
from flexaxis.estimators.models.meaning import moving_poles
from flexaxis.estimators.models.memory import (
    Cube,
    Indices,
    Matrix,
    Memory,
    Vector,
    numbers,
)
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.rows import padded
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]
FIRST, REVIEW, MISFIT = 10.0, 2.6, 26.0  # time scales of the axis: of motion until structure is
# learnt, until a name is final, and of the memory of how well the model fits
SPAN, FINEST = 2.8, 80  # time scales that the bank covers at least, and its finest spacings in one
FEWEST, MOST = 80, 800  # samples of the time scale of an axis that does not swing
JUMP = 0.3  # standard deviation of jumps of θ over its scale: faults are of 10 to 100 %
BUDGET = 32  # largest number of old samples that are filtered again in each new one


@dataclass(frozen=True)
class Timing:
    """
    Lengths in samples.

    Attributes
    ----------
    base : int
        Spacing of onsets on the finest level of the bank.
    levels : int
        Of the bank.
    first : int
        Length of the initialisation; 0 for an axis that is known.
    review : int
        Time after an onset in which the parameter may still be replaced.
    memory : int
        Memory of the misfit of the model.
    """

    base: int
    levels: int
    first: int
    review: int
    memory: int

    @property
    def span(self) -> int:
        """How old an onset may be."""
        return self.base * PER_LEVEL * 2 ** (self.levels - 1)


def time_scale(model: Model, period: float) -> float:
    """
    Return the time constant of the slowest oscillation of an axis [s].

    Without oscillation it is that of the slowest pole, limited to `FEWEST` … `MOST` samples,
    because a torque shows much sooner than a motor coasts to rest.

    Parameters
    ----------
    model : Model
    period : float
        Sampling period [s].
    """
    poles = moving_poles(model)
    rates, swings = np.abs(poles.real), np.abs(poles.imag) > np.abs(poles.real)
    if swings.any():
        return float(1.0 / rates[swings].min())
    slowest = 1.0 / rates.min() if rates.size else np.inf
    return float(np.clip(slowest, FEWEST * period, MOST * period))


def lengths(model: Model, period: float, commissioning: float | None, known: bool) -> Timing:
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
    )


BANK = np.dtype(
    [
        (name, int)
        for name in (
            "base", "commissioning",  # as of `Timing`
            "searching",  # 1 while waves are looked for
            "awake",  # 1 from when structure is learnt
            "taken",  # samples
            "at", "end",  # samples that are gone through again: the next one, and where it ends
            "measured",  # 1 where the first of these has been through its measurement
            "end_follows",  # 1 where it ends with the last sample that was taken
            "busy",  # 1 while samples are gone through again
            "left",  # of the samples that may be gone through again in this one
            "rerun",  # samples that were gone through again, in all
            "due",  # sample at which a name is looked at again
            "born",  # first sample in which the axis moved
            "moves",  # samples in which it did
            "mark",  # where the first seconds end
            "patience",  # sample before which nothing is compared again
            "asks",  # 1 where somebody has to look after the last sample
        )
    ]
    + [
        (name, float)
        for name in (
            "misfit_share", "period",
            "angle", "read",  # of the motor: as far as it has turned, and its speed
            "repeated", "z_before",  # Σ z[k] z[k−1] for z = e/√S
            "chi2", "used",  # Σ e²/S, and of how many samples
            "kappa", "misfit",  # κ, and as it was before the oldest onset
            "square", "product", "last",  # means of z² and z[k] z[k−1], and the last z
            "last_prediction",  # ŷ of the sample before
            "chi2_one",  # Σ e²/S of what is gone through again
            "cost_one", "cost_first",  # −2 ln of the likelihood, and that of the first seconds
        )
    ]
    + [("mean_speed", float, 2)]
)  # fmt: skip
"""The numbers of a bank."""


class Bank(NamedTuple):
    """
    A bank of H hypotheses: of jumps of q parameters at each slot.

    Attributes
    ----------
    now
        Its numbers.
    which, variance, log_prior : (q,) arrays
        Of the jumps.
    told : Told
        As of `flexaxis.estimators.filters.constrained`.
    history : (length, 4) array
        Torque, output as it is used, R and torque noise of the last samples, each at its number's
        remainder.
    columns, one : Columns
        Of the hypotheses, and the one beside the second filter.
    size, weight, precision, prior : (H,) arrays
        Of every hypothesis; precision is 1/σ².
    onset, chi2_at, used_at : (slots,) arrays
        Sample of each slot, and the sums as they were then.
    kept : (slots, m+1, w) array
        P of the filter as it was then, and ξ as the last row.
    mixed : (p,) array
        Mean of θ over all hypotheses.
    waves : Waves
        As of `flexaxis.estimators.glr.cogging`.
    """

    now: Annotated[NDArray[np.void], BANK, 1]
    which: Indices
    variance: Vector
    log_prior: Vector
    told: Told
    history: Matrix
    columns: Columns
    one: Columns
    size: Vector
    weight: Vector
    precision: Vector
    prior: Vector
    onset: Indices
    chi2_at: Vector
    used_at: Vector
    kept: Cube
    mixed: Vector
    waves: Waves


def bank_of(
    design: Design,
    timing: Timing,
    *,
    which: Sequence[int],
    log_prior: Array,
    told: dict[str, Array],
    waves: int,
) -> Memory:
    """
    Return the bank of `flexaxis.estimators.glr.loop.glr` before the first sample.

    Parameters
    ----------
    design : Design
    timing : Timing
    which : (q,) sequence
        Parameters that may jump.
    log_prior : (q,) array
        Logarithm of the probability that one jumps in a sample.
    told
        From `flexaxis.estimators.filters.constrained.told_arrays`.
    waves : int
        In a turn, of the fastest cogging that is looked for; 0 for none.
    """
    n, p, q = design.model.states, len(design.scale), len(which)
    slots = PER_LEVEL + MORE * (timing.levels - 1)
    # more samples come while the old ones are filtered again
    length = int(2.5 * max(timing.first, timing.span + timing.review)) + BUDGET
    H, waves = slots * q, min(waves, 4 * timing.levels * q)
    now = dict.fromkeys(("due", "born", "mark"), NEVER) | {
        "base": timing.base,
        "commissioning": timing.first,
        "searching": int(waves > 0),
        "misfit_share": 1.0 / timing.memory,
        "period": design.period,
        "mean_speed": find_signal(design.output).mean_speed(design.period),
        "kappa": 1.0,
        "misfit": 1.0,
        "square": 1.0,
        "last": np.nan,
        "cost_first": np.inf,
    }
    return Memory(
        {
            "now": numbers(BANK, now),
            "which": np.array(which, np.int64),
            "variance": np.full(q, JUMP**2),
            "log_prior": log_prior,
        }
        | told
        | {"history": np.zeros((length, 4))}
        | _columns("", p, n, H)
        | _columns("one_", p, n, 1)
        | {name: np.zeros(H) for name in ("size", "weight", "precision", "prior")}
        | {"onset": np.full(slots, NEVER), "chi2_at": np.zeros(slots), "used_at": np.zeros(slots)}
        | {"kept": np.zeros((slots, p + n + 1, padded(p + n))), "mixed": np.zeros(p)}
        | _columns("wave_", p, n, 2 * waves)
        | {"pull": np.zeros(2 * waves)}
    )


def _columns(name: str, p: int, n: int, H: int) -> dict[str, Array]:
    """Return the arrays of H `Columns` for p parameters and n states."""
    sums = {name + "J": np.zeros(H), name + "d": np.zeros(H)}
    return {name + "D": np.zeros((p + n, H)), name + "moved": np.zeros((n + 1, H))} | sums
