"""Interacting multiple models: joint extended Kalman filters that share what they know."""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.ekf import (
    correct,
    ekf_records,
    look,
    start_sample,
    state_covariance,
    with_state,
)
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import finite_vector, make_design
from flexaxis.estimators.recursion.filter import CompiledFilter
from flexaxis.estimators.recursion.level import judge, show
from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.records import Record, joined, record
from flexaxis.estimators.sampling.compiler import inlined
from flexaxis.estimators.sampling.pattern import Pattern, split

Array = NDArray[np.float64]

LEAST = 1e-30  # probability of a mode: from zero none comes back


def joint_imm(
    model: Model,
    *,
    identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
    theta0: ArrayLike | None = None,
    P0: ArrayLike,
    drift: ArrayLike,
    jump: ArrayLike,
    rate: float = 1e-3,
    hold: float = 0.05,
    period: float,
    noise: float | None = None,
    x0: ArrayLike | None = None,
    x0_covariance: ArrayLike | None = None,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
    output: str = "speed",
) -> CompiledFilter:
    """
    Make an interacting-multiple-model filter: a quiet mode, and one in which each θ_i jumps.

    Every mode j is a joint extended Kalman filter (`flexaxis.estimators.methods.ekf`); the quiet
    one has W, mode i W and a variance more for θ_i. Modes follow each other as a Markov chain Π.
    With the probabilities μ and Gaussian likelihoods Λ_j of the innovations, in every sample

        μ_j ← c_j Λ_j / Σ,  c_j = Σ_i Π_ij μ_i,  μ_i|j = Π_ij μ_i/c_j,
        ξ⁰_j = Σ_i μ_i|j ξ_i,  P⁰_j = Σ_i μ_i|j [P_i + (ξ_i−ξ⁰_j)(ξ_i−ξ⁰_j)ᵀ],

    and mode j goes on from ξ⁰_j, P⁰_j. Estimate, covariance and innovation are those of the
    mixture, and one R is learnt for all modes. H. A. P. Blom and Y. Bar-Shalom, *The interacting
    multiple model algorithm for systems with Markovian switching coefficients*, IEEE Trans. AC 33
    (1988) 780–783.

    Parameters
    ----------
    model, identify, theta0, P0, drift, period, noise, x0, x0_covariance, bounds, output
        As for `flexaxis.estimators.methods.ekf.joint_ekf`; ``drift`` is that of the quiet mode.
    jump : (p,) array_like
        Variance that θ_i gains in every sample while it jumps.
    rate : float
        How often any parameter jumps [1/s].
    hold : float
        How long a jump mode lasts, on average [s].

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    design = make_design(
        model,
        identify=identify,
        theta0=theta0,
        P0=P0,
        drift=drift,
        period=period,
        noise=noise,
        x0=x0,
        bounds=bounds,
        output=output,
    )
    p = len(design.theta0)
    if not (0 < rate * period < 1 and period < hold < np.inf):
        raise EstimatorError(
            f"rate is {rate} and hold {hold}; a jump comes less than once and lasts more than one "
            f"sample of {period} s"
        )
    variances = finite_vector("jump", jump, p)
    if not (variances >= 0).all():
        raise EstimatorError(f"jump is {jump!r}; give variances that are not negative")
    pattern = with_state(split(design.model)[0])
    tuning, start = ekf_records(design, pattern, state_covariance(design, x0_covariance))
    tuning = np.repeat(joined(tuning, record(stay=1 - period / hold)), 1 + p)
    tuning["stay"][0] = 1 - rate * period
    for i, variance in enumerate(variances / design.scale**2):
        tuning["drift"][1 + i, i, i] += variance
    m = pattern.p  # θ and x
    start = joined(
        start,
        record(
            probability=0.0,
            predicted=0.0,
            logarithm=0.0,
            mixed=np.zeros(m),
            mixed_P=np.zeros((m, m)),
        ),
    )
    start = np.repeat(start, 1 + p)
    start["probability"][0] = start["predicted"][0] = 1.0
    return CompiledFilter(imm_loop(pattern), tuning, start, design, partial(_read, p))


def mode_probabilities(estimator: CompiledFilter) -> Array:
    """Return the probabilities (1+p,) of the quiet mode and of a jump of each parameter."""
    return estimator.state["probability"].copy()


def _read(p: int, state: Record) -> tuple[Array, Array]:
    weights, theta = state["predicted"], state["theta"][:, :p]  # both after mixing
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)


@lru_cache
def imm_loop(pattern: Pattern) -> Callable:
    """
    Return the compiled loop for models of this pattern.

    Tuning and state have a record for each mode; the first is the quiet one.
    """
    return sample_loop(pattern, _take, "interacting multiple models")


@inlined
def _take(tunings, states, k, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do with a sample what `flexaxis.estimators.recursion.loop.sample_loop` asks for."""
    n, p = len(states[0]["GP"]), estimates.shape[1]
    used = look_together(tunings[0], states, y[k], valid[k])
    noise = states[0]["noise"]
    for j in range(len(states)):
        listen(states[j], used, noise)
        correct(tunings[j], states[j], used, noise)
    weigh(states)
    for i in range(p):
        estimates[k, i] = 0.0
        for j in range(len(states)):
            estimates[k, i] += states[j]["probability"] * states[j]["theta"][i]
    mix(tunings, states, n, p)
    for j in range(len(states)):
        start_sample(states[j]["X"], n, p)
    show(states[0], trace[k])
    return False


@inlined
def look_together(tuning, states, y, valid):
    """Judge the sample by the mixture's prediction and its variance, in the first record."""
    mean, spread = 0.0, 0.0
    for j in range(len(states)):
        look(states[j])
        mean += states[j]["predicted"] * states[j]["X"][-1, 0]
    for j in range(len(states)):
        apart = states[j]["X"][-1, 0] - mean
        spread += states[j]["predicted"] * (states[j]["spread"] + apart**2)
    return judge(tuning, states[0], y, valid, mean, spread)


@inlined
def listen(state, y, noise):
    """Keep log Λ of the innovation, before it is used."""
    state["logarithm"] = 0.0
    if not np.isnan(y):
        S = state["spread"] + noise
        state["logarithm"] = -0.5 * (np.log(S) + (y - state["X"][-1, 0]) ** 2 / S)


@inlined
def weigh(states):
    """μ_j ← c_j Λ_j over their sum."""
    highest = -np.inf
    for j in range(len(states)):
        highest = max(highest, states[j]["logarithm"])
    total = 0.0
    for j in range(len(states)):
        share = states[j]["predicted"] * np.exp(states[j]["logarithm"] - highest)
        states[j]["probability"] = share if share > LEAST else LEAST
        total += states[j]["probability"]
    for j in range(len(states)):
        states[j]["probability"] /= total


@inlined
def transition(tunings, i, j):
    """Return Π_ij: from quiet to any jump, from a jump to quiet only."""
    stay = tunings[i]["stay"]
    if i == j:
        return stay
    if i == 0:
        return (1.0 - stay) / (len(tunings) - 1)
    return 1.0 - stay if j == 0 else 0.0


@inlined
def mix(tunings, states, n, p):
    """Give every mode the ξ⁰ and P⁰ from which it goes on."""
    for j in range(len(states)):
        c = 0.0
        for i in range(len(states)):
            c += transition(tunings, i, j) * states[i]["probability"]
        states[j]["predicted"] = c
        blend(tunings, states, j, c, p + n, p)
    for j in range(len(states)):
        state = states[j]
        for a in range(p + n):
            if a < p:
                state["theta"][a] = state["mixed"][a]
            else:
                state["X"][a - p, 0] = state["mixed"][a]
            for b in range(a + 1):
                state["P"][a, b] = state["P"][b, a] = state["mixed_P"][a, b]


@inlined
def blend(tunings, states, j, c, m, p):  # noqa: PLR0917
    """Write ξ⁰_j and the lower triangle of P⁰_j, beside what they are made from."""
    mixed, mixed_P = states[j]["mixed"], states[j]["mixed_P"]
    for a in range(m):
        mixed[a] = 0.0
        for i in range(len(states)):
            weight = transition(tunings, i, j) * states[i]["probability"] / c
            mixed[a] += weight * component(states[i], a, p)
    for a in range(m):
        for b in range(a + 1):
            mixed_P[a, b] = 0.0
            for i in range(len(states)):
                weight = transition(tunings, i, j) * states[i]["probability"] / c
                apart = component(states[i], a, p) - mixed[a]
                other = component(states[i], b, p) - mixed[b]
                mixed_P[a, b] += weight * (states[i]["P"][a, b] + apart * other)


@inlined
def component(state, a, p):
    """Return ξ_a of [θ; x]."""
    return state["theta"][a] if a < p else state["X"][a - p, 0]
