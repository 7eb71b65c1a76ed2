"""One sample of the filter that remembers, in compiled code, and what is normal learnt again."""

import numpy as np

from flexaxis.estimators.recursion.astray import ABSURD
from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.measurement import (
    KNOWN,
    correct_state,
    learn,
    measure,
    predict,
    publish,
)
from flexaxis.estimators.recursion.records import Record
from flexaxis.estimators.relocate.colour import listen, resting
from flexaxis.estimators.relocate.follow import integrate
from flexaxis.estimators.relocate.replay import Replayed
from flexaxis.estimators.sampling.compiler import Compiled, compiled, inlined, remembered
from flexaxis.estimators.sampling.pattern import Pattern


@remembered
def remembering_loop(pattern: Pattern, size: int) -> Compiled:
    """
    Return the compiled loop: a filter with forgetting and state correction, memory and alarm.

    ``run(tunings, states, u, y, valid, estimates, trace, words, ring)`` stops after the sample at
    which the alarm goes off, ``count`` reaches ``stop``, or a guarded filter diverges. ``words`` is
    the state once more, as numbers of eight bytes, of which the first ``size`` are remembered.
    """

    @inlined
    def remember(tunings, states, k, u, y, valid, estimates, trace, words, ring):  # noqa: PLR0917
        """Take one sample, as `flexaxis.estimators.recursion.loop` wants it."""
        tuning, state = tunings[0], states[0]
        taken = valid[k] and not absurd(tuning, state, y[k])
        measure(tuning, state, y[k], taken)
        correct_state(state)
        ringing = listen(tuning, state, y[k])
        integrate(tuning, state, y[k], taken)
        state["u"][0], state["y"], state["valid"] = u[k], y[k], int(taken)
        place = state["count"] % len(ring)
        state["count"] += 1
        for i in range(size):
            ring[place, i] = words[0, i]
        if taken and not resting(state):  # nothing is forgotten while nothing can be learnt
            predict(tuning, state)
        publish(state, k, estimates, trace)
        return ringing or state["count"] == state["stop"] or diverged(state)

    return sample_loop(pattern, remember, "relocate")


@inlined
def absurd(tuning, state, y):
    """
    Return whether y is no reading of this axis: it is taken for missing, and remembered so.

    A filter limits what it learns of it. But a search, a fit and an alarm look at all that is
    remembered, and means of squares would not forget it for minutes.
    """
    if state["samples"] == 0.0:
        return False  # there is nothing to compare it with
    expected, factor = state["X"][-1, 0], ABSURD
    if state["samples"] < KNOWN and tuning["known"] <= 0.0:  # as of any limit that early
        factor *= (KNOWN / state["samples"]) ** 2
    usual = max(state["signal"], expected**2, state["noise"])
    return (y - expected) ** 2 > factor**2 * usual


@inlined
def diverged(state):
    """Return whether θ is no number, in a filter that minds it."""
    total = 0.0
    if state["guarded"]:
        for i in range(len(state["theta"])):
            total += state["theta"][i]
    return not np.isfinite(total)


@compiled
def relearn(tunings, rows, spread, before):
    """Learn noise and colour again from the residuals of some rows, in order."""
    tuning, earlier = tunings[0], before[0]
    for k in range(len(rows)):
        row = rows[k]
        hand_on(earlier, row)
        row["armed"], row["learning"], row["quiet"] = 0, 1, row["noise"]
        if not np.isnan(row["epsilon"]):
            listen(tuning, row, row["y"])
            learn(tuning, row, row["epsilon"] ** 2 / spread[k])
        earlier = row


def hear_again(
    tuning: Record, state: Record, rows: Record, before: Record, replayed: Replayed
) -> None:
    """
    Write what is known of each sample but for the parameters, by what another filter makes of it.

    Parameters
    ----------
    tuning, state : (1,) records
        The tuning as of `HEARS`; the filter now.
    rows, before : (N,), (1,) records
        What was known of each sample, and before the first.
    replayed : Replayed
        The other filter.
    """
    last = rows["epsilon"][-1]
    rows["epsilon"], rows["scale"] = replayed.epsilon[:-1], replayed.scale[:-1]
    rows["psi"] = replayed.X[:-1, 1:, -1]
    if state["guarded"][0]:  # what has diverged says nothing of how large y is
        rows["expected"] = replayed.X[:-1, 0, -1]
        rows["signal"] = state["signal"] = state["power"]
    relearn(tuning, rows, replayed.spread, before)
    # what the other filter left out is left out for good, but for the last sample, of which it
    # is not known yet whether it is an outlier
    rows["valid"][:-1] = ~np.isnan(replayed.epsilon[:-2])
    if np.isnan(replayed.epsilon[-2]):
        rows["epsilon"][-1] = last


@inlined
def hand_on(earlier, later):
    """Copy what is known of noise and colour."""
    for i in range(len(later["lags"])):
        later["lags"][i] = earlier["lags"][i]
    for i in range(len(later["colour"])):
        later["colour"][i] = earlier["colour"][i]
        later["model"][i] = earlier["model"][i]
        later["correlations"][i] = earlier["correlations"][i]
    later["noise"], later["samples"] = earlier["noise"], earlier["samples"]
    later["heard"], later["power"] = earlier["heard"], earlier["power"]
    later["unforeseen"], later["plain"] = earlier["unforeseen"], earlier["plain"]
    later["white"], later["correlation"] = earlier["white"], earlier["correlation"]


HANDED_ON = (
    "lags", "colour", "model", "correlations", "noise", "samples", "heard", "power", "unforeseen",
    "plain", "white", "correlation",
)  # fmt: skip
"""Fields that `hand_on` copies."""
HEARS = (
    "memory", "known", "consistency", "threshold", "growth", "warm_up", "colour_memory",
    "trial_memory",
)  # fmt: skip
"""Fields of a tuning that `relearn` reads."""
