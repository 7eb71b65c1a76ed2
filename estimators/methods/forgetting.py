"""
The prediction-error method with a CUSUM reset of P or with a variable forgetting factor.

The CUSUM (cumulative sum) rule resets P when a sum of squared residuals indicates a change.
Each sample updates the cumulative sum by g ← max(0, g + 3/8 s − ln 2), where s = ε²/(R̂(1+ψᵀPψ)) is
the normalised squared residual. The normalised squared residual s is limited to 16. The noise
variance R̂ in the formula for s does not include the current sample. The increment of the
cumulative sum g is the log-likelihood ratio for a fourfold increase of the residual variance, as in
*Continuous inspection schemes* (Page, 1954). When the cumulative sum g exceeds the alarm level, P
is set to the assumed covariance of a parameter change, and g is set to zero. Chapter 3 of *Adaptive
Filtering and Change Detection* (Gustafsson, 2000) describes CUSUM tests.

The variable-factor rule computes the forgetting factor λ = σ_q σ_v/|σ_e − σ_v| from the residual;
the option ``forgetting`` is the upper limit of λ. The filter therefore forgets faster while the
residual is large. The variable-factor rule comes from *A robust variable forgetting factor
recursive least-squares algorithm for system identification* (Paleologu, Benesty and Ciochină,
2008). The quantities σ_e² and σ_q² are running means of ε² and (ψᵀPψ)² with a memory of 0.3 s. The
noise variance σ_v² is a running mean of ε² with a memory of 2 s. Until its memory is full, each
running mean is the arithmetic mean over all samples so far.
"""

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.forgetting import CUSUM, VARIABLE
from flexaxis.estimators.filters.prediction_error import CALM, CEILING, ROBUST
from flexaxis.estimators.filters.state import KNOWN
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

FIRST, NEXT = 1.0, 0.5  # s, shortest time before the first alarm (to learn R̂) and between alarms


def _cusum_reset(
    problem: Problem,
    *,
    forgetting: float | None = None,
    reset: float = 0.1,
    level: float = 10.0,
    robust: float = ROBUST,
    ceiling: float = CEILING,
) -> Rpem:
    """
    Return the prediction-error method in which a CUSUM alarm resets P.

    Parameters
    ----------
    forgetting : float, optional
        Forgetting factor λ per sample between two alarms.
    reset : float
        Standard deviation of each parameter after a reset of P, relative to θ(0).
    level : float
        Alarm threshold of the CUSUM [nats].
    robust, ceiling : float
        As for `Rpem`.
    """
    rule = {
        "rule": CUSUM,
        "reset": above_zero("reset", reset, "the standard deviation after a reset") ** 2,
        "level": above_zero("level", level, "the alarm threshold [nats]"),
        "first": max(FIRST / problem.period, KNOWN),
        "next": NEXT / problem.period,
    }
    return Rpem(
        problem.model,
        **problem.forgetting_options("cusum-reset", forgetting),
        state_correction=True,  # after an alarm P is large, so θ changes by large steps
        robust=robust,
        ceiling=ceiling,
        rule=rule,
    )


SHORT, LONG = 0.3, 2.0  # s, memories of the residual and of the noise: 60 and 400 samples at 5 ms
FASTEST = 0.05  # s, shortest time constant of forgetting; λ = 0.9 at 5 ms


def _variable_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    level: float = 2.0,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> Rpem:
    """
    Return the prediction-error method with a variable forgetting factor.

    Parameters
    ----------
    forgetting : float, optional
        Upper limit on the forgetting factor λ per sample.
    level : float
        Threshold for the ratio of the rms residual to the noise standard deviation. Above the
        threshold, the filter forgets faster.
    robust, ceiling : float
        As for `Rpem`.
    """
    rule = {
        "rule": VARIABLE,
        "level": above_zero("level", level, "the threshold ratio"),
        "short": max(SHORT / problem.period, 2.0),
        "long": max(LONG / problem.period, 2.0),
        "least": max(1 - problem.period / FASTEST, 0.5),
    }
    options = problem.forgetting_options("variable-forgetting", forgetting)
    return Rpem(problem.model, **options, robust=robust, ceiling=ceiling, rule=rule)


ENTRIES = (
    Entry(
        "cusum-reset",
        "rpem-forgetting with a reset of P when a CUSUM test of the residual raises an alarm",
        _cusum_reset,
        knob="1-forgetting",
        default=0.995,
        rank=24,
    ),
    Entry(
        "variable-forgetting",
        "rpem-forgetting with a forgetting factor that decreases while the residual is large",
        _variable_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=23,
    ),
)
