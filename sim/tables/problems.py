"""What is wrong with a scenario, in words a user can act on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from flexaxis.sim.errors import unknown
from flexaxis.sim.law_parameters import (
    FIXED,
    LAW_MAY_BE_ZERO,
    LAW_NAMES,
    LAW_PARAMETERS,
    law_owners,
    meant,
)
from flexaxis.sim.parameter_problems import (
    name_problems,
    names_of,
    parameter_problems,
    zero_problems,
)
from flexaxis.sim.parameters import DATA_SHEET, DEFAULT_IDENTIFY, MAY_BE_ZERO, PARAMETER_UNITS
from flexaxis.sim.storage.reading import shown
from flexaxis.sim.tables.config import kinds
from flexaxis.sim.tables.excitation import Excitation
from flexaxis.sim.tables.faults import Fault, changeable
from flexaxis.sim.tables.rate_problems import (
    Problem,
    as_list,
    as_number,
    as_table,
    checked_period,
    rate_problems,
    span_problems,
)
from flexaxis.sim.timing import sample_index

_KINDS = {"fault": kinds(Fault), "nuisance": kinds(Fault), "excitation": kinds(Excitation)}

# Where pydantic speaks Python, TOML's words.
_WORDS = {
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "tuple_type": "must be an array",
    "too_short": "must have at least one entry",
    "string_pattern_mismatch": "must be one word, without blanks, slashes and unseen characters",
}


def explain(error: ValidationError, top: type[BaseModel]) -> Iterator[Problem]:
    """Yield what pydantic found wrong with single keys of a table of type `top`."""
    for item in error.errors():
        if item["loc"]:  # without a place it is from `conflicts`, which the caller asks itself
            yield _key(item["loc"]), _text(item, top)


def conflicts(content: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield values of the right type that do not go together, or not with this plant.

    Values of a wrong type are passed over: `explain` tells them.
    """
    duration, period = as_number(content.get("duration")), checked_period(content)
    yield from rate_problems(content)
    yield from parameter_problems(content)
    identify = as_list(content.get("identify", DEFAULT_IDENTIFY))
    yield from estimated_problems(identify, content)
    yield from _law_problems(identify, content)
    yield from _told_problems(content, identify)
    yield from _loop_problems(content)
    for place, change in _changes(content):
        for key, text in _change_problems(change, duration, period, content):
            yield f"{place}.{key}", text
    excitation = content.get("excitation")
    if isinstance(excitation, Mapping):
        yield from _pause_problems(excitation.get("pause"), duration)
    yield from _spread_problems(content, duration, period)


def _spread_problems(
    content: Mapping[str, Any], duration: float | None, period: float
) -> Iterator[Problem]:
    """Yield how far an onset may be drawn from where it is written, if it leaves the run."""
    spread = as_number(content.get("onset_spread"))
    times = [time for place, change in _changes(content) if place.startswith("fault")
             for time in _onsets(change)]  # fmt: skip
    pauses = [as_number(t) for pair in as_list(as_table(content.get("excitation")).get("pause"))
              for t in as_list(pair)]  # fmt: skip
    known = [time for time in (*times, *pauses) if time is not None]
    if spread is None or duration is None or not known:
        return
    most = min(min(known) - period, duration - period - max(known))
    if spread > most:
        yield (
            "onset_spread",
            f"must be {max(most, 0):g} s at most, so that its changes, from {min(known):g} to "
            f"{max(known):g} s, stay within the run of {duration:g} s; it is {spread:g}",
        )


def _onsets(change: Mapping[str, Any]) -> Iterator[float | None]:
    """Yield the onset of a fault, and of a profile where each line begins."""
    at = as_number(change.get("at"))
    yield at
    for point in as_list(change.get("points"))[:-1]:
        time = as_number(next(iter(as_list(point)), None))
        yield None if at is None or time is None else at + time


def estimated_problems(
    names: Iterable[Any],
    content: Mapping[str, Any],
    *,
    key: str = "identify",
    besides: Sequence[str] = LAW_NAMES,
) -> Iterator[Problem]:
    """Yield why parameters of these names cannot be estimated in a scenario.

    Parameters
    ----------
    names : iterable
        Of a scenario's `identify`, or of an estimator; what is no text is passed over.
    content : mapping
        The scenario, as for `conflicts`.
    key : str
        What to call the names in messages.
    besides : sequence of str
        What they may be besides the parameters of the axis and their inverses.
    """
    texts = [(f"{key}[{i}]", name) for i, name in enumerate(names) if isinstance(name, str)]
    known = names_of(content)
    yield from name_problems([(k, name) for k, name in texts if name not in besides], known)
    yield from zero_problems(texts, content.get("parameters"))
    inverses = {name for _, name in texts if name.startswith("1/")}
    for place, change in _changes(content):
        parameter, factor = change.get("parameter"), as_number(change.get("factor"))
        inverse = f"1/{parameter}"
        if factor == 0 and inverse in inverses and parameter in MAY_BE_ZERO:
            yield (
                f"{place}.factor",
                f"must be above 0 where {inverse} is estimated, which would become infinite; "
                f"estimate {parameter} itself to let it vanish",
            )


def _key(loc: Iterable[int | str]) -> str:
    """Return ``fault[0].at`` for the place ``("fault", 0, "step", "at")``."""
    key = ""
    for part in loc:
        if isinstance(part, int):
            key += f"[{part}]"
        elif part not in _KINDS.get(key.split("[", maxsplit=1)[0], ()):
            key += f".{part}" if key else part
    return key


def _text(item: Any, top: type[BaseModel]) -> str:
    """Return the message for one of pydantic's errors."""
    words = [part for part in item["loc"] if isinstance(part, str)]
    match item["type"]:
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return unknown("key", words[-1], _known_keys(words[:-1], top))
        case "union_tag_not_found":
            return f"kind is missing; known are {', '.join(_KINDS[words[0]])}"
        case "union_tag_invalid":
            return unknown("kind", item["ctx"]["tag"], _KINDS[words[0]])
        case "value_error":
            return str(item["ctx"]["error"])
    message = _WORDS.get(item["type"], item["msg"].replace("Input should", "must"))
    return f"{message}, not {shown(item['input'])}"


def _known_keys(words: list[str], top: type[BaseModel]) -> Iterable[str]:
    """Return the keys of the table at a place such as ``["fault", "step"]``."""
    if not words:
        return top.model_fields
    if words[0] in _KINDS:
        return _KINDS[words[0]][words[1]].model_fields
    annotation = top.model_fields[words[0]].annotation
    table = next(iter(get_args(annotation)), annotation)  # one that may be None is a union
    return table.model_fields if isinstance(table, type) and issubclass(table, BaseModel) else ()


def _law_problems(identify: list[Any], content: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield why parameters of laws cannot be identified on this plant, or changed."""
    owners = law_owners(content)
    changed = [(f"{place}.parameter", c.get("parameter")) for place, c in _changes(content)]
    named = [(f"identify[{i}]", name) for i, name in enumerate(identify)] + changed
    for key, name in named:
        # "coulomb" is that of the table friction alone
        mine = [t for t, names in LAW_PARAMETERS.items() if content.get(t) and name in names]
        if len(mine) > 1:
            yield key, f"{name} is one of {' and one of '.join(mine)}: keep one of these tables"
    for i, name in enumerate(identify):
        if name in LAW_NAMES and name not in owners:
            yield f"identify[{i}]", _no_such_law(name)
        elif name in LAW_NAMES and identify.index(name) < i:
            yield f"identify[{i}]", f"{name!r} after {name!r}: name each once"
        elif name == "f_s" and _never_harder(as_table(content.get(owners[name]))):
            yield f"identify[{i}]", "'f_s' cannot be estimated where it is 0: raise static"


def _never_harder(lugre: Mapping[str, Any]) -> bool:
    return lugre.get("static") == lugre.get("coulomb") is not None


def _no_such_law(parameter: str) -> str:
    tables = " or ".join(key for key, names in LAW_PARAMETERS.items() if parameter in names)
    return f"the plant has no {parameter}: give it the table {tables}"


def _told_problems(content: Mapping[str, Any], identify: list[Any]) -> Iterator[Problem]:
    told, laws, names = as_table(content.get("told")), law_owners(content), names_of(content)
    estimated = {str(name).removeprefix("1/") for name in identify}
    for name, value in told.items():
        key = f"told.{name}"
        if name not in (*names, *LAW_NAMES, *DATA_SHEET):
            yield key, unknown("parameter", name, (*names, *LAW_NAMES, *DATA_SHEET))
        elif name in names and name in estimated:
            yield key, f"{name} is estimated: where that starts is `start`"
        elif name in LAW_NAMES and name not in laws:
            yield key, _no_such_law(name)
        elif name == "poles" and (number := as_number(value)) is not None and number % 1:
            yield key, f"must be a whole number of periods in a turn, not {value!r}"


def _loop_problems(content: Mapping[str, Any]) -> Iterator[Problem]:
    table = as_table(content.get("controller"))
    if table.get("log") is not None and table.get("rate") is None:
        yield "controller.log", "is for an inner loop: it needs controller.rate = 1000"
    if table.get("rate") is not None and content.get("feedback") == "measured":
        yield "controller.rate", 'an inner loop sees the clean angle: it needs feedback = "clean"'


def _change_problems(
    fault: Mapping[str, Any],
    duration: float | None,
    period: float,
    content: Mapping[str, Any],
) -> Iterator[Problem]:
    yield from span_problems(fault, period)
    laws, known = law_owners(content), changeable(names_of(content))
    at, until, factor = (as_number(fault.get(key)) for key in ("at", "until", "factor"))
    index = partial(sample_index, period=period)
    later = fault.get("kind") == "profile"  # whose line begins with the value before
    if at is not None and duration is not None and index(at) + later >= index(duration):
        yield "at", f"the onset at {at:g} s is not before the end of the run at {duration:g} s"
    if at is not None and until is not None and index(until) <= index(at):
        yield "until", f"the end at {until:g} s is not after the onset at {at:g} s"
    parameter = fault.get("parameter")
    if isinstance(parameter, str) and (law := meant(parameter)) in LAW_NAMES:
        if law not in laws:
            yield "parameter", _no_such_law(law)
        elif laws[law] in FIXED:
            yield "parameter", f"{law} of {laws[law]} cannot change in the course of a run"
    elif parameter == "r":
        yield "parameter", "the gear ratio r is a count of teeth and cannot change in a run"
    elif isinstance(parameter, str) and parameter not in known:
        yield "parameter", unknown("parameter", parameter, known)
    if factor == 0 and _must_stay_positive(parameter):
        yield "factor", f"must be above 0, for {parameter} must stay positive"


def _pause_problems(pauses: Any, duration: float | None) -> Iterator[Problem]:
    for index, pause in enumerate(as_list(pauses)):
        begin = as_number(next(iter(as_list(pause)), None))
        if begin is not None and duration is not None and begin >= duration:
            yield (
                f"excitation.pause[{index}]",
                f"the pause from {begin:g} s begins after the end of the run at {duration:g} s",
            )


def _changes(content: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield faults and nuisances, each with its place, such as ``fault[0]``."""
    for table in ("fault", "nuisance"):
        for index, change in enumerate(as_list(content.get(table))):
            if isinstance(change, Mapping):
                yield f"{table}[{index}]", change


def _must_stay_positive(parameter: Any) -> bool:
    known = parameter in (*PARAMETER_UNITS, *LAW_NAMES)
    return known and parameter not in MAY_BE_ZERO | LAW_MAY_BE_ZERO
