"""Check a scenario: report errors in individual keys first, then conflicts between keys."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel, ValidationError

from flexaxis.sim.errors import ParameterError, unknown
from flexaxis.sim.parameters import (
    DATA_SHEET,
    FIXED,
    LAW_MAY_BE_ZERO,
    LAW_NAMES,
    LAW_PARAMETERS,
    MAY_BE_ZERO,
    meant,
    parameter_names,
    parameter_problem,
    presets,
)
from flexaxis.sim.stability import loop_problem
from flexaxis.sim.tables.config import kinds
from flexaxis.sim.tables.excitation import Excitation
from flexaxis.sim.tables.faults import A_SAMPLE, Fault, Profile, changeable
from flexaxis.sim.text_files import shown
from flexaxis.sim.timing import PERIOD, TICK, sample_index

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario

Problem = tuple[str, str]
"""Type of a scenario problem: a dotted key, such as ``fault[0].at``, and an error message."""

OF_THE_GEAR = ("backlash", "stiffening", "gear_friction", "load_friction")
"""Names of the scenario tables that require a model with a gear spring."""

_KINDS = {"fault": kinds(Fault), "nuisance": kinds(Fault), "excitation": kinds(Excitation)}

# These messages use TOML terms. They replace messages of pydantic, which use Python terms.
_WORDS = {
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "tuple_type": "must be an array",
    "list_type": "must be an array",
    "too_short": "the array must have at least one entry",
    "string_pattern_mismatch": "a name must not contain blanks, slashes or control characters",
}


def problems(error: ValidationError, top: type[Scenario]) -> list[str]:
    """Return one line of text for each problem in a scenario.

    The function reports conflicts between keys only if the value of every key is valid.
    """
    lines = [f"{key}: {text}" for key, text in explain(error, top)]
    for item in error.errors():
        if not item["loc"]:  # this error is about conflicts between keys
            lines += str(item["ctx"]["error"]).splitlines()
    return lines


def explain(error: ValidationError, top: type[BaseModel]) -> Iterator[Problem]:
    """Yield the key and the message of each pydantic error that concerns an individual key.

    The argument `top` is the class of the top-level table, which contains all other tables.
    """
    for item in error.errors():
        if item["loc"]:
            yield _key(item["loc"]), _text(item, top)


def _key(loc: Iterable[int | str]) -> str:
    """Convert the location in a pydantic error to a dotted key.

    For example, ("fault", 0, "step", "at") becomes ``fault[0].at``. The dotted key omits the `kind`
    of a fault table, such as "step".
    """
    key = ""
    for part in loc:
        if isinstance(part, int):
            key += f"[{part}]"
        elif part not in _KINDS.get(key.split("[", maxsplit=1)[0], ()):
            key += f".{part}" if key else part
    return key


def _text(item: Any, top: type[BaseModel]) -> str:
    """Return the message for one pydantic error."""
    words = [part for part in item["loc"] if isinstance(part, str)]
    match item["type"]:
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return unknown("key", words[-1], _known_keys(words[:-1], top))
        case "union_tag_not_found":
            return f"the key `kind` is missing; known kinds are {', '.join(_KINDS[words[0]])}"
        case "union_tag_invalid":
            return unknown("kind", item["ctx"]["tag"], _KINDS[words[0]])
        case "value_error":
            return str(item["ctx"]["error"])
    message = _WORDS.get(item["type"], item["msg"].replace("Input should", "must"))
    return f"{message}, not {shown(item['input'])}"


def _known_keys(words: list[str], top: type[BaseModel]) -> Iterable[str]:
    """Return the valid keys of a table, given its location, such as ``["fault", "step"]``."""
    if not words:
        return top.model_fields
    if words[0] in _KINDS:
        return _KINDS[words[0]][words[1]].model_fields
    annotation = top.model_fields[words[0]].annotation
    table = next(iter(get_args(annotation)), annotation)  # an optional table is a union
    return table.model_fields if isinstance(table, type) and issubclass(table, BaseModel) else ()


def conflicts(scenario: Scenario) -> Iterator[Problem]:
    """Report each scenario value that conflicts with another value or is invalid for the plant.

    The types of all values must be checked before this function is called.
    """
    yield from _rate_problems(scenario)
    yield from _axis_problems(scenario)
    yield from estimated_problems(scenario.identify, scenario)
    for i, name in enumerate(scenario.identify):
        if text := _law_problem(name, scenario):
            yield f"identify[{i}]", text
    yield from _known_problems(scenario)
    if scenario.controller.rate and scenario.feedback == "measured":
        text = 'an inner control loop cannot read the measured angle: set feedback = "clean"'
        yield "controller.rate", text
    for table in ("fault", "nuisance"):
        for i, change in enumerate(getattr(scenario, table) or ()):
            for key, text in _change_problems(change, scenario):
                yield f"{table}[{i}].{key}", text
    yield from _pause_problems(scenario)


def _rate_problems(scenario: Scenario) -> Iterator[Problem]:
    """Report each key whose value is incompatible with the sampling period."""
    period, controller, delay = scenario.period, scenario.controller, scenario.delay
    if abs(period / TICK - round(period / TICK)) >= 1e-6:
        words = f"needs a sampling period that is a multiple of 1 ms, not {1000 * period:g} ms"
        for key, value in (("controller.rate", controller.rate), ("delay.torque", delay.torque)):
            if value:
                yield key, words
    for key, text in getattr(scenario.excitation, "sampling_problems", lambda period: ())(period):
        yield f"excitation.{key}", text
    if period == PERIOD:  # scenarios from before this check have this period and may be unstable
        return
    late = delay.measurement if scenario.feedback == "measured" else 0
    try:
        axis = scenario.nominal
    except ParameterError:  # `_axis_problems` reports this error
        return
    ticks = delay.torque_ticks
    if problem := loop_problem(axis, controller, period, torque_ticks=ticks, late=late):
        yield "controller.Kv", problem


def _axis_problems(scenario: Scenario) -> Iterator[Problem]:
    """Report each preset, parameter or table that is not valid for the plant model."""
    names, known = parameter_names(scenario.model), presets(scenario.model)
    if scenario.preset not in known:
        yield "preset", unknown("preset", scenario.preset, known)
    for table in OF_THE_GEAR if "k_g" not in names else ():
        if table in scenario.tables:
            yield table, f"the table needs a gear spring, but the model {scenario.model} has none"
    for name, value in scenario.parameters.items():
        if name not in names:
            yield f"parameters.{name}", unknown("parameter", name, names)
        elif problem := parameter_problem(name, value):
            yield f"parameters.{name}", problem


def estimated_problems(
    names: Iterable[str],
    scenario: Scenario,
    *,
    key: str = "identify",
    besides: Sequence[str] = LAW_NAMES,
) -> Iterator[Problem]:
    """Report each parameter in `names` that cannot be estimated in a scenario.

    Parameters
    ----------
    names : iterable of str
        Names of the parameters to estimate, such as `Scenario.identify`.
    scenario : Scenario
        Scenario whose parameters are estimated.
    key : str
        Scenario key whose value is `names`; each returned problem refers to this key.
    besides : sequence of str
        Names of parameters that are allowed in addition to the axis parameters and their inverses.
    """
    known, seen = parameter_names(scenario.model), dict[str, str]()
    for i, name in enumerate(names):
        place, parameter = f"{key}[{i}]", name.removeprefix("1/")
        if name in seen.values() or (parameter in seen and name not in besides):
            yield place, f"{name!r} repeats {seen[parameter]!r}: name each parameter once"
        elif name not in besides and parameter not in known:
            words = [*known, *(f"1/{each}" for each in known), *LAW_NAMES]
            yield place, unknown("parameter", name, words)
        elif parameter in MAY_BE_ZERO and scenario.parameters.get(parameter) == 0:
            yield (
                place,
                f"{name!r} cannot be estimated while parameters.{parameter} is 0, because the "
                "estimation error is given in % of this value: use a value above 0, or do not "
                f"estimate {name!r}",
            )
        seen.setdefault(parameter, name)


def _law_problem(name: str, scenario: Scenario) -> str | None:
    """Return an error message unless exactly one table defines the nonlinear parameter `name`."""
    having = [key for key, names in LAW_PARAMETERS.items() if name in names]
    tables = [key for key in having if key in scenario.tables]
    if having and not tables:
        return f"the plant has no parameter {name}: add the table {' or '.join(having)}"
    if len(tables) > 1:
        return f"{name} is ambiguous: keep only one of the tables {' and '.join(tables)}"
    return None


def _known_problems(scenario: Scenario) -> Iterator[Problem]:
    names = parameter_names(scenario.model)
    known = (*names, *LAW_NAMES, *DATA_SHEET, "spread")
    estimated = {name.removeprefix("1/") for name in scenario.identify}
    for name in scenario.known or ():
        key = f"known.{name}"
        if name not in known:
            yield key, unknown("parameter", name, known)
        elif name in names and name in estimated:
            yield key, f"{name} is estimated: remove this key, and set the initial value by `start`"
        elif name not in scenario.laws and (text := _law_problem(name, scenario)):
            yield key, text


def _change_problems(change: Fault, scenario: Scenario) -> Iterator[Problem]:
    yield from _span_problems(change, scenario.period)
    yield from _changed_problems(change, scenario)
    index, until = scenario.grid.index, getattr(change, "until", None)
    # the onset of a profile is the last sample with the old value
    if index(change.at) + isinstance(change, Profile) >= scenario.samples:
        end = scenario.duration
        yield "at", f"the onset at {change.at:g} s must be before the end of the run at {end:g} s"
    if until is not None and index(until) <= index(change.at):
        yield "until", f"the end at {until:g} s must be after the onset at {change.at:g} s"


def _span_problems(change: Fault, period: float) -> Iterator[Problem]:
    """Report each time or duration of a fault or nuisance that is less than one sample."""
    for key, about in type(change).model_fields.items():
        if A_SAMPLE in about.metadata and getattr(change, key) < period:
            text = (
                f"a time must be at least one sample ({period:g} s), not {getattr(change, key):g}"
            )
            yield key, text
    times = (0.0, *(time for time, _ in getattr(change, "points", ())))
    for i, (before, after) in enumerate(pairwise(sample_index(t, period) for t in times)):
        if after == before:
            text = f"a corner must be at least one sample ({period:g} s) after the previous corner"
            yield f"points[{i}]", text


def _changed_problems(change: Fault, scenario: Scenario) -> Iterator[Problem]:
    """Report a fault whose parameter cannot change during a run or cannot take the new value."""
    known, parameter = changeable(parameter_names(scenario.model)), change.parameter
    law = meant(parameter)
    text = _law_problem(law, scenario) if parameter == law or law not in scenario.laws else None
    if text:
        yield "parameter", text
    elif law in FIXED:
        yield "parameter", f"{law} in the table {FIXED[law]} cannot change during a run"
    elif law not in known:
        yield "parameter", unknown("parameter", parameter, known)
    if change.factor > 0:
        return
    if law in known and law not in MAY_BE_ZERO | LAW_MAY_BE_ZERO:
        yield "factor", f"a factor of 0 is not allowed, because {parameter} must remain positive"
    elif (inverse := f"1/{parameter}") in scenario.identify:
        yield (
            "factor",
            f"a factor of 0 is not allowed, because {inverse} is estimated and would become "
            f"infinite; use a larger factor, or estimate {parameter} instead of {inverse}",
        )


def _pause_problems(scenario: Scenario) -> Iterator[Problem]:
    """Report an `onset_spread` that is too large, and each pause that begins after the run ends."""
    duration, spread = scenario.duration, scenario.onset_spread
    pauses = getattr(scenario.excitation, "pause", ())
    for i, (begin, _) in enumerate(pauses):
        if begin >= duration:
            yield (
                f"excitation.pause[{i}]",
                f"the pause begins at {begin:g} s, after the end of the run at {duration:g} s",
            )
    times = [time for pause in pauses for time in pause]
    for fault in scenario.fault:
        # each segment of a profile begins at the end of the previous segment
        lines = getattr(fault, "points", ())[:-1]
        times += [fault.at, *(fault.at + time for time, _ in lines)]
    if spread is None or not times:
        return
    most = min(min(times) - scenario.period, duration - scenario.period - max(times))
    if spread > most:
        yield (
            "onset_spread",
            f"onset_spread must be at most {max(most, 0):g} s, not {spread:g}: all changes (from "
            f"{min(times):g} to {max(times):g} s) must remain within the run of {duration:g} s "
            "when they are shifted",
        )
