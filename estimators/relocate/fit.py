"""
Explain a stretch of data by a change of some parameters at a known time.

The state at the change is known, so the sensitivities start there at zero, as in the oracle
Cramér–Rao bound. Levenberg–Marquardt, and Laplace's approximation of the evidence
(D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, ch. 27–28).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.normal import add, begun, finish
from flexaxis.estimators.relocate.solving import moved, prior, product, put, solve
from flexaxis.estimators.relocate.work import CALL, MOST, Work, of_sum, samples_of, to_begin
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

TRIALS = 2  # steps of the onset by one sample, at most
ITERATIONS = 5  # of one fit, at most
CONVERGED = 0.02  # nats that a further step would gain
WIDEST, NARROWEST = 1e6, 1e-6  # damping
TRIAL = 16  # samples that take as long as to begin another trial

DONE, SAMPLE, TRIES, ONSET, DIRECTION, STEPS, BEST = range(7)  # of `Course.at`
COST, MISFIT, DAMPING, EVIDENCE, LEFT = range(5)  # of `Course.value`


class Past(NamedTuple):
    """
    What a filter knew at some samples in a row, and what was measured from the first on.

    Attributes
    ----------
    theta : (m, p) array
        All parameters, at each sample at which a change may have happened.
    x : (m, n) array
        State.
    likelihood : (m,) array
        Logarithm of the likelihood of the filter up to there [nats].
    u : (N, 2) array
        Torque held after sample j of these, and the motor angle at it; N ≥ m.
    y : (N,) array
        The output one sample later.
    present : (N,) bool array
        Where y is measured.
    epsilon : (m + ORDER,) array
        Residual of the filter, from ``ORDER`` samples before the first on; zero where y is missing.
    colour : (ORDER,) array
        Weights of the last residuals in the prediction of the next, latest first.
    variance : float
        Of what that leaves of the residual, before any change.
    """

    theta: Array
    x: Array
    likelihood: Array
    u: Array
    y: Array
    present: NDArray[np.bool_]
    epsilon: Array
    colour: Array
    variance: float


class Change(NamedTuple):
    """
    A change that was fitted.

    Attributes
    ----------
    onset : int
        Sample of the past after which the parameters were different.
    theta : (p,) array
        All parameters, after the change.
    evidence : float
        Logarithm of the probability of all data, but for a constant [nats].
    unexplained : float
        Mean square of the residual over the variance of the noise; one if all is explained.
    """

    onset: int
    theta: Array
    evidence: float
    unexplained: float


class Course(NamedTuple):
    """
    Where a search for the best onset is, and the fit at one: arrays, which compiled code writes.

    Attributes
    ----------
    at : (7,) int array
        Whether it is done, samples of the trial, trials before it, onset, direction of the search
        and steps in it, and the best onset.
    value : (5,) array
        Cost and misfit of θ, damping, and evidence and misfit of the best onset.
    theta, trial, after : (p,) arrays
        The best of this fit, what is evaluated, and the best of all onsets.
    step, deviation, g : (q,) arrays
    H : (q, q) array
    """

    at: NDArray[np.int64]
    value: Array
    theta: Array
    trial: Array
    after: Array
    step: Array
    deviation: Array
    g: Array
    H: Array


def explain(  # noqa: PLR0917
    terms: Terms,
    past: Past,
    active: NDArray[np.int64],
    lower: Array,
    upper: Array,
    spread: float,
    guess: int,
    theta: Array,
) -> Change:
    """
    Fit a change of some parameters, and its time, to the past; all others stay as they were.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    past : Past
    active : (q,) int array
        Parameters that may have changed.
    lower, upper : (p,) arrays
        Where the parameters may be.
    spread : float
        Standard deviation of a change, before anything is measured, relative to the parameter.
    guess : int
        Sample of the past to start from.
    theta : (p,) array
        Parameters after the change to start from.
    """
    return Change(*_explain(terms, past, active, lower, upper, spread, guess, theta))


def explaining(  # noqa: PLR0917
    terms: Terms,
    past: Past,
    active: NDArray[np.int64],
    lower: Array,
    upper: Array,
    spread: float,
    guess: int,
    theta: Array,
    *,
    grain: float,
) -> Work[Change]:
    """Do as `explain`, in pieces of so many operations."""
    cost = of_sum(terms, 1 + len(active))
    samples = samples_of(grain, cost)
    yield to_begin(terms, 1 + len(active))
    sums, course = begin(terms, past, active, spread, guess, theta)
    while not course.at[DONE]:
        yield CALL + cost * (samples + TRIAL)
        sums = proceed(terms, past, active, lower, upper, spread, sums, course, samples)
    return Change(*result(past, course))


@compiled
def _explain(terms, past, active, lower, upper, spread, guess, theta):  # noqa: PLR0917
    sums, course = begin(terms, past, active, spread, guess, theta)
    proceed(terms, past, active, lower, upper, spread, sums, course, MOST)
    return result(past, course)


@compiled
def begin(terms, past, active, spread, guess, theta):  # noqa: PLR0917
    """Return `Sums` and `Course` before the first sample."""
    q, p = len(active), len(theta)
    at, value = np.array([0, 0, 0, guess, 0, 0, guess]), np.zeros(5)
    points = np.empty(p), np.empty(p), theta.copy()
    course = Course(at, value, *points, np.empty(q), np.empty(q), np.empty(q), np.empty((q, q)))
    return _fit_at_onset(terms, past, active, spread, course), course


@compiled
def proceed(terms, past, active, lower, upper, spread, sums, course, most):  # noqa: PLR0917
    """Go on for so many samples, of which a trial counts for `TRIAL`; return its `Sums`."""
    taken, at = 0, course.at
    while taken < most and not at[DONE]:
        onset, first = at[ONSET], at[SAMPLE]
        u, y, present = past.u[onset:], past.y[onset:], past.present[onset:]
        last = min(len(u), first + most - taken)
        add(sums, u, y, present, past.colour, first, last)
        at[SAMPLE] = last
        taken += last - first
        if last == len(u):
            taken += TRIAL
            if not _ended(past, active, lower, upper, sums, course):
                sums = _evaluate(terms, past, active, course)
            elif not _searched(past, course):
                sums = _fit_at_onset(terms, past, active, spread, course)
    return sums


@compiled
def result(past, course):
    """Return onset, θ, evidence and Σε²/σ² per sample of the best."""
    best, measured = course.at[BEST], 0
    for k in range(best, len(past.present)):
        measured += past.present[k]
    return best, course.after, course.value[EVIDENCE], course.value[LEFT] / max(measured, 1)


@compiled
def _fit_at_onset(terms, past, active, spread, course):
    """Begin a fit at another onset, from the best θ so far."""
    before = past.theta[course.at[ONSET]]
    put(before, course.theta)
    for a in range(len(active)):
        course.theta[active[a]] = course.after[active[a]]
        course.deviation[a] = spread * abs(before[active[a]])
        course.step[a] = 0.0
    put(course.theta, course.trial)
    course.at[TRIES], course.value[DAMPING] = 0, 1e-3
    return _evaluate(terms, past, active, course)


@compiled
def _evaluate(terms, past, active, course):
    """Begin the sums of a trial."""
    onset, order = course.at[ONSET], len(past.colour)
    course.at[SAMPLE] = 0
    residuals = past.epsilon[onset + 1 : onset + 1 + order]
    return begun(terms, course.trial, active, past.x[onset], residuals, order)


@compiled
def _ended(past, active, lower, upper, sums, course):  # noqa: PLR0917
    """Take what came of a trial (Levenberg–Marquardt); return whether it was the last."""
    value, at, step, deviation = course.value, course.at, course.step, course.deviation
    before, ended = past.theta[at[ONSET]], False
    fit = finish(sums, past.variance)
    tried = fit + prior(course.trial, before, active, deviation, sums.H, sums.g)
    if not at[TRIES] or tried < value[COST]:
        if at[TRIES]:
            ended = value[COST] - tried < CONVERGED
            value[DAMPING] = max(value[DAMPING] / 10, NARROWEST)
        value[COST], value[MISFIT] = tried, fit
        put(course.trial, course.theta)
        put(sums.g, course.g)
        for a in range(len(step)):
            put(sums.H[a], course.H[a])
    else:
        value[DAMPING] *= 10
        ended = value[DAMPING] > WIDEST or product(step, course.g) < CONVERGED
    at[TRIES] += 1
    if ended or at[TRIES] > (ITERATIONS if len(active) else 0):
        return True
    solve(course.H, course.g, value[DAMPING], step)
    put(moved(course.theta, step, active, lower, upper), course.trial)
    return False


@compiled
def _searched(past, course):
    """Judge what came of a fit by its evidence, and go to the next onset; true without one."""
    at, value, latest, logarithm = course.at, course.value, len(past.theta) - 1, 0.0
    if len(course.step):
        logarithm = solve(course.H, course.g, 0.0, course.step)
        for a in range(len(course.step)):
            logarithm += 2 * np.log(course.deviation[a])
    evidence = past.likelihood[at[ONSET]] - (value[COST] + logarithm) / 2
    if at[DIRECTION] and evidence <= value[EVIDENCE]:
        at[STEPS] = TRIALS  # no further this way
    else:
        at[BEST], value[EVIDENCE], value[LEFT] = at[ONSET], evidence, value[MISFIT]
        at[STEPS] += 1
        put(course.theta, course.after)
    if not at[DIRECTION]:
        at[DIRECTION], at[STEPS] = -1, 0
    while True:
        at[ONSET] = at[BEST] + at[DIRECTION]
        if at[STEPS] < TRIALS and 0 <= at[ONSET] <= latest:
            return False
        if at[DIRECTION] > 0:
            at[DONE] = 1
            return True
        at[DIRECTION], at[STEPS] = 1, 0
