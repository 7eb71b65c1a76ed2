"""The recent past of a filter and an alarm on its residual, in the compiled loop of `relocate`."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.kernel import (
    correct_state,
    grown,
    measure,
    predict,
    state_type,
    tuning_type,
)
from flexaxis.estimators.sampling.compiler import compile_loop, jit
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import Pattern

LENGTH = 1024  # samples remembered
COLOUR_MEMORY = 2000.0  # samples of which the correlations of the residual are the mean
WATCHES = 2  # alarms side by side
ORDER = 4  # of the autoregressive model of the residual


def watched_tuning_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `tuning_type` and the settings of the alarm."""
    return grown(tuning_type(pattern), [("threshold", float), ("growth", float, (WATCHES,))])


def watched_state_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `state_type`, the alarm and the past after each measurement."""
    p, lanes = pattern.p, pattern.lanes
    return grown(
        state_type(pattern),
        [
            ("count", int),  # samples taken
            ("stop", int),  # count at which to stop and look
            ("armed", int),
            ("evidence", float, (WATCHES,)),  # that the residual has grown [nats]
            ("quiet", int, (WATCHES,)),  # last sample at which there was none
            ("learning", int),  # whether the colour of the residual is learnt
            ("lags", float, (ORDER,)),  # last residuals over their deviation, latest first
            ("correlations", float, (ORDER + 1,)),  # of them, by lag
            ("colour", float, (ORDER + 1,)),  # as from `colour`
            ("last", float),  # whitened residual
            ("correlation", float),  # of one with the next
            ("past_u", float, (LENGTH,)),
            ("past_y", float, (LENGTH,)),
            ("past_valid", np.uint8, (LENGTH,)),
            ("past_theta", float, (LENGTH, p)),
            ("past_P", float, (LENGTH, p, p)),
            ("past_X", float, (LENGTH, pattern.n + 1, lanes)),
            ("past_noise", float, (LENGTH,)),
            ("past_scale", float, (LENGTH,)),  # 1 + ψᵀPψ
            ("past_epsilon", float, (LENGTH,)),
            ("past_repeated", float, (LENGTH,)),
            ("past_correlations", float, (LENGTH, ORDER + 1)),
            ("past_colour", float, (LENGTH, ORDER + 1)),
        ],
    )


def widened(record: NDArray[np.void], kind: np.dtype) -> NDArray[np.void]:
    """Return a record with more fields, zero as yet."""
    wide = np.zeros(1, kind)
    for name in record.dtype.names or ():
        wide[name] = record[name]
    return wide


@lru_cache
def watched_loop(pattern: Pattern) -> Callable:
    """
    Return the compiled loop: `rpem_loop` with state correction, a memory and an alarm.

    Returns
    -------
    callable
        ``run(tuning, state, u, y, valid, estimates)``; stops after the sample at which the alarm
        goes off, or at which ``count`` reaches ``stop``.
    """
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            scale = uncertainty(state)
            noise = state["noise"]
            measure(tuning, state, y[k], valid[k])
            correct_state(state)
            ringing = listen(tuning, state, noise * scale)
            remember(state, u[k], y[k], valid[k], scale)
            predict(tuning, state)
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(estimates.shape[1]):
                estimates[k, i] = state["theta"][i]
            if ringing or state["count"] == state["stop"]:
                break

    return compile_loop(run, flat, watched_tuning_type(pattern), watched_state_type(pattern))


@jit
def uncertainty(state):
    """Return 1 + ψᵀPψ, by which the variance of the residual exceeds that of the noise."""
    X, P = state["X"], state["P"]
    scale = 1.0
    for i in range(len(P)):
        for j in range(len(P)):
            scale += X[-1, 1 + i] * P[i, j] * X[-1, 1 + j]
    return scale


@jit
def listen(tuning, state, variance):
    """
    Add one residual to the evidence that its variance has grown; return whether that suffices.

    CUSUM of the likelihood ratio of variance ``growth`` times what it was, against what it was
    (E. S. Page, Biometrika 41, 1954), on the whitened residual. One residual counts no more than
    four deviations, so that a single outlier raises no alarm.
    """
    if np.isnan(state["epsilon"]):
        return False
    residual = min(max(state["epsilon"] / np.sqrt(variance), -4.0), 4.0)
    expected = 0.0
    for i in range(ORDER):
        expected += state["colour"][i] * state["lags"][i]
    white = (residual - expected) / np.sqrt(state["colour"][ORDER])
    white = min(max(white, -4.0), 4.0)
    learn(state, residual, white)
    if not state["armed"]:
        return False
    ringing = False
    for i in range(WATCHES):
        growth = tuning["growth"][i]
        gained = (white**2 * (1.0 - 1.0 / growth) - np.log(growth)) / 2.0
        state["evidence"][i] += gained / repetition(state["correlation"])
        if state["evidence"][i] <= 0.0:
            state["evidence"][i] = 0.0
            state["quiet"][i] = state["count"]
        ringing |= state["evidence"][i] > tuning["threshold"]
    return ringing


@jit
def learn(state, residual, white):
    """Take one residual into the running correlations, and from them the colour."""
    lags, correlations = state["lags"], state["correlations"]
    if state["learning"]:
        share = 1.0 / min(state["count"] + 1.0, COLOUR_MEMORY)
        correlations[0] += share * (residual**2 - correlations[0])
        for i in range(ORDER):
            correlations[1 + i] += share * (residual * lags[i] - correlations[1 + i])
        state["correlation"] += share * (white * state["last"] - state["correlation"])
        write_colour(correlations, share, state["colour"])
    state["last"] = white
    for i in range(ORDER - 1, 0, -1):
        lags[i] = lags[i - 1]
    lags[0] = residual


@jit
def write_colour(correlations, share, colour):
    """
    Write the autoregressive model of a process with these correlations.

    The Levinson recursion (J. Durbin, Rev. Inst. Int. Stat. 28, 1960); ``colour[:-1]`` weighs the
    last residuals to predict the next one, latest first, and ``colour[-1]`` is the variance of what
    remains over that of the residual. A white floor, small once many samples have been seen,
    keeps chance correlations of the first samples out.
    """
    order = len(colour) - 1
    total = correlations[0] * (1.0 + order * share) + 1e-9
    before = np.zeros(len(colour))
    remains = total
    for m in range(order):
        rest = correlations[m + 1]
        for i in range(m):
            rest -= before[i] * correlations[m - i]
        reflection = rest / remains
        for i in range(m):
            colour[i] = before[i] - reflection * before[m - 1 - i]
        colour[m] = reflection
        remains *= 1.0 - reflection**2
        for i in range(m + 1):
            before[i] = colour[i]
    colour[order] = remains / total


@jit
def repetition(correlation):
    """
    Return how many correlated residuals tell as much as a single white one.

    (1+ρ)/(1−ρ), the integral of the autocorrelation of an AR(1) process. Without it unmodelled
    dynamics, which repeat themselves from sample to sample, would pass for overwhelming evidence.
    """
    bounded = min(max(correlation, 0.0), 0.99)
    return (1.0 + bounded) / (1.0 - bounded)


@jit
def remember(state, u, y, valid, scale):
    """Write what is known after the measurement of this sample into the ring."""
    j = state["count"] % len(state["past_u"])
    p = len(state["theta"])
    state["past_u"][j], state["past_y"][j], state["past_valid"][j] = u, y, int(valid)
    state["past_noise"][j], state["past_scale"][j] = state["noise"], scale
    state["past_epsilon"][j] = state["epsilon"] if valid else 0.0
    state["past_repeated"][j] = repetition(state["correlation"])
    for i in range(len(state["correlations"])):
        state["past_correlations"][j, i] = state["correlations"][i]
        state["past_colour"][j, i] = state["colour"][i]
    for i in range(p):
        state["past_theta"][j, i] = state["theta"][i]
        for m in range(p):
            state["past_P"][j, i, m] = state["P"][i, m]
    X = state["X"]
    for i in range(X.shape[0]):
        for m in range(X.shape[1]):
            state["past_X"][j, i, m] = X[i, m]
    state["count"] += 1
