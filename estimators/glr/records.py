"""Records of a filter with a bank of hypotheses, before the first sample."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.constrained import told_records
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.filters.joint import ekf_records
from flexaxis.estimators.filters.loop import Record, joined, record
from flexaxis.estimators.glr.bank import PER_LEVEL
from flexaxis.estimators.models.discretisation import Pattern
from flexaxis.estimators.models.meaning import moving_poles
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]
NEVER = -1  # a sample that does not come
FIRST, REVIEW, MISFIT = 10.0, 2.6, 26.0  # time scales of the axis: of motion until structure is
# learnt, until a name is final, and of the memory of how well the model fits
SPAN, FINEST = 2.8, 80  # time scales that the bank covers at least, and its finest spacings in one
FEWEST, MOST = 80, 800  # samples of the time scale of an axis that does not swing
PASSES = 6  # through the first seconds, at most


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
        The first seconds, in which structure is learnt; 0 for an axis that is known.
    review : int
        After an onset, when its name is looked at again.
    memory : int
        Over which the misfit of the model is learnt.
    budget : int
        Samples at most that are gone through again in one.
    passes : int
        How often the first seconds are gone through again, at most.
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
    Return the time in which an axis forgets [s]: that of its slowest oscillation.

    What does not swing has its slowest pole's, within `FEWEST` and `MOST` samples: how long a
    motor coasts says nothing of how soon a torque shows.

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


def glr_records(  # noqa: PLR0917
    design: Design,
    pattern: Pattern,
    jumps: Jumps,
    timing: Timing,
    alarm: float,
    groups: Sequence[tuple[Sequence[int], Sequence[float]]],
    tracked: int,
    waves: int,
) -> tuple[Record, Record, Record]:
    """
    Return tuning (1,), states (2,) and bank (1,) of `loop.glr_loop`.

    Parameters
    ----------
    design : Design
    pattern : Pattern
        Of its model, `flexaxis.estimators.filters.joint.with_state`.
    jumps : Jumps
    timing : Timing
    alarm : float
        Logarithm of the odds of a jump from which on somebody looks.
    groups
        As for `flexaxis.estimators.filters.constrained.told_records`.
    tracked : int
        The first so many of θ are estimates.
    waves : int
        In a turn, of the fastest cogging that is looked for; 0 for none.
    """
    tuning, start = ekf_records(design, pattern, rests=True)
    told, drawn = told_records(tracked, groups)
    p, q = len(design.theta0), len(jumps.which)
    tuning["drift"][0] = np.diag(jumps.walk)
    more = record(
        which=np.array(jumps.which),
        variance=jumps.size**2,
        log_prior=np.log(jumps.rate * design.period),
        base=timing.base,
        budget=timing.budget,
        first=timing.first,
        alarm=alarm,
        misfit_share=1.0 / timing.memory,
        period=design.period,
        mean_speed=np.array(find_signal(design.output).mean_speed(design.period)),
        waves=min(waves, PER_LEVEL * timing.levels * q // 2),
    )
    P = start["P"].shape[1:]
    searches = record(searching=int(waves > 0))
    bank = joined(
        _again(pattern, p, timing), _hypotheses(pattern, p, q, timing, P), searches, drawn
    )
    return joined(tuning, more, told), np.repeat(start, 2), bank


def _hypotheses(pattern: Pattern, p: int, q: int, timing: Timing, P: tuple[int, ...]) -> Record:
    """Return the bank of q jumps at each onset; before, the waves that are looked for."""
    slots, m, n = PER_LEVEL * timing.levels, pattern.p, pattern.p - p
    H = slots * q
    return record(
        pull=np.zeros(H),
        push=np.zeros(n + pattern.laws + 1),
        cross=np.zeros(H),
        angle=0.0,
        read=0.0,
        repeated=0.0,
        z_before=0.0,
        D=np.zeros((m, H)),
        moved=np.zeros((n, H)),
        phi=np.zeros(H),
        J=np.zeros(H),
        d=np.zeros(H),
        size=np.zeros(H),
        weight=np.zeros(H),
        evidence=np.full(H, -np.inf),
        none=1.0,
        onset=np.full(slots, NEVER),
        chi2=0.0,
        used=0.0,
        chi2_at=np.zeros(slots),
        used_at=np.zeros(slots),
        kept_P=np.zeros((slots, *P)),
        kept_xi=np.zeros((slots, m)),
        kappa=1.0,
        misfit=1.0,
        square=1.0,
        product=0.0,
        last=np.nan,
        odds=-np.inf,
        mixed=np.zeros(p),
    )


def _again(pattern: Pattern, p: int, timing: Timing) -> Record:
    """Return the samples that are kept, and how far they have been gone through again."""
    m, n = pattern.p, pattern.p - p
    grows = (timing.budget / (timing.budget - 1)) ** (timing.passes + 1)  # while a pass catches up
    needed = grows * max(1.5 * timing.first, 2.0 * (timing.span + timing.review)) + timing.budget
    length = 2 ** int(np.ceil(np.log2(needed)))  # few lengths, as each is compiled for
    return record(
        history=np.zeros((length, 3)),
        delta=np.zeros(m),
        moved_one=np.zeros(n),
        J_one=0.0,
        d_one=0.0,
        chi2_one=0.0,
        at=0,
        end=0,
        first=0,
        end_follows=0,
        busy=0,
        cost_one=0.0,
        cost_first=np.inf,  # twice the negative logarithm of the likelihood of the first seconds
        left=0,  # of the samples that may be gone through again in this one
        rerun=0,  # samples that were gone through again, in all
        taken=0,
        awake=0,
        due=NEVER,
        born=NEVER,  # first sample in which the axis moved
        moves=0,  # samples in which it did
        mark=NEVER,  # where the first seconds end
        patience=0,
        asks=0,  # whether somebody has to look after the last sample
    )
