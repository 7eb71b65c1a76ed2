"""Initial arrays of the hypothesis bank, and the time spans that the estimator glr uses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.constrained import Told
from flexaxis.estimators.filters.design import Design, at_least_zero
from flexaxis.estimators.glr.bank import MORE, NEVER, PER_LEVEL, Columns
from flexaxis.estimators.glr.cogging import Waves
from flexaxis.estimators.models.matrix_rows import padded
from flexaxis.estimators.models.memory import (
    Cube,
    Indices,
    Matrix,
    Memory,
    Vector,
    numbers,
)
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import moving_poles
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]
FIRST, REVIEW, MISFIT = 10.0, 2.6, 26.0  # durations in time scales of the axis: initialisation,
# time until the name of a detected parameter is final, and memory of the misfit of the model
SPAN, FINEST = 2.8, 80  # smallest time covered by the bank, in time scales; onsets per time scale
FEWEST, MOST = 80, 800  # limits of the time scale of an axis without oscillation, in samples
JUMP = 0.3  # standard deviation of a jump of θ relative to its scale; faults are 10 to 100 %
BUDGET = 32  # largest number of old samples that are filtered again for each new sample


@dataclass(frozen=True)
class Timing:
    """
    The time spans that the estimator glr uses, in samples.

    Attributes
    ----------
    base : int
        Spacing of jump onsets on the finest level of the hypothesis bank.
    levels : int
        Number of levels of the hypothesis bank.
    first : int
        Number of samples of the initialisation, or 0 if the structure of the axis is known.
    review : int
        Time span after the onset of a jump during which another parameter can still replace the
        detected parameter.
    memory : int
        Averaging time of the model misfit κ.
    """

    base: int
    levels: int
    first: int
    review: int
    memory: int

    @property
    def span(self) -> int:
        """Largest age of a jump onset in the hypothesis bank."""
        return self.base * PER_LEVEL * 2 ** (self.levels - 1)


def time_scale(model: Model, period: float) -> float:
    """
    Return the time constant of the slowest oscillation of an axis, in seconds.

    For an axis without oscillation, the function returns the time constant of the slowest pole,
    limited to the range from `FEWEST` to `MOST` samples. The upper limit prevents the use of a
    coasting motor's time constant, which is much longer than the time until the effect of a torque
    becomes visible.

    Parameters
    ----------
    model : Model
        Model of the axis.
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
    """Return the time spans of the estimator glr in samples, computed from the axis time scale."""
    scale = time_scale(model, period)
    if commissioning is None:
        commissioning = 0.0 if known else FIRST * scale
    at_least_zero("commissioning", commissioning, "the initialisation time [s]")
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
            "base", "commissioning",  # `base` and `first` of `Timing`
            "searching",  # 1 during the search for cogging waves
            "awake",  # 1 after initialisation
            "taken",  # number of processed samples
            "at", "end",  # the next old sample of the second filter, and the end of its pass
            "measured",  # 1 if the first sample of the pass needs no measurement update
            "end_follows",  # 1 if the pass ends at the latest sample
            "busy",  # 1 during a pass of the second filter
            "left",  # unused budget of old samples for this new sample
            "rerun",  # total number of old samples that were filtered again
            "due",  # sample of the next review of the last finding
            "born",  # first sample in which the axis moved
            "moves",  # number of samples in which the axis moved
            "mark",  # end of the initialisation data
            "patience",  # sample before which no new comparison starts
            "asks",  # 1 if a decision is due after the last sample
        )
    ]
    + [
        (name, float)
        for name in (
            "misfit_share", "period",
            "angle", "read",  # motor angle since the start of motion, and the last output
            "repeated", "z_before",  # Σ z[k] z[k−1] for z = e/√S, and the last z
            "chi2", "used",  # Σ e²/S, and the number of samples in this sum
            "kappa", "misfit",  # κ, and its lower limit
            "square", "product", "last",  # means of z² and z[k] z[k−1], and the last z
            "last_prediction",  # ŷ of the previous sample
            "chi2_one",  # Σ e²/S of the current pass of the second filter
            "cost_one", "cost_first",  # −2 ln likelihood of the pass, and its value at `mark`
        )
    ]
    + [("mean_speed", float, 2)]
)  # fmt: skip
"""Data type of the scalar fields of a hypothesis bank."""


class Bank(NamedTuple):
    """
    A bank of H hypotheses, one for each combination of a parameter and an onset.

    Attributes
    ----------
    now : (1,) array
        Scalar fields of the bank, with the data type `BANK`.
    which, variance, log_prior : (q,) arrays
        Index in θ, prior jump variance and log prior of each parameter that can jump.
    told : Told
        Parameter groups that are shrunk towards nominal values.
    history : (length, 4) array
        Ring buffer of the latest samples; each row contains the torque, the output after the
        outlier check, the noise variance R and the torque noise variance.
    columns, one : Columns
        The columns δ of all hypotheses, and the single column δ of the second filter.
    size, weight, precision, prior : (H,) arrays
        Estimated jump size, weight, prior precision 1/σ² and log prior of each hypothesis.
    onset, chi2_at, used_at : (slots,) arrays
        Onset in each slot, and the values of the fields ``chi2`` and ``used`` at each onset.
    kept : (slots, m+1, w) array
        Filter covariance P at each onset, with the filter state ξ as an additional last row.
    mixed : (p,) array
        Mean of the parameter estimates over all hypotheses.
    waves : Waves
        Waves that the cogging search tests.
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
    Return the initial hypothesis bank for `flexaxis.estimators.glr.loop.glr`.

    Parameters
    ----------
    design : Design
        Design of the joint filter.
    timing : Timing
        Durations in samples.
    which : (q,) sequence
        Indices in θ of the parameters that can jump.
    log_prior : (q,) array
        For each parameter that can jump, the log probability of a jump in one sample.
    told : dict of str to array
        Arrays returned by `flexaxis.estimators.filters.constrained.told_arrays`.
    waves : int
        Largest number of cogging waves per revolution that the search tests, or 0 to skip the
        search.
    """
    n, p, q = design.model.states, len(design.scale), len(which)
    slots = PER_LEVEL + MORE * (timing.levels - 1)
    # new samples arrive while the second filter processes the old ones
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
    """Return the arrays of H hypothesis columns for p parameters and n states."""
    sums = {name + "J": np.zeros(H), name + "d": np.zeros(H)}
    return {name + "D": np.zeros((p + n, H)), name + "moved": np.zeros((n + 1, H))} | sums
