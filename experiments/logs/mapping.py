"""Which column of a log is which signal, in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.read import Log
from flexaxis.experiments.logs.units import COUNTS, ENDINGS, SI, UNITS, WORDS, spelt
from flexaxis.sim.conflicts import explain
from flexaxis.sim.files import read_toml

Array = NDArray[np.float64]

Signal = Literal["time", "torque", "angle", "speed"]


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
    scale: dict[Signal, Annotated[float, Field(strict=False)]] = {}
    unit: dict[Signal, str] = {}
    counts: Annotated[float, Field(gt=0, strict=False)] | None = None
    torque_is: Literal["held", "smooth"] | None = None
    rows: Annotated[str, Field(pattern=r"^\d*:\d*$")] = ":"
    header: Annotated[int, Field(ge=1)] | None = None


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
        units = (self.unit.get(name, "") for name in ("angle", "speed"))
        return any(re.match(r"([numck]?m|in)(/|$)", unit) for unit in units)


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
        lines = (f"{source}: {key}: {text}" for key, text in explain(error, LogMap))
        raise LogError("\n".join(lines)) from error


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the tables of a mapping file, after a check of its keys."""
    tables = read_toml(path, LogError)
    mapping_from(tables, source=str(path))
    return tables


def pick(log: Log, mapping: LogMap) -> Raw:
    """Return the signals of a log in SI.

    Raises
    ------
    LogError
        If a column is missing, lengths differ, or a unit is unknown.
    """
    chosen = _columns(log, mapping)
    units = {name: _unit(log, name, column, mapping) for name, column in chosen.items()}
    begin, end = (int(part) if part else None for part in mapping.rows.split(":"))
    columns = log.read([*chosen.values()], slice(begin, end))
    signals = {n: columns[c] * _factor(n, c, units[n], mapping) for n, c in chosen.items()}
    lengths = {len(values) for values in signals.values()}
    if len(lengths) > 1:
        raise LogError(
            f"the columns {', '.join(columns)} differ in length, {lengths}: columns of one log "
            "have a value for every sample; are they of different rates?"
        )
    time = signals.pop("time", np.arange(lengths.pop()) / (mapping.rate or 1.0))
    stated = frozenset({n for n, u in units.items() if u} | ({"time"} - chosen.keys()))
    named = {name: spelt(text, name) for name, text in units.items() if text}
    return Raw(time, signals, stated, named, abs(mapping.scale.get("torque", 1.0)) != 1)


def _columns(log: Log, mapping: LogMap) -> dict[str, str]:
    """Return the column of each signal: as the mapping says, or by a name that means one."""
    chosen = {name: column for name in SI if (column := getattr(mapping, name)) is not None}
    chosen |= {name: name for name in SI if name in log.names and name not in chosen}
    lower = {name.lower(): name for name in reversed(log.names)}
    for kind, words in WORDS.items():
        moves = kind in ("angle", "speed") and {"angle", "speed"} & chosen.keys()  # one is enough
        column = next((lower[word] for word in words if word in lower), None)
        if column is not None and not moves and column not in chosen.values():
            chosen.setdefault(kind, column)
    if mapping.rate is not None and mapping.time is None:
        chosen.pop("time", None)
    for name, column in chosen.items():
        if column not in log.names:
            raise LogError(log.lacks(column, f" for {name}"))
        if [*chosen.values()].count(column) > 1:
            raise LogError(f"column {column!r} is named for two signals; each has its own")
    for question, known in (
        ("time? Give --time COLUMN, or --rate HZ", mapping.rate or "time" in chosen),
        ("torque, or current? Give --torque COLUMN", "torque" in chosen),
        ("motor angle, or speed? Give --angle COLUMN or --speed COLUMN",
         {"angle", "speed"} & chosen.keys()),
    ):  # fmt: skip
        if not known:
            raise LogError(
                f"which column is the {question}; there are {log.listed}. If these are no names, "
                "give the line of the names by --header LINE"
            )
    return chosen


def _unit(log: Log, name: str, column: str, mapping: LogMap) -> str:
    """Return the unit of a signal: as the mapping says, the file, or the end of the name."""
    if stated := mapping.unit.get(name) or log.units.get(column):  # type: ignore[call-overload]
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
    return known[unit] * mapping.scale.get(name, 1.0)  # type: ignore[call-overload, no-any-return]
