"""What a compiled filter keeps: records of numbers that stay (tuning) and that change (state)."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.sampling.pattern import Pattern, split
from flexaxis.estimators.sampling.plan import MAX_ORDER, law_plan, plan
from flexaxis.estimators.sampling.reaction import room

Record = NDArray[np.void]


def on_lanes(
    design: Design, pattern: Pattern, *, series: tuple[int, int, int] | None = None
) -> tuple[Record, Record]:
    """
    Return tuning and state of a filter of one model: what `recursion.loop` needs, and no more.

    Parameters
    ----------
    design : Design
    pattern : Pattern
        That of the model, or one with more lanes, such as `methods.ekf.with_state` gives.
    series : (steps, order, substeps), optional
        As from `flexaxis.estimators.sampling.plan.law_plan`; by default that of this model.

    Returns
    -------
    tuning, state : (1,) records
        ``coefficients, weights, order, substeps``; ``theta`` (p,), ``M`` (entries, lanes), the
        entries of [A B; C 0] with derivatives, those of A and B times T/s, and ``X`` (n+1, lanes),
        x and output with derivatives. Of a model with laws besides what
        `flexaxis.estimators.sampling.over` needs for them.
    """
    own, coefficients = split(design.model)
    box = design.lower, design.upper
    steps, order, substeps = series or (
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
