"""Which column of a log is which signal, in which unit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.column_names import completed
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Log, shown
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.reading import GREATEST, read_toml

Array = NDArray[np.float64]

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "torque": {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "A": 1.0, "mA": 1e-3, "%": 0.01, "1": 1.0},
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
    "ma": "mA", "milliampere": "mA",
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "degrees/s": "deg/s",
    "radian": "rad", "radians": "rad", "radians/s": "rad/s", "turn": "rev", "turns": "rev",
    "radps": "rad/s", "degps": "deg/s",
    "1/min": "rpm", "u/min": "rpm", "min-1": "rpm", "rev/min": "rpm", "hz": "rev/s",
}  # fmt: skip

_ENDINGS = {
    "time": {"ms", "us", "ns", "sec"},
    "torque": {"nm", "mnm", "mA"},
    "angle": {"rad", "mrad", "deg", "rev"},
    "speed": {"rpm", "radps", "degps"},
}
"""What the name of a column may end in after an underscore to be taken for its unit."""

KINDS = {
    "time": "time",
    "torque": "torque",
    "angle": "angle",
    "speed": "speed",
    "load_angle": "angle",
}
"""The signals that a mapping may name, and the kind of unit each has."""

LARGEST = 1e12  # of a rate or a factor
SLOWEST = 0.01  # Hz, so that the time of a log is a number; what is too slow is said later

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
    joined : str
        Which signals came by clocks of their own and were brought to that of the motion, in words.
    """

    time: Array
    torque: Array
    angle: Array | None
    speed: Array | None
    load_angle: Array | None
    stated: frozenset[str]
    joined: str = ""


def mapping_from(tables: Mapping[str, Any], *, source: str) -> LogMap:
    """Return a mapping from nested tables, as read from TOML.

    Raises
    ------
    LogError
        With a line for each key that is unknown or has a value of the wrong kind.
    """
    problems = [f"{source}: {text}" for key in tables for text in _wrong(key, tables[key])]
    if problems:
        raise LogError("\n".join(problems))
    return LogMap(
        columns={name: str(tables[name]) for name in KINDS if name in tables},
        rate=float(tables["rate"]) if "rate" in tables else None,
        scale=dict(tables.get("scale", {})),
        unit=dict(tables.get("unit", {})),
        smooth=tables["torque_is"] == "smooth" if "torque_is" in tables else None,
    )


def _wrong(key: str, value: object) -> Iterator[str]:
    """Yield what is wrong with an entry of a mapping."""
    known = (*KINDS, *_OPTIONS)
    if key not in known:
        yield f"{key}: no such key.{did_you_mean(key, known)} There are {', '.join(known)}"
    elif key in KINDS and not isinstance(value, str):
        yield f"{key} is {value!r}; give the name of a column, in quotes"
    elif key == "rate" and not _is_number(value, least=SLOWEST):
        yield f"rate is {value!r}; give the sampling rate in Hz, {SLOWEST:g} or more"
    elif key == "torque_is" and value not in ("held", "smooth"):
        yield f"torque_is is {value!r}; give 'held' or 'smooth'"
    elif key in ("scale", "unit"):
        wanted = "a number other than 0" if key == "scale" else "a unit"
        for name, entry in value.items() if isinstance(value, Mapping) else [("", value)]:
            good = _is_number(entry) and entry != 0 if key == "scale" else isinstance(entry, str)
            if name not in KINDS or not good:
                others = f"no such signal.{did_you_mean(name, KINDS)} There are {', '.join(KINDS)}"
                yield f"{key}.{name} = {entry!r}: {f'give {wanted}' if name in KINDS else others}"


def _is_number(value: object, *, least: float = -LARGEST) -> bool:
    """Whether a value is a number within sensible limits."""
    there = isinstance(value, int | float) and not isinstance(value, bool)
    return there and least <= value <= LARGEST  # type: ignore[operator]


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the tables of a mapping file."""
    return read_toml(path, LogError)


def pick(log: Log, mapping: LogMap) -> Raw:
    """Return the signals of a log in SI.

    A signal that the mapping does not name is taken from the column of its own name, if any, see
    `column_names`. Where the file says which column of time belongs to which signal, as bags do,
    all are brought to the clock of the motion.

    Raises
    ------
    LogError
        If a column is missing, lengths differ, or a unit is unknown.
    """
    own = {name: name for name in KINDS if name in log.names}
    given = completed(own | dict(mapping.columns), log.names)
    if mapping.rate is not None and "time" not in mapping.columns:
        given.pop("time", None)
    motion = given.get("angle", given.get("speed", ""))
    if mapping.rate is None and motion in log.clock:
        given.setdefault("time", log.clock[motion])
    _check_columns(log, given, mapping)
    units = {name: _unit(log, name, column, mapping) for name, column in given.items()}
    clocks = {log.clock[c] for c in given.values() if c in log.clock}
    columns = log.load([*given.values(), *clocks])
    signals = {
        name: columns[column]
        * (_factor(log, name, column, units[name]) * mapping.scale.get(name, 1))
        for name, column in given.items()
    }
    for name, values in signals.items():
        _check_size(f"{log.source}: column {given[name]!r}", values)
    joined = _joined(log, given, signals, columns, smooth=bool(mapping.smooth))
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
    return Raw(
        time=signals["time"],
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        load_angle=signals.get("load_angle"),
        stated=frozenset({n for n, u in units.items() if u} | ({"time"} - given.keys())),
        joined=joined,
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
    if "time" not in given and mapping.rate is None:
        problems.append(
            f"{log.source}: which column is the time? Give --time COLUMN, or --rate HZ; {there}"
        )
    if "torque" not in given:
        problems.append(
            f"{log.source}: which column is the torque, or current? Give --torque COLUMN; {there}"
        )
    if not {"angle", "speed"} & set(given):
        problems.append(
            f"{log.source}: which column is the motor angle, or speed? Give --angle COLUMN or "
            f"--speed COLUMN; {there}"
        )
    twice = [c for c in set(given.values()) if list(given.values()).count(c) > 1]
    if twice:
        names = ", ".join(name for name, column in given.items() if column == twice[0])
        problems.append(f"{log.source}: column {twice[0]!r} is named for {names}; each has its own")
    if problems:
        raise LogError("\n".join(problems))


def _unit(log: Log, name: str, column: str, mapping: LogMap) -> str:
    """Return the unit of a signal: as the mapping says, the file, or the end of the name."""
    stated = mapping.unit.get(name) or log.units.get(column, "")
    ending, known = column.rpartition("_")[2], _ENDINGS[KINDS[name]]
    # torque_mA is a current, torque_ma may be a moving average
    return stated or next((text for text in (ending, ending.lower()) if text in known), "")


def _factor(log: Log, name: str, column: str, text: str) -> float:
    """Return the factor of a unit to SI."""
    factors = UNITS[KINDS[name]]
    if not text:
        return 1.0
    plain = re.sub(r"[\s·*.^]", "", text)
    unit = _SPELLINGS.get(plain.lower(), plain)
    if unit not in factors:
        raise LogError(
            f"{log.source}: the unit {text!r} of {column} is not one of {', '.join(factors)} "
            f"for {name}; state it with --unit {name}=…"
        )
    return factors[unit]


def _joined(
    log: Log,
    given: Mapping[str, str],
    signals: dict[str, Array],
    columns: Mapping[str, Array],
    *,
    smooth: bool,
) -> str:
    """Bring signals of other clocks to the time of the motion, in place; say which."""
    own = log.clock.get(given.get("angle", given.get("speed", "")))
    if own is None or given.get("time") != own:
        return ""
    moved = []
    for name, column in given.items():
        clock = log.clock.get(column, own)
        if clock == own or name == "time":
            continue
        at, values, time = columns[clock], signals[name], signals["time"]
        if (np.diff(at) <= 0).any():
            raise LogError(f"{log.source}: {clock}, the time of {column}, does not always advance")
        if name == "torque" and not smooth:  # a command stays until the next one
            place = np.searchsorted(at, time, side="right") - 1
            signals[name] = np.where(place < 0, np.nan, values[np.maximum(place, 0)])
        else:
            signals[name] = np.interp(time, at, values, left=np.nan, right=np.nan)
        moved.append(f"{name} by {clock}")
    return f"{', '.join(moved)} was brought to {own}" if moved else ""
