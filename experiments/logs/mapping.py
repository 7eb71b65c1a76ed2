"""Which column of a log is which signal, in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.readers import Columns
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.reading import read_toml

Array = NDArray[np.float64]

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "torque": {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "A": 1.0, "%": 0.01, "1": 1.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "rev": 2 * np.pi},
    "speed": {
        "rad/s": 1.0,
        "deg/s": np.pi / 180,
        "rpm": 2 * np.pi / 60,
        "rev/s": 2 * np.pi,
    },
}
"""Units of each kind of signal, with their factor to SI. A torque may be a current or a command:
k_T is then the torque of one such unit."""

_SPELLINGS = {
    "µs": "us", "μs": "us", "sec": "s", "seconds": "s", "second": "s",
    "nm": "Nm", "newtonmeter": "Nm", "mnm": "mNm", "amp": "A", "ampere": "A", "a": "A",
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "degrees/s": "deg/s",
    "radian": "rad", "radians": "rad", "radians/s": "rad/s", "turn": "rev", "turns": "rev",
    "1/min": "rpm", "min-1": "rpm", "rev/min": "rpm", "hz": "rev/s",
}  # fmt: skip

KINDS = {
    "time": "time",
    "torque": "torque",
    "angle": "angle",
    "speed": "speed",
    "load_angle": "angle",
}
"""The signals that a mapping may name, and the kind of unit each has."""

_OPTIONS = ("rate", "scale", "unit", "torque_is")


@dataclass(frozen=True)
class LogMap:
    """Which columns to take.

    Attributes
    ----------
    columns : dict of str to str
        Column of each signal of `KINDS`; time may be left out where `rate` is given.
    rate : float or None
        Sampling rate [Hz] of a log without time.
    scale : dict of str to float
        Factor on a signal, after its unit; −1 turns a sign.
    unit : dict of str to str
        Unit of a signal, where the file does not say it or is wrong.
    smooth : bool or None
        Whether the torque is a measured, smooth signal such as a current, rather than a command
        that is held until the next sample; None where nobody said.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    scale: Mapping[str, float] = field(default_factory=dict)
    unit: Mapping[str, str] = field(default_factory=dict)
    smooth: bool | None = None


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
    """

    time: Array
    torque: Array
    angle: Array | None
    speed: Array | None
    load_angle: Array | None
    stated: frozenset[str]


def mapping_from(tables: Mapping[str, Any], *, source: str) -> LogMap:
    """Return a mapping from nested tables, as read from TOML.

    Raises
    ------
    LogError
        With a line for each key that is unknown or has a value of the wrong kind.
    """
    problems = []
    for key, value in tables.items():
        if key not in (*KINDS, *_OPTIONS):
            problems.append(
                f"{source}: {key}: no such key.{did_you_mean(key, (*KINDS, *_OPTIONS))} "
                f"There are {', '.join((*KINDS, *_OPTIONS))}"
            )
        elif key in ("scale", "unit"):
            wanted = (int, float) if key == "scale" else str
            for name, entry in value.items() if isinstance(value, Mapping) else [("", value)]:
                if name not in KINDS or not isinstance(entry, wanted):
                    problems.append(
                        f"{source}: {key}.{name} = {entry!r}: give "
                        f"{'a number' if key == 'scale' else 'a unit'} for one of "
                        f"{', '.join(KINDS)}.{did_you_mean(name, KINDS)}"
                    )
        elif key == "rate" and not (isinstance(value, int | float) and value > 0):
            problems.append(f"{source}: rate is {value!r}; give the sampling rate in Hz, above 0")
        elif key == "torque_is" and value not in ("held", "smooth"):
            problems.append(f"{source}: torque_is is {value!r}; give 'held' or 'smooth'")
    if problems:
        raise LogError("\n".join(problems))
    return LogMap(
        columns={name: str(tables[name]) for name in KINDS if name in tables},
        rate=tables.get("rate"),
        scale=dict(tables.get("scale", {})),
        unit=dict(tables.get("unit", {})),
        smooth=tables["torque_is"] == "smooth" if "torque_is" in tables else None,
    )


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the tables of a mapping file."""
    return read_toml(path, LogError)


def pick(columns: Columns, mapping: LogMap) -> Raw:
    """Return the signals of a log in SI.

    A signal that the mapping does not name is taken from the column of its own name, if any.

    Raises
    ------
    LogError
        If a column is missing, lengths differ, or a unit is unknown.
    """
    given = {name: name for name in KINDS if name in columns.values} | dict(mapping.columns)
    if mapping.rate is not None and "time" not in mapping.columns:
        given.pop("time", None)
    _check_columns(columns, given, mapping)
    signals = {name: _in_si(columns, name, column, mapping) for name, column in given.items()}
    if "time" not in signals:
        assert mapping.rate is not None  # checked above
        signals["time"] = np.arange(len(signals["torque"])) / mapping.rate
    lengths = {name: len(values) for name, values in signals.items()}
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise LogError(f"{columns.source}: the columns differ in length: {text}")
    stated = {name for name in given if name in mapping.unit or given[name] in columns.units}
    return Raw(
        time=signals["time"],
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        load_angle=signals.get("load_angle"),
        stated=frozenset(stated),
    )


def _check_columns(columns: Columns, given: Mapping[str, str], mapping: LogMap) -> None:
    problems = [
        f"{columns.source}: there is no column {column!r} for {name}."
        f"{did_you_mean(column, columns.values)} There are {', '.join(columns.values)}"
        for name, column in given.items()
        if column not in columns.values
    ]
    if "time" not in given and mapping.rate is None:
        problems.append(
            f"{columns.source}: which column is the time? Give --time COLUMN, or --rate HZ; "
            f"there are {', '.join(columns.values)}"
        )
    if "torque" not in given:
        problems.append(
            f"{columns.source}: which column is the torque, or current? Give --torque COLUMN; "
            f"there are {', '.join(columns.values)}"
        )
    if not {"angle", "speed"} & set(given):
        problems.append(
            f"{columns.source}: which column is the motor angle, or speed? Give --angle COLUMN or "
            f"--speed COLUMN; there are {', '.join(columns.values)}"
        )
    if problems:
        raise LogError("\n".join(problems))


def _in_si(columns: Columns, name: str, column: str, mapping: LogMap) -> Array:
    factors = UNITS[KINDS[name]]
    text = mapping.unit.get(name, columns.units.get(column, ""))
    if not text:
        return columns.values[column] * mapping.scale.get(name, 1.0)
    plain = re.sub(r"[\s·*.^]", "", text)
    unit = _SPELLINGS.get(plain.lower(), plain)
    if unit not in factors:
        raise LogError(
            f"{columns.source}: the unit {text!r} of {column} is not one of {', '.join(factors)} "
            f"for {name}; state it with --unit {name}=…"
        )
    return columns.values[column] * (factors[unit] * mapping.scale.get(name, 1.0))
