"""Tuning and state of interacting multiple models that share one linearisation, before a sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.level import level
from flexaxis.estimators.recursion.records import Record, joined, on_lanes, record
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.symmetric import padded

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Modes:
    """
    How θ moves, relative to its scale.

    Attributes
    ----------
    which : tuple of int
        The parameters that jump, each in a mode of its own.
    walk : (p,) array
        What the variances of θ gain in every sample, in every mode.
    jump : (modes−1,) array
        What that of a parameter gains in every sample of its mode besides.
    rate : (modes−1,) array
        How often a parameter jumps [1/s].
    hold : float
        How long a jump lasts on average [s].
    """

    which: tuple[int, ...]
    walk: Array
    jump: Array
    rate: Array
    hold: float


ALARM = 0.5  # probability of all jumps together from which on one has happened
CALM, CALM_FOR = 0.1, 0.5  # below which none is going on, and for how long until the next [s]
REMEMBERED = 2.5  # s of estimates kept, for how they were before a jump
ECHO = 10.0  # s over which the repetition of innovations is learnt
NEVER = -1  # the sample of a look that is not due


def modal_records(
    design: Design, pattern: Pattern, modes: Modes, covariance: Array
) -> tuple[Record, Record]:
    """
    Return tuning and start of `flexaxis.estimators.recursion.shared`.

    Parameters
    ----------
    design : Design
    pattern : Pattern
        Of the model `flexaxis.estimators.recursion.joint.with_state`.
    modes : Modes
    covariance : (n, n) array
        Of x(0).
    """
    n, m, J, period = pattern.states, pattern.p, 1 + len(modes.which), design.period
    p, q = m - n, J - 1
    tuning, start = on_lanes(design, pattern)
    known, level_start = level(design)
    blocks, X = design.model.blocks(design.theta0), start["X"][0]
    C = blocks[:, -1, :-1]
    X[:n, 1 + p : 1 + m] = np.eye(n)
    X[-1, 1 : 1 + p], X[-1, 1 + p : 1 + m] = C[1:] @ design.x0, C[0, :n]
    P = np.zeros((J, m, padded(m)))
    P[:, :p, :p], P[:, p:, p:m] = design.P0, covariance
    walk = np.zeros((p, p))
    walk[np.diag_indices(p)] = modes.walk
    chain = record(
        walk=walk,
        jump=modes.jump,
        which=np.array(modes.which),
        quiet=1 - float(np.sum(modes.rate)) * period,
        come=modes.rate * period,
        stay=1 - period / modes.hold,
        lower=design.lower,
        upper=design.upper,
        echo_share=period / ECHO,
        alarm_above=ALARM,
        calm_below=CALM,
        calm_for=round(CALM_FOR / period),
    )
    certain = np.r_[1.0, np.zeros(q)]
    filters = record(
        P=P,
        delta=np.zeros((J, m)),
        predicted=certain,
        probability=certain,
        logarithm=np.zeros(J),
        echo=np.array([0.0, 1.0, np.nan]),
    )
    work = record(
        Ph=np.zeros(m),
        spread=np.zeros(J),
        shift=np.zeros(J),
        moved=np.zeros(n),
        gain=np.zeros(m),
        apart=np.zeros(m),
        mixed=np.zeros(m),
        mixed_P=np.zeros(P.shape[1:]),
    )
    watched = record(
        ring=np.zeros((round(REMEMBERED / period), q + q * q + 1)),
        samples_taken=0,
        due=NEVER,
        armed=1,
        calm=0,
        asks=0,  # whether somebody has to look after the last sample
    )
    return joined(tuning, known, chain), joined(start, level_start, filters, work, watched)
