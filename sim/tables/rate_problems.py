"""What is wrong with the sampling period of a scenario, or does not go with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from flexaxis.models_mjcf import DEFAULT
from flexaxis.sim.parameters import preset
from flexaxis.sim.tables.config import kinds
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.excitation import Excitation
from flexaxis.sim.tables.faults import A_SAMPLE, Fault
from flexaxis.sim.tables.sensors import DelayConfig
from flexaxis.sim.tables.stability import loop_problem
from flexaxis.sim.timing import PERIOD, TICK, period_problem, rate, sample_index

Made = TypeVar("Made", bound=BaseModel)
Problem = tuple[str, str]
"""Key, such as ``fault[0].at``, and what is wrong with it."""


def checked_period(content: Mapping[str, Any]) -> float:
    """Return the sampling period [s] to check the rest with: the usual one for a wrong one."""
    given = as_number(content.get("period", PERIOD))
    return PERIOD if given is None or period_problem(given) else given


def rate_problems(content: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield what is wrong with the period, and what does not go with it but the faults.

    Parameters
    ----------
    content : mapping
        A scenario; values of a wrong type are passed over.
    """
    given, duration = (as_number(content.get(key)) for key in ("period", "duration"))
    period = checked_period(content)
    if given is not None and (problem := period_problem(given)):
        yield "period", problem
    if duration is not None and 0 < duration < 2 / rate(period):
        yield "duration", f"must be two samples of {period:g} s at least, not {duration:g}"
    yield from _tick_problems(content, period)
    yield from _stability_problems(content, period)
    yield from _excitation_problems(as_table(content.get("excitation")), period)


def span_problems(change: Mapping[str, Any], period: float) -> Iterator[Problem]:
    """Yield the times of a fault or nuisance that are shorter than a sample."""
    table = kinds(Fault).get(str(change.get("kind")))
    for key, about in table.model_fields.items() if table else ():
        value = as_number(change.get(key))
        if A_SAMPLE in about.metadata and value is not None and 0 < value < period:
            yield key, f"must be a sample of {period:g} s at least, not {value:g}"
    times = [as_number(next(iter(as_list(p)), None)) for p in as_list(change.get("points"))]
    for i, (before, after) in enumerate(pairwise([0.0, *times])):
        if before is None or after is None or after <= before:
            continue
        if sample_index(after, period) == sample_index(before, period):
            yield (
                f"points[{i}]",
                f"must be a sample of {period:g} s at least after the one before, and in another; "
                f"it comes {after - before:g} s later",
            )


def _tick_problems(content: Mapping[str, Any], period: float) -> Iterator[Problem]:
    if abs(period / TICK - round(period / TICK)) < 1e-6:
        return
    for table, key in (("controller", "rate"), ("delay", "torque")):
        if as_table(content.get(table)).get(key):
            words = f"goes by whole ms, of which a sample of {1000 * period:g} ms has none"
            yield f"{table}.{key}", words


def _stability_problems(content: Mapping[str, Any], period: float) -> Iterator[Problem]:
    """Yield that the nominal loop is unstable, where all that it is made of can be read.

    Scenarios with the period of 5 ms are older than this check: they have to run into it.
    """
    if period == PERIOD:
        return
    try:
        changes = as_table(content.get("parameters"))
        named = content.get("preset", "n1"), content.get("model", DEFAULT)
        parameters = preset(*named).replace(**changes)
        config = _made(ControllerConfig, content.get("controller"))
        delay = _made(DelayConfig, content.get("delay"))
    except (ValueError, TypeError):
        return
    late = delay.measurement if content.get("feedback") == "measured" else 0
    ticks = delay.torque_ticks
    if problem := loop_problem(parameters, config, period, torque_ticks=ticks, late=late):
        yield "controller.Kv", problem


def _excitation_problems(excitation: Mapping[str, Any], period: float) -> Iterator[Problem]:
    """Yield what an excitation says of itself, where it has `sampling_problems`."""
    kind: Any = kinds(Excitation).get(str(excitation.get("kind")))
    if not hasattr(kind, "sampling_problems"):
        return
    try:
        made = _made(kind, excitation)
    except ValidationError:
        return
    for key, text in made.sampling_problems(period):
        yield f"excitation.{key}", text


def _made(table: type[Made], content: Any) -> Made:
    return table.model_validate(dict(as_table(content)))


def as_table(value: Any) -> Mapping[str, Any]:
    """Return a table as it is, and an empty one for anything else."""
    return value if isinstance(value, Mapping) else {}


def as_number(value: Any) -> float | None:
    """Return a finite number as it is, and None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < float("inf") else None


def as_list(value: Any) -> list[Any]:
    """Return an array as a list, and an empty one for anything else."""
    return list(value) if isinstance(value, list | tuple) else []
