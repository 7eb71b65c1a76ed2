"""The loop of a compiled filter over its samples: what it keeps, one sample, and all of them."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import MAX_ORDER, Pattern, law_plan, plan, split
from flexaxis.estimators.models.kernel import advance, evaluate
from flexaxis.estimators.models.reaction import assign, couple, drives, react, room
from flexaxis.estimators.models.sampled import copy

Record = NDArray[np.void]


def on_lanes(design: Design, pattern: Pattern) -> tuple[Record, Record]:
    """
    Return tuning and state of a filter of one model: what `filters.loop` needs, and no more.

    Parameters
    ----------
    design : Design
    pattern : Pattern
        That of the model, or one with more lanes, such as `filters.joint.with_state` gives.

    Returns
    -------
    tuning, state : (1,) records
        ``coefficients, weights, order, substeps``; ``theta`` (p,), ``M`` (entries, lanes), the
        entries of [A B; C 0] with derivatives, those of A and B times T/s, and ``X`` (n+1, lanes),
        x and output with derivatives. Of a model with laws besides what
        `flexaxis.estimators.filters.loop` needs for them.
    """
    own, coefficients = split(design.model)
    box = design.lower, design.upper
    steps, order, substeps = (
        law_plan(design.model, *box, design.period)
        if pattern.laws
        else (1, *plan(design.model, *box, design.period))
    )
    row, column, _ = np.array(pattern.entries).T
    part = design.period / steps / substeps
    scale = np.where(row < pattern.n, part, 1.0)  # the output is read, not run
    tuning = record(
        coefficients=coefficients * scale[[entry for entry, *_ in pattern.terms]],
        weights=1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1)),  # 1/1!, 1/2!, …
        order=order,
        substeps=substeps,
    )
    blocks = design.model.blocks(design.theta0)
    M = np.zeros((len(pattern.entries), pattern.lanes))
    M[:, : len(blocks)] = (blocks[:, row, column] * scale).T
    X = np.zeros((pattern.n + 1, pattern.lanes))
    X[:-1, 0] = design.x0
    X[-1, 0] = blocks[0, -1, :-1] @ design.x0
    theta = np.ones(pattern.p)  # what pads θ must have an inverse
    theta[: own.p] = design.theta0
    start = record(theta=theta, M=M, X=X)
    if design.model.laws is None:
        return tuning, start
    laws = record(
        **{f"law_{name}": value for name, value in design.model.laws._asdict().items()},
        law_steps=steps,
        law_h=design.period / steps,
    )
    place = record(
        response=np.zeros((pattern.laws, *X.shape)),
        unit=np.zeros(X.shape),
        **room(pattern.laws, pattern.lanes),
    )
    return joined(tuning, laws), joined(start, place)


def record(**values: ArrayLike) -> Record:
    """Return a record with these fields, of float or int as the values are."""
    arrays = {name: np.asarray(value) for name, value in values.items()}
    kinds = {name: int if a.dtype.kind in "iub" else float for name, a in arrays.items()}
    made = np.zeros(1, _aligned(tuple((n, kinds[n], a.shape) for n, a in arrays.items())))
    for name, array in arrays.items():
        made[name] = array
    return made


@lru_cache
def _aligned(fields: tuple[tuple, ...]) -> np.dtype:
    """Return the type of a record: the same object for the same fields.

    When a compiled function is called, numba looks a type up that it has met before, and where it
    is an equal one rather than the same, compares them field by field: 1.7 µs in a step of 5.
    """
    return np.dtype(list(fields), align=True)


def joined(*records: Record) -> Record:
    """
    Return one record with the fields of all, those of the last coming first.

    Behind the others new fields would make numba take the record for one of the smaller type, which
    it calls experimental, as soon as both are compiled in one process.
    """
    parts: Mapping[str, tuple[Record, np.dtype]] = {
        name: (r, r.dtype.fields[name][0])
        for r in reversed(records)
        for name in r.dtype.names or ()
        if r.dtype.fields is not None
    }
    made = np.zeros(1, _aligned(tuple((name, kind) for name, (_, kind) in parts.items())))
    for name, (source, _) in parts.items():
        made[name] = source[name]
    return made


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
        Its records are those of `flexaxis.estimators.filters.loop.on_lanes`.
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
            tuning["law_load"],
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
            copy(unit, response[i])
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


def sample_loop(pattern: Pattern, correct: Callable, label: str) -> Compiled:
    """
    Return the compiled loop of a filter, or of several side by side, for models of this pattern.

    Parameters
    ----------
    pattern : Pattern
    correct : callable
        ``correct(tunings, states, k, u, y, valid, estimates, trace)``, `inlined`: takes
        ŷ[k], which is the output in X, and y[k], moves θ, P and x, writes row k of ``estimates``
        (η[k]) and of ``trace`` (ŷ[k], y[k] − ŷ[k] and its variance; NaN in a gap), and returns
        whether to stop after this sample. u[k] is not yet in x then.
    label : str
        What the filter is, for the user who waits for the compiler.

    Returns
    -------
    callable
        ``run(tunings, states, u, y, valid, estimates, trace)`` takes samples, from
        ``states`` and back into them, and returns how many. Records have the fields of
        `flexaxis.estimators.filters.loop.on_lanes`.
    """
    over = over_sample(pattern)

    def run(tunings, states, u, y, valid, estimates, trace):  # noqa: PLR0917
        taken = 0
        for k in range(len(u)):
            stop = correct(tunings, states, k, u, y, valid, estimates, trace)
            for j in range(len(states)):
                over(tunings[j], states[j], u[k])
            taken += 1
            if stop:
                break
        return taken

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter ({label}) for {size}")
