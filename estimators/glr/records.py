"""The bank of hypotheses before the first sample, the prior of jumps, and times in samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.constrained import Told, told_arrays
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.glr.bank import MORE, NEVER, PER_LEVEL
from flexaxis.estimators.glr.cogging import Waves, wave_arrays
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
PASSES = 6  # largest number of passes over the initialisation data
BUDGET = 32  # largest number of old samples that are filtered again in each new one


@dataclass(frozen=True)
class Jumps:
    """
    How θ may jump, relative to its scale.

    Attributes
    ----------
    which : tuple of int
        The parameters that may.
    size : (q,) array
        Standard deviation of a jump.
    rate : (q,) array
        How often one comes [1/s].
    walk : (p,) array
        What the variances of θ gain in every sample besides.
    """

    which: tuple[int, ...]
    size: Array
    rate: Array
    walk: Array


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
    budget : int
        Largest number of old samples that are filtered again in each new one.
    passes : int
        Largest number of passes over the initialisation data.
    """

    base: int
    levels: int
    first: int
    review: int
    memory: int
    budget: int
    passes: int

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
        budget=BUDGET,
        passes=PASSES,
    )


BANK = np.dtype(
    [
        (name, int)
        for name in (
            "base", "budget", "commissioning",  # as of `Timing`
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
            "alarm", "misfit_share", "period",
            "angle", "read",  # of the motor: as far as it has turned, and its speed
            "repeated", "z_before",  # Σ z[k] z[k−1] for z = e/√S
            "chi2", "used",  # Σ e²/S, and of how many samples
            "none",  # weight of no jump
            "kappa", "misfit",  # κ, and as it was before the oldest onset
            "square", "product", "last",  # means of z² and z[k] z[k−1], and the last z
            "odds",
            "last_prediction",  # ŷ of the sample before
            "J_one", "d_one", "chi2_one",  # of what is gone through again
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
    delta, moved_one : (m,), (n,) arrays
        δ of the second filter.
    D, moved : (m, H), (n+1, H) arrays
        Every δ, and what a sample makes of it.
    J, d, size, weight, evidence, precision, prior : (H,) arrays
        Of every hypothesis; precision is 1/σ².
    onset, chi2_at, used_at : (slots,) arrays
        Sample of each slot, and the sums as they were then.
    kept_P, kept_xi : (slots, m, w), (slots, m) arrays
        The filter as it was then.
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
    delta: Vector
    moved_one: Vector
    D: Matrix
    moved: Matrix
    J: Vector
    d: Vector
    size: Vector
    weight: Vector
    evidence: Vector
    precision: Vector
    prior: Vector
    onset: Indices
    chi2_at: Vector
    used_at: Vector
    kept_P: Cube
    kept_xi: Matrix
    mixed: Vector
    waves: Waves


def bank_of(
    design: Design,
    jumps: Jumps,
    timing: Timing,
    *,
    alarm: float,
    groups: Sequence[tuple[Sequence[int], Sequence[float]]],
    tracked: int,
    waves: int,
) -> Memory:
    """
    Return the bank of `flexaxis.estimators.glr.loop.glr` before the first sample.

    Parameters
    ----------
    design : Design
    jumps : Jumps
    timing : Timing
    alarm : float
        Logarithm of the odds of a jump above which candidates are compared.
    groups
        As for `flexaxis.estimators.filters.constrained.told_arrays`.
    tracked : int
        The first so many of θ are estimates.
    waves : int
        In a turn, of the fastest cogging that is looked for; 0 for none.
    """
    m, slots = len(design.theta0) + design.model.states, PER_LEVEL + MORE * (timing.levels - 1)
    H = slots * len(jumps.which)
    return Memory(
        {
            "now": numbers(BANK, _at_first(design, timing, alarm, waves)),
            "which": np.array(jumps.which, np.int64),
            "variance": jumps.size**2,
            "log_prior": np.log(jumps.rate * design.period),
        }
        | told_arrays(tracked, groups)
        | {"history": np.zeros((_history(timing), 4))}
        | {"delta": np.zeros(m), "moved_one": np.zeros(design.model.states)}
        | {"D": np.zeros((m, H)), "moved": np.zeros((design.model.states + 1, H))}
        | {name: np.zeros(H) for name in ("J", "d", "size", "weight")}
        | {"evidence": np.full(H, -np.inf), "precision": np.zeros(H), "prior": np.zeros(H)}
        | {"onset": np.full(slots, NEVER), "chi2_at": np.zeros(slots), "used_at": np.zeros(slots)}
        | {"kept_P": np.zeros((slots, m, padded(m))), "kept_xi": np.zeros((slots, m))}
        | {"mixed": np.zeros(len(design.theta0))}
        | wave_arrays(m, design.model.states, min(waves, 4 * timing.levels * len(jumps.which)))
    )


def _at_first(design: Design, timing: Timing, alarm: float, waves: int) -> dict[str, Any]:
    """Return the numbers of a bank before the first sample, where they are not zero."""
    return dict.fromkeys(("due", "born", "mark"), NEVER) | {
        "base": timing.base,
        "budget": timing.budget,
        "commissioning": timing.first,
        "searching": int(waves > 0),
        "alarm": alarm,
        "misfit_share": 1.0 / timing.memory,
        "period": design.period,
        "mean_speed": find_signal(design.output).mean_speed(design.period),
        "none": 1.0,
        "kappa": 1.0,
        "misfit": 1.0,
        "square": 1.0,
        "last": np.nan,
        "odds": -np.inf,
        "cost_first": np.inf,
    }


def _history(timing: Timing) -> int:
    """Return how many samples have to be kept."""
    grows = (timing.budget / (timing.budget - 1)) ** (timing.passes + 1)  # while a pass catches up
    longest = max(1.5 * timing.first, 2.0 * (timing.span + timing.review))
    return int(np.ceil(grows * longest)) + timing.budget
