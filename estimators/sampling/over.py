"""One sample of a compiled filter: entries at θ, then x, sensitivities and output."""

import numpy as np

from flexaxis.estimators.sampling.compiler import Compiled, inlined, remembered
from flexaxis.estimators.sampling.kernel import advance, evaluate
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.reaction import assign, couple, drives, react


@remembered
def over_sample(pattern: Pattern) -> Compiled:
    """
    Return ``over(tuning, state, u)``, `inlined`: take ``state["X"]`` over a sample at its θ.

    Parameters
    ----------
    pattern : Pattern

    Returns
    -------
    callable
        Its records are those of `flexaxis.estimators.recursion.records.on_lanes`.
    """
    return _with_laws(pattern) if pattern.laws else _linear(pattern)


def _linear(pattern: Pattern) -> Compiled:
    entries, series = evaluate(pattern), advance(pattern)

    @inlined
    def over(tuning, state, u):
        entries(tuning["coefficients"], state["theta"], state["M"])
        series(
            state["M"],
            state["X"],
            u,
            tuning["weights"],
            tuning["order"],
            tuning["substeps"],
        )

    return over


def _with_laws(pattern: Pattern) -> Compiled:
    # of the several steps of a sample the first only is preceded by a reset
    entries, series = evaluate(pattern), advance(pattern._replace(reset=()))
    reset = np.array(pattern.reset, np.int64)
    first, n = pattern.states, pattern.n

    @inlined
    def over(tuning, state, u):
        M, X, response, unit = state["M"], state["X"], state["response"], state["unit"]
        weights, order, substeps = tuning["weights"], tuning["order"], tuning["substeps"]
        laws = (
            tuning["law_kind"],
            tuning["law_memory"],
            tuning["law_drive"],
            tuning["law_value"],
            tuning["law_parameter"],
        )
        work = (
            state["force"],
            state["offset"],
            state["change"],
            state["roles"],
            state["local"],
            state["coupling"],
            state["jacobian"],
            state["inverse"],
            state["before"],
            state["mean"],
            state["torque"],
            state["reach"],
        )
        entries(tuning["coefficients"], state["theta"], M)
        assign(laws[3], laws[4], state["theta"], work[3])
        for i in range(len(response)):
            _clear(unit, 0, n + 1)
            unit[first + i, 0] = 1.0
            series(M, unit, 0.0, weights, order, substeps)
            _clear(unit, first, n)
            _copy(unit, response[i])
        couple(laws[2], response, work[5])
        for i in reset:
            _clear(X, i, i + 1)
        for _ in range(tuning["law_steps"]):
            _clear(X, first, n)
            drives(laws[2], X, u, work[8])
            series(M, X, u, weights, order, substeps)
            react(laws, tuning["law_h"], response, u, X, work)

    return over


@inlined
def _clear(X, first, end):
    """Set some rows to zero; a slice would take the compiler seconds."""
    for i in range(first, end):
        for a in range(X.shape[1]):
            X[i, a] = 0.0


@inlined
def _copy(X, Y):
    """Y ← X."""
    for i in range(X.shape[0]):
        for a in range(X.shape[1]):
            Y[i, a] = X[i, a]
