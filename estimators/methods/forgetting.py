"""
The prediction-error method with two other rules of forgetting: CUSUM reset and variable factor.

The first rule resets P when the residual increases. The rule computes the cumulative sum (CUSUM)
g ← max(0, g + 3/8 s − ln 2) with s = ε²/(R̂(1+ψᵀPψ)). s is limited to 16, and R̂ does not include
the current sample. The increment of g is the log-likelihood ratio for a fourfold variance (E. S.
Page, *Continuous inspection schemes*, Biometrika 41, 1954). When g exceeds the alarm level, P is
set to the covariance of an unknown change, and g is set to zero (F. Gustafsson, *Adaptive Filtering
and Change Detection*, Wiley 2000, ch. 3).

The second rule computes the forgetting factor from the residual, λ = σ_q σ_v/|σ_e − σ_v|, limited
to the value of the option ``forgetting``. The filter therefore forgets faster while the residual is
large (C. Paleologu, J. Benesty and S. Ciochină, *A robust variable forgetting factor recursive
least-squares algorithm for system identification*, IEEE Signal Processing Letters 15 (2008)
597–600). σ_e² and σ_q² are running means of ε² and (ψᵀPψ)² with a memory of 0.3 s. σ_v² is a
running mean of ε² with a memory of 2 s and represents the noise. Until this time has passed, each
value is the mean over all samples so far.
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
    Return the prediction-error method with a reset of P by a CUSUM.

    Parameters
    ----------
    forgetting : float, optional
        Forgetting factor λ per sample between alarms.
    reset : float
        Standard deviation of θ after a reset of P, relative to θ(0).
    level : float
        Alarm threshold [nats].
    robust, ceiling
        Options of `flexaxis.estimators.Rpem`.
    """
    rule = {
        "rule": CUSUM,
        "reset": above_zero("reset", reset, "a standard deviation relative to θ(0)") ** 2,
        "level": above_zero("level", level, "an alarm threshold in nats"),
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
        Largest forgetting factor λ per sample.
    level : float
        Ratio of the standard deviations of residual and noise above which the filter forgets more.
    robust, ceiling
        Options of `flexaxis.estimators.Rpem`.
    """
    rule = {
        "rule": VARIABLE,
        "level": above_zero("level", level, "a ratio of standard deviations"),
        "short": max(SHORT / problem.period, 2.0),
        "long": max(LONG / problem.period, 2.0),
        "least": max(1 - problem.period / FASTEST, 0.5),
    }
    options = problem.forgetting_options("variable-forgetting", forgetting)
    return Rpem(problem.model, **options, robust=robust, ceiling=ceiling, rule=rule)


ENTRIES = (
    Entry(
        "cusum-reset",
        "rpem-forgetting with a reset of P when a CUSUM of the residual raises an alarm",
        _cusum_reset,
        knob="1-forgetting",
        default=0.995,
        rank=24,
    ),
    Entry(
        "variable-forgetting",
        "rpem-forgetting with a factor that decreases while the residual is large",
        _variable_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=23,
    ),
)
