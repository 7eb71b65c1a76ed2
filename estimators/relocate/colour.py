"""
What is normal in a residual, and the alarm that it no longer is: compiled parts of one record.

A residual that a model leaves for good, such as that of friction, repeats itself from sample to
sample. An autoregressive model learns how, and takes that out before the alarm judges the rest. The
model of a while ago may make things worse, as after a transient has died away. So it is in use only
while it pays, while what it leaves of the residual has been smaller than the residual itself.
"""

import numpy as np

from flexaxis.estimators.recursion.measurement import ASLEEP
from flexaxis.estimators.recursion.records import Record, record
from flexaxis.estimators.sampling.compiler import inlined

ORDER = 4  # of the autoregressive model
GROWTH = (4.0, 1.6)  # of the residual's variance, that two alarms side by side listen for
WARM_UP = 1.0  # s of residuals heard before the first alarm
COLOUR_MEMORY = 10.0  # s, of which the correlations of the residual are the mean
TRIAL_MEMORY = 1.0  # s, over which a whitener has to have paid
CLIP = 4.0  # standard deviations that a single residual counts at most

NORMAL = ("heard", "correlations", "model", "colour", "unforeseen", "plain", "correlation", "power")
"""Fields of the state that say what is normal."""


def listening(alarm: float, period: float) -> tuple[Record, Record]:
    """
    Return tuning and state for `listen`.

    Parameters
    ----------
    alarm : float
        Evidence that raises an alarm [nats].
    period : float
        Sampling period [s].
    """
    tuning = record(
        threshold=float(alarm),
        growth=GROWTH,
        warm_up=WARM_UP / period,
        colour_memory=COLOUR_MEMORY / period,
        trial_memory=TRIAL_MEMORY / period,
    )
    white = np.r_[np.zeros(ORDER), 1.0]
    state = record(
        armed=1,
        learning=1,  # whether what is normal is learnt
        heard=0.0,  # residuals learnt from, up to the longer memory
        evidence=np.zeros(len(GROWTH)),  # that the residual has grown [nats]
        silent=np.zeros(len(GROWTH), int),  # last sample at which there was none
        lags=np.zeros(ORDER),  # last residuals over their deviation, latest first
        correlations=np.zeros(ORDER + 1),  # of them, by lag
        model=white,  # as `write_colour` writes it
        colour=white,  # the same while it pays, else that of white noise
        unforeseen=0.0,  # mean square of what the model leaves …
        plain=0.0,  # … and of the residual itself
        white=0.0,  # last residual that was judged
        correlation=0.0,  # of one with the next
        power=0.0,  # mean square of y
    )
    return tuning, state


@inlined
def listen(tuning, state, y):
    """
    Add one residual to the evidence that its variance has grown; return whether that suffices.

    CUSUM of the likelihood ratio of variance ``growth`` times what it was, against what it was
    (E. S. Page, Biometrika 41, 1954), on the whitened residual. One residual counts no more than
    four deviations, so that a single outlier raises no alarm. While the axis rests there is nothing
    to hear: no parameter can show in the residual.
    """
    variance = state["quiet"] * state["scale"]
    early = state["samples"] <= 1.0  # there is no noise yet to compare with
    if np.isnan(state["epsilon"]) or not variance > 0.0 or early or resting(state):
        return False
    residual = min(max(state["epsilon"] / np.sqrt(variance), -CLIP), CLIP)
    colour = state["colour"]
    white = (residual - foretold(colour, state["lags"])) / np.sqrt(colour[ORDER])
    white = min(max(white, -CLIP), CLIP)
    hear(tuning, state, y, residual, white)
    deaf = state["armed"] == 0 or state["heard"] < tuning["warm_up"]
    ringing = False
    for i in range(len(state["evidence"])):
        growth = tuning["growth"][i]
        gained = (white**2 * (1.0 - 1.0 / growth) - np.log(growth)) / 2.0
        state["evidence"][i] += gained / repetition(state["correlation"])
        if deaf or state["evidence"][i] <= 0.0:
            state["evidence"][i] = 0.0
            state["silent"][i] = state["count"]
        ringing |= state["evidence"][i] > tuning["threshold"]
    return ringing


@inlined
def resting(state):
    """Whether nothing excites the axis: doubling any parameter would not show in the noise."""
    excitation = 0.0
    for i in range(len(state["psi"])):
        excitation += state["psi"][i] ** 2
    return excitation <= (ASLEEP * state["quiet"] if state["samples"] > 1.0 else 0.0)


@inlined
def foretold(colour, lags):
    """Return what the last residuals say of the next one."""
    expected = 0.0
    for i in range(ORDER):
        expected += colour[i] * lags[i]
    return expected


@inlined
def hear(tuning, state, y, residual, white):
    """Take one residual into the running means, and from them the colour."""
    lags, correlations = state["lags"], state["correlations"]
    if state["learning"]:
        state["heard"] = min(state["heard"] + 1.0, tuning["colour_memory"])
        share = 1.0 / state["heard"]
        trial = 1.0 / min(state["heard"], tuning["trial_memory"])
        surprise = residual - foretold(state["model"], lags)
        state["unforeseen"] += trial * (surprise**2 - state["unforeseen"])
        state["plain"] += trial * (residual**2 - state["plain"])
        state["power"] += share * (y**2 - state["power"])
        correlations[0] += share * (residual**2 - correlations[0])
        for i in range(ORDER):
            correlations[1 + i] += share * (residual * lags[i] - correlations[1 + i])
        state["correlation"] += share * (white * state["white"] - state["correlation"])
        write_colour(correlations, share, state["model"])
        pays = state["unforeseen"] <= state["plain"]
        for i in range(ORDER):
            state["colour"][i] = state["model"][i] if pays else 0.0
        state["colour"][ORDER] = state["model"][ORDER] if pays else 1.0
    state["white"] = white
    for i in range(ORDER - 1, 0, -1):
        lags[i] = lags[i - 1]
    lags[0] = residual


@inlined
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
    remains = total
    for m in range(order):
        rest = correlations[m + 1]
        for i in range(m):
            rest -= colour[i] * correlations[m - i]
        reflection = rest / remains
        for i in range((m + 1) // 2):
            first, last = colour[i], colour[m - 1 - i]
            colour[i] = first - reflection * last
            colour[m - 1 - i] = last - reflection * first
        colour[m] = reflection
        remains *= 1.0 - reflection**2
    colour[order] = remains / total


@inlined
def repetition(correlation):
    """
    Return how many correlated residuals tell as much as a single white one.

    (1+ρ)/(1−ρ), the integral of the autocorrelation of an AR(1) process. Without it unmodelled
    dynamics, which repeat themselves from sample to sample, would pass for overwhelming evidence.
    """
    bounded = min(max(correlation, 0.0), 0.99)
    return (1.0 + bounded) / (1.0 - bounded)
