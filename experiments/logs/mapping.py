"""Which column of a log is which signal, in which unit."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.read import Log
from flexaxis.experiments.logs.units import COUNTS, ENDINGS, UNITS, completed, is_linear, spelt
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.files import read_toml
from flexaxis.sim.files import shown as limited

Array = NDArray[np.float64]

KINDS = ("time", "torque", "angle", "speed")
"""The signals that a mapping may name."""

Signal = Annotated[str, Field(pattern=f"^({'|'.join(KINDS)})$")]


def _is_factor(value: float) -> float:
    if value == 0:
        raise ValueError("give a number other than 0")
    return value


class LogMap(BaseModel):
    """Which columns to take.

    Attributes
    ----------
    time, torque, angle, speed : str or None
        Column of each signal; time may be left out where `rate` is given.
    rate : float or None
        Sampling rate [Hz] of a log without time.
    scale : dict of str to float
        Factor on a signal, after its unit; −1 turns a sign.
    unit : dict of str to str
        Unit of a signal, where the file does not say it or is wrong.
    counts : float or None
        Counts of the encoder in a turn, of an angle in the unit ``counts``.
    torque_is : {"held", "smooth"} or None
        Whether the torque is a measured, smooth signal such as a current, rather than a command
        that is held until the next sample; None where nobody stated it.
    rows : str
        Samples to take, from A to before B, as ``A:B``.
    header : int or None
        Line of the names in a CSV, from 1.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    time: str | None = None
    torque: str | None = None
    angle: str | None = None
    speed: str | None = None
    rate: Annotated[float, Field(ge=0.01, le=1e12)] | None = None
    scale: dict[Signal, Annotated[float, AfterValidator(_is_factor)]] = {}
    unit: dict[Signal, str] = {}
    counts: Annotated[float, Field(gt=0, strict=False)] | None = None
    torque_is: Literal["held", "smooth"] | None = None
    rows: Annotated[str, Field(pattern=r"^\d*:\d*$")] = ":"
    header: Annotated[int, Field(ge=1)] | None = None

    @property
    def columns(self) -> dict[str, str]:
        """Column of each signal that has one."""
        return {name: column for name in KINDS if (column := getattr(self, name)) is not None}


@dataclass(frozen=True)
class Raw:
    """The signals of a log in SI, as they were sampled; NaN where a value is missing.

    Attributes
    ----------
    time : ndarray (N,)
        [s].
    signals : dict of str to ndarray (N,)
        Torque [N m], angle [rad], speed [rad/s], of those that the log has.
    stated : frozenset of str
        Signals whose unit is stated.
    unit : dict of str to str
        Units as the log has them, where they are known.
    scaled : bool
        Whether a factor makes another quantity of the torque.
    """

    time: Array
    signals: Mapping[str, Array]
    stated: frozenset[str]
    unit: Mapping[str, str] = field(default_factory=dict)
    scaled: bool = False

    @property
    def motion(self) -> str:
        """The signal that the estimators read: the angle where there is one."""
        return "angle" if "angle" in self.signals else "speed"

    @property
    def linear(self) -> bool:
        """Whether the axis goes straight."""
        return any(is_linear(self.unit.get(name)) for name in ("angle", "speed"))


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
    for row in error.errors():
        *_, last = place = [str(part) for part in row["loc"] if part != "[key]"]
        text = f"{'.'.join(place)} is {limited(row['input'])}: {row['msg']}"
        if row["type"] == "extra_forbidden" or "[key]" in row["loc"]:
            hint = f"{did_you_mean(last, known)} There are {', '.join(known)}"
            text = f"{'.'.join(place)}: no such key.{hint}"
        yield text


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the tables of a mapping file, after a check of its keys."""
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
    if mapping.rate is not None and mapping.time is None:
        given.pop("time", None)
    _check_columns(log, given, mapping)
    units = {name: _unit(log, name, column, mapping) for name, column in given.items()}
    rows = slice(*(int(part) if part else None for part in mapping.rows.split(":")))
    columns = log.load([*given.values()], rows)
    signals = {n: columns[c] * _factor(n, c, units[n], mapping) for n, c in given.items()}
    lengths = {len(values) for values in signals.values()}
    if len(lengths) > 1:
        raise LogError(
            f"the columns {', '.join(columns)} differ in length, {lengths}: columns of one log "
            "have a value for every sample; are they of different rates?"
        )
    time = signals.pop("time", np.arange(lengths.pop()) / (mapping.rate or 1.0))
    stated = frozenset({n for n, u in units.items() if u} | ({"time"} - given.keys()))
    named = {name: spelt(text, name) for name, text in units.items() if text}
    return Raw(time, signals, stated, named, abs(mapping.scale.get("torque", 1.0)) != 1)


def _check_columns(log: Log, given: Mapping[str, str], mapping: LogMap) -> None:
    for name, column in given.items():
        if column not in log.names:
            raise LogError(log.lacks(column, f" for {name}"))
        if list(given.values()).count(column) > 1:
            raise LogError(f"column {column!r} is named for two signals; each has its own")
    timed = mapping.rate is not None or "time" in given
    for question, known in (
        ("time? Give --time COLUMN, or --rate HZ", timed),
        ("torque, or current? Give --torque COLUMN", "torque" in given),
        ("motor angle, or speed? Give --angle COLUMN or --speed COLUMN",
         {"angle", "speed"} & given.keys()),
    ):  # fmt: skip
        if not known:
            raise LogError(
                f"which column is the {question}; there are {log.listed}. If these are no names, "
                "give the line of the names by --header LINE"
            )


def _unit(log: Log, name: str, column: str, mapping: LogMap) -> str:
    """Return the unit of a signal: as the mapping says, the file, or the end of the name."""
    if stated := mapping.unit.get(name) or log.units.get(column):
        return stated
    if name == "angle" and mapping.counts:
        return COUNTS
    # torque_mA is a current, torque_ma may be a moving average
    endings = re.findall(r"(?=_(.+))", column)[-2:]
    both = (unit for end in endings for unit in (end, end.lower()))
    return next((unit for unit in both if unit in ENDINGS[name]), "")


def _factor(name: str, column: str, text: str, mapping: LogMap) -> float:
    """Return the factor of a signal to SI."""
    known = UNITS[name] | {"": 1.0}
    if mapping.counts is not None and name == "angle":
        known[COUNTS] = 2 * np.pi / mapping.counts
    unit = spelt(text, name)
    if unit not in known:
        raise LogError(
            f"the unit {text!r} of {column} is not one of {', '.join(filter(None, known))} for "
            f"{name}; state it with --unit {name}=…, with --counts N if it is counts of an "
            f"encoder, or give a factor with --scale {name}=FACTOR beside a known unit"
        )
    return known[unit] * mapping.scale.get(name, 1.0)
