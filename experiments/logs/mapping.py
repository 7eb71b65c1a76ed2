"""Select the signals of a log from its columns, and convert the signals to SI units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.read import Array, Log
from flexaxis.experiments.logs.units import COUNTS, ENDING, SI, UNITS, WORDS, spelt
from flexaxis.sim.tables.config import Config

Signal = Literal["time", "torque", "angle", "speed"]

MOTIONS = ("angle", "speed")


class LogMap(Config):
    """Options for reading a log.

    Attributes
    ----------
    time, torque, angle, speed : str or None
        Name of the column that contains the signal. By default, columns are recognised by their
        names.
    rate : float or None
        Sampling rate [Hz] of a log without a time column.
    scale : dict of str to float
        Factor by which a signal is multiplied after its conversion to SI units. The factor −1
        reverses the sign of the signal.
    unit : dict of str to str
        Units of signals for which the file states no unit or a wrong unit.
    counts : float or None
        Encoder counts per turn, for an angle that is logged in counts.
    torque_is : {"held", "smooth"} or None
        Kind of torque. A command is ``"held"`` until the next sample. A measured current is
        ``"smooth"``. By default, flexaxis detects the kind from the log.
    rows : str
        Range of samples to read. The range ``A:B`` selects the samples A to B − 1.
    header : int or None
        Number of the line that contains the column names of a CSV file, counted from 1.
    resample : float or None
        Reduced sampling rate [Hz], which must be the logged rate divided by an integer.
    """

    time: str | None = None
    torque: str | None = None
    angle: str | None = None
    speed: str | None = None
    rate: PositiveFloat | None = None
    scale: Mapping[Signal, Annotated[float, Field(strict=False)]] = {}
    unit: Mapping[Signal, str] = {}
    counts: PositiveFloat | None = None
    torque_is: Literal["held", "smooth"] | None = None
    rows: Annotated[str, Field(pattern=r"^\d*:\d*$")] = ":"
    header: PositiveInt | None = None
    resample: PositiveFloat | None = None


class Raw(NamedTuple):
    """The signals of a log, in SI units, at the logged times. Missing values are NaN.

    Attributes
    ----------
    time : ndarray (N,)
        Time [s].
    signals : dict of str to ndarray (N,)
        Torque [N m], and angle [rad] or speed [rad/s] or both.
    unit : dict of str to str
        Units of the logged signals. Signals without a stated unit are omitted.
    turn : float
        Range [rad] of the logged angle if it wraps, else 0.
    every : int
        Number of rows of the log per original sample, which is 1 unless the log was interpolated.
    """

    time: Array
    signals: Mapping[str, Array]
    unit: Mapping[str, str]
    turn: float = 0.0
    every: int = 1

    def part(self, rows: Any) -> Raw:
        """Return the given rows of the signals."""
        signals = {name: values[rows] for name, values in self.signals.items()}
        return self._replace(time=self.time[rows], signals=signals)

    @property
    def motion(self) -> str:
        """Name of the motion signal to use: ``"angle"`` if the log has one, else ``"speed"``."""
        return "angle" if "angle" in self.signals else "speed"

    @property
    def linear(self) -> bool:
        """Whether the motion is linear rather than rotary: its unit then contains a length."""
        return any(re.match(r"([numck]?m|in)(/|$)", unit) for unit in self.unit.values())


def pick(log: Log, mapping: LogMap) -> Raw:
    """Return the signals of a log in SI units.

    Raises
    ------
    LogError
        If a column is missing, if columns differ in length, or if a unit is unknown.
    """
    chosen = _columns(log, mapping)
    rows = slice(*(int(part) if part else None for part in mapping.rows.split(":")))
    columns = log.read([*chosen.values()], rows)
    lengths = {*map(len, columns.values())}
    if len(lengths) > 1:
        raise LogError(
            f"the columns {', '.join(columns)} differ in length. All columns of a log must have "
            "a value for every sample. If these columns have different sampling rates, resample "
            "them to one rate first"
        )
    signals, units = dict[str, Array](), dict[str, str]()
    for name, column in chosen.items():
        known, ending = UNITS[name] | {"": 1.0}, ENDING.fullmatch(column)
        usual = spelt(ending[1], name) if ending else ""
        if mapping.counts is not None and name == "angle":
            known[COUNTS], usual = 2 * np.pi / mapping.counts, COUNTS
        stated = mapping.unit.get(name) or log.units.get(column)  # type: ignore[call-overload]
        unit = spelt(stated, name) if stated else usual if usual in known else ""
        if unit not in known:
            raise LogError(
                f"the unit {unit!r} of the column {column} is unknown. The known units of {name} "
                f"are {', '.join(filter(None, known))}. Give a known unit with --unit {name}=…, or "
                f"--counts N for encoder counts. For any other unit, give a known unit and --scale "
                f"{name}=FACTOR"
            )
        scale = mapping.scale.get(name, 1.0)  # type: ignore[call-overload]
        signals[name] = columns[column] * known[unit] * scale
        if unit:
            units[name] = unit
    if mapping.rate:
        units["time"] = "s"
        signals["time"] = np.arange(*lengths) / mapping.rate
    return Raw(signals.pop("time"), signals, units)


def _columns(log: Log, mapping: LogMap) -> dict[str, str]:
    """Return the column of each signal: the one that the options state, or one with a known name.

    If the options state a column for only one of angle and speed, the other signal is ignored. If
    the options state a sampling rate, time columns are ignored.
    """
    stated = mapping.model_dump(include={*SI}, exclude_none=True)
    ignored = MOTIONS if stated.keys() & MOTIONS else ()
    lower = {name.lower(): name for name in reversed([*log.columns])}
    chosen = {
        name: lower[word]
        for name, words in WORDS.items()
        for word in reversed(words.split())
        if word in lower and name not in ignored
    } | stated
    if mapping.rate:
        chosen.pop("time", None)
    wanted = {
        "the time (give --time COLUMN or --rate HZ)": mapping.rate or "time" in chosen,
        "the torque or current (give --torque COLUMN)": "torque" in chosen,
        "the motor angle or speed (give --angle COLUMN or --speed COLUMN)": chosen.keys() & MOTIONS,
    }
    if absent := [signal for signal, column in wanted.items() if not column]:
        raise LogError(
            f"no column was recognised as {', '.join(absent)}. The columns are "
            f"{', '.join(log.columns)}. If the column names are on another line of the file, give "
            "--header LINE"
        )
    return chosen
