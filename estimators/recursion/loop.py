"""The loop over the samples, once for all filters on lanes; what they do with one is plugged in."""

from collections.abc import Callable

from flexaxis.estimators.sampling.compiler import Compiled
from flexaxis.estimators.sampling.over import over_sample
from flexaxis.estimators.sampling.pattern import Pattern


def sample_loop(pattern: Pattern, correct: Callable, label: str) -> Compiled:
    """
    Return the compiled loop of a filter, or of several side by side, for models of this pattern.

    Parameters
    ----------
    pattern : Pattern
    correct : callable
        ``correct(tunings, states, k, u, y, valid, estimates, trace, *more)``, `inlined`: takes
        ŷ[k], which is the output in X, and y[k], moves θ, P and x, writes row k of ``estimates``
        (η[k]) and of ``trace`` (ŷ[k], y[k] − ŷ[k] and its variance; NaN in a gap), and returns
        whether to stop after this sample. u[k] is not yet in x then; ``more`` are arrays of its
        own.
    label : str
        What the filter is, for the user who waits for the compiler.

    Returns
    -------
    callable
        ``run(tunings, states, u, y, valid, estimates, trace, *more)`` takes samples, from
        ``states`` and back into them, and returns how many. Records have the fields of
        `flexaxis.estimators.recursion.records.on_lanes`.
    """
    over = over_sample(pattern)

    def run(tunings, states, u, y, valid, estimates, trace, *more):  # noqa: PLR0917
        taken = 0
        for k in range(len(u)):
            stop = correct(tunings, states, k, u, y, valid, estimates, trace, *more)
            for j in range(len(states)):
                over(tunings[j], states[j], u[k])
            taken += 1
            if stop:
                break
        return taken

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter ({label}) for {size}")
