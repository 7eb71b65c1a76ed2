"""Which column of a log is which signal, in which unit."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Log, shown
from flexaxis.experiments.logs.units import ENDINGS, LINEAR, UNITS, completed, spelt
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.files import read_toml
from flexaxis.sim.files import shown as limited

Array = NDArray[np.float64]

KINDS = {
    "time": "time",
    "torque": "torque",
    "angle": "angle",
    "speed": "speed",
    "load_angle": "angle",
}
"""The signals that a mapping may name, and the kind of unit each has."""

LARGEST = 1e12  # of a rate or a factor
GREATEST = 1e100  # of a sample: a sum of squares is still finite
SLOWEST = 0.01  # Hz, so that the time of a log is a number; what is too slow is said later

Signal = Annotated[str, Field(pattern=f"^({'|'.join(KINDS)})$")]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]


def _is_factor(value: float) -> float:
    if value == 0:
        raise ValueError("a number other than 0")
    return value


class LogMap(BaseModel):
    """Which columns to take.

    Attributes
    ----------
    time, torque, angle, speed, load_angle : str or None
        Column of each signal; time may be left out where `rate` is given.
    rate : float or None
        Sampling rate [Hz] of a log without time.
    scale : dict of str to float
        Factor on a signal, after its unit; −1 turns a sign.
    unit : dict of str to str
        Unit of a signal, where the file does not say it or is wrong.
    torque_is : {"held", "smooth"} or None
        Whether the torque is a measured, smooth signal such as a current, rather than a command
        that is held until the next sample; None where nobody said.
    rows : str
        Samples to take, from A to before B, as ``A:B``.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    time: str | None = None
    torque: str | None = None
    angle: str | None = None
    speed: str | None = None
    load_angle: str | None = None
    rate: Annotated[float, Field(ge=SLOWEST, le=LARGEST)] | None = None
    scale: dict[Signal, Annotated[Number, AfterValidator(_is_factor)]] = {}
    unit: dict[Signal, str] = {}
    torque_is: Literal["held", "smooth"] | None = None
    rows: Annotated[str, Field(pattern=r"^\d*:\d*$")] = ":"

    @property
    def columns(self) -> dict[str, str]:
        """Column of each signal that has one."""
        return {name: column for name in KINDS if (column := getattr(self, name)) is not None}


@dataclass(frozen=True)
class Raw:
    """The signals of a log in SI, as they were sampled; NaN where a value is missing.

    Attributes
    ----------
    time, torque : ndarray (N,)
        [s], [N m].
    angle, speed, load_angle : ndarray (N,) or None
        [rad], [rad/s], [rad].
    stated : frozenset of str
        Signals whose unit somebody stated.
    unit : dict of str to str
        Units as the log has them, where they are known.
    """

    time: Array
    torque: Array
    angle: Array | None
    speed: Array | None
    load_angle: Array | None
    stated: frozenset[str]
    unit: Mapping[str, str] = field(default_factory=dict)

    @property
    def linear(self) -> bool:
        """Whether the axis goes straight."""
        return bool(LINEAR & {self.unit.get("angle"), self.unit.get("speed")})


def mapping_from(tables: Mapping[str, Any], *, source: str) -> LogMap:
    """Return a mapping from nested tables, as read from TOML.

    Raises
    ------
    LogError
        With a line for each key that is unknown or has a value of the wrong kind.
    """
    try:
        return LogMap(**tables)
    except ValidationError as error:
        lines = explained(error, tuple(LogMap.model_fields))
        raise LogError("\n".join(f"{source}: {line}" for line in lines)) from error


def explained(error: ValidationError, known: Collection[str]) -> Iterator[str]:
    """Yield what is wrong with keys of a table, among names that are known."""
    for each in error.errors():
        *_, last = place = [str(part) for part in each["loc"] if part != "[key]"]
        text = f"{'.'.join(place)} is {limited(each['input'])}: {each['msg']}"
        if each["type"] == "extra_forbidden" or "[key]" in each["loc"]:
            there = f"There are {', '.join(known)}"
            text = f"{'.'.join(place)}: no such key.{did_you_mean(last, known)} {there}"
        yield text


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the tables of a mapping file, whose keys are looked at here, for they are its own."""
    tables = read_toml(path, LogError)
    mapping_from(tables, source=str(path))
    return tables


def pick(log: Log, mapping: LogMap) -> Raw:
    """Return the signals of a log in SI.

    A signal that the mapping does not name is taken from the column of its own name, if any, see
    `units.completed`.

    Raises
    ------
    LogError
        If a column is missing, lengths differ, or a unit is unknown.
    """
    own = {name: name for name in KINDS if name in log.names}
    given = completed(own | mapping.columns, log.names)
    if mapping.rate is not None and "time" not in mapping.columns:
        given.pop("time", None)
    _check_columns(log, given, mapping)
    units = {name: _unit(log, name, column, mapping) for name, column in given.items()}
    columns = log.load([*given.values()])
    signals = {
        name: columns[column]
        * (_factor(log, name, column, units[name]) * mapping.scale.get(name, 1))
        for name, column in given.items()
    }
    for name, values in signals.items():
        _check_size(f"{log.source}: column {given[name]!r}", values)
    if "time" not in signals:
        assert mapping.rate is not None  # checked above
        signals["time"] = np.arange(len(signals["torque"])) / mapping.rate
    lengths = {name: len(values) for name, values in signals.items()}
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{name} ({given[name]}) {length}" for name, length in lengths.items())
        raise LogError(
            f"{log.source}: the columns differ in length: {text}. Columns of one log have a value "
            "each for every sample: are they of different rates?"
        )
    first, last = (int(part) if part else None for part in mapping.rows.split(":"))
    signals = {name: values[first:last] for name, values in signals.items()}
    return Raw(
        time=signals["time"],
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        load_angle=signals.get("load_angle"),
        stated=frozenset({n for n, u in units.items() if u} | ({"time"} - given.keys())),
        unit={name: spelt(text) for name, text in units.items() if text},
    )


def _check_size(what: str, values: Array) -> None:
    """Refuse what no sum of squares can be made of; infinity is a sample that is missing."""
    sizes = abs(values[np.isfinite(values)])
    if 0 < (most := sizes.max(initial=0.0)) < 1 / GREATEST:
        raise LogError(
            f"{what} is never more than {most:.3g}, less than anything measured can be: is its "
            "scale or unit right, or is the file damaged?"
        )
    wrong = np.isfinite(values) & (abs(values) > GREATEST)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise LogError(
            f"{what} is {values[k]:.3g} at sample {k}, which nothing measured can be: is the file "
            "damaged, or of another format? Leave such samples empty"
        )


def _check_columns(log: Log, given: Mapping[str, str], mapping: LogMap) -> None:
    there = f"there are {shown(log.names)}"
    if log.names[0] == "column1":
        there = f"the file names no columns, so t{there[1:]}"
    problems = [
        f"{log.source}: there is no column {column!r} for {name}."
        f"{did_you_mean(column, log.names)} T{there[1:]}"
        for name, column in given.items()
        if column not in log.names
    ]
    asked = {
        "time? Give --time COLUMN, or --rate HZ": "time" in given or mapping.rate is not None,
        "torque, or current? Give --torque COLUMN": "torque" in given,
        "motor angle, or speed? Give --angle COLUMN or --speed COLUMN":
            not {"angle", "speed"}.isdisjoint(given),
    }  # fmt: skip
    problems += [
        f"{log.source}: which column is the {question}; {there}"
        for question, answered in asked.items()
        if not answered
    ]
    twice = [c for c in set(given.values()) if list(given.values()).count(c) > 1]
    if twice:
        names = ", ".join(name for name, column in given.items() if column == twice[0])
        problems.append(f"{log.source}: column {twice[0]!r} is named for {names}; each has its own")
    if problems:
        raise LogError("\n".join(problems))


def _unit(log: Log, name: str, column: str, mapping: LogMap) -> str:
    """Return the unit of a signal: as the mapping says, the file, or the end of the name."""
    stated = mapping.unit.get(name) or log.units.get(column, "")
    known, parts = ENDINGS[KINDS[name]], column.split("_")
    # torque_mA is a current, torque_ma may be a moving average
    endings = [end for n in (2, 1) if len(parts) > n for end in ["_".join(parts[-n:])]]
    found = (text for end in endings for text in (end, end.lower()) if text in known)
    return stated or next(found, "")


def _factor(log: Log, name: str, column: str, text: str) -> float:
    """Return the factor of a unit to SI."""
    factors = UNITS[KINDS[name]]
    if not text:
        return 1.0
    unit = spelt(text)
    if unit == "Nm" and KINDS[name] == "angle":
        unit = "nm"
    if unit not in factors:
        raise LogError(
            f"{log.source}: the unit {text!r} of {column} is not one of {', '.join(factors)} "
            f"for {name}; give the unit with --unit {name}=…, or for counts of an encoder the "
            f"size of one with --scale {name}=2*pi/COUNTS"
        )
    return factors[unit]
