"""Prediction-error methods by their rule for the time update of P: the paper's, or another."""

from collections.abc import Callable, Mapping

from numpy.typing import ArrayLike

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.loop import Record, joined, on_lanes, record, sample_loop
from flexaxis.estimators.filters.prediction_error import (
    bound_P,
    correct_state,
    measure,
    measurement_records,
    publish,
    read_claim,
)
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern, split


def forgetful_filter(
    design: Design,
    rule: Callable,
    *,
    robust: float,
    ceiling: float,
    correct: bool = False,
    tuning: Mapping[str, ArrayLike],
    state: Mapping[str, ArrayLike] | None = None,
) -> CompiledFilter:
    """
    Make a prediction-error method with a rule of its own in the place of eq. (9) or (10).

    Parameters
    ----------
    design, rule, robust, ceiling, correct, tuning, state
        As for `adaptation`.
    """
    parts = adaptation(
        design, rule, robust=robust, ceiling=ceiling, correct=correct, tuning=tuning, state=state
    )
    return CompiledFilter(*parts, design, read_claim, restarts=True)


def adaptation(
    design: Design,
    rule: Callable,
    *,
    robust: float,
    ceiling: float,
    correct: bool,
    tuning: Mapping[str, ArrayLike],
    state: Mapping[str, ArrayLike] | None,
) -> tuple[Compiled, Record, Record]:
    """
    Return loop, tuning and start of a prediction-error method.

    Parameters
    ----------
    design : Design
    rule : callable
        ``rule(tuning, state, valid)``, marked as `inlined`: moves ``state["P"]`` on after a
        measurement, or in a gap. `flexaxis.estimators.filters.prediction_error` says what state and
        tuning hold.
    robust, ceiling : float
        As for `flexaxis.estimators.Rpem`.
    correct : bool
        Whether the state moves with θ.
    tuning, state : mapping of str to array_like
        What the rule needs besides, and remembers, as it is at the start.
    """
    pattern, _ = split(design.model)
    lanes = on_lanes(design, pattern)
    parts = measurement_records(design, clip=robust, correct=correct, ceiling=ceiling)
    tunings = joined(lanes[0], parts[0], record(**tuning))
    states = joined(lanes[1], parts[1], record(**(state or {})))
    return _loop(pattern, rule), tunings, states


@remembered
def _loop(pattern: Pattern, rule: Compiled) -> Compiled:
    @inlined
    def forget(tunings, states, k, u, y, valid, estimates, trace):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        measure(tuning, state, y[k], valid[k])
        if tuning["correct"] > 0.0:
            correct_state(state)
        rule(tuning, state, valid[k])
        bound_P(tuning, state)
        publish(state, k, estimates, trace)
        return state["anew"] > tuning["heeds"]

    return sample_loop(pattern, forget, "prediction error")
