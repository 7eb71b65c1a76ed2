"""Define the names and units of the signals in a log, and write a record as a log."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from flexaxis.experiments.files import new_file
from flexaxis.experiments.logs.axis_file import valid_of
from flexaxis.experiments.logs.findings import LogError
from flexaxis.sim.errors import unknown
from flexaxis.sim.record import Record

LONGEST_GAP = 20  # maximum number of samples in a simulated gap

_TURN = 2 * np.pi
_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3}
_PREFIXED = {"time": "s", "torque": "Nm N A V", "angle": "rad m", "speed": "rad/s m/s"}
_OTHER = {
    "time": {"min": 60.0, "h": 3600.0},
    "torque": {
        "Ncm": 1e-2, "Nmm": 1e-3, "kgfcm": 0.0980665, "lbfin": 0.1129848290276167,
        "lbfft": 1.3558179483314004, "ozfin": 0.00706155181422604, "%": 0.01, "1": 1.0,
    },
    "angle": {"deg": _TURN / 360, "rev": _TURN, "in": 0.0254},
    "speed": {"deg/s": _TURN / 360, "rpm": _TURN / 60, "rev/s": _TURN, "in/s": 0.0254},
}  # fmt: skip
UNITS: dict[str, dict[str, float]] = {
    kind: {p + unit: factor for unit in units.split() for p, factor in _PREFIXES.items()}
    | _OTHER[kind]
    for kind, units in _PREFIXED.items()
}
"""Units of each kind of signal, with the factors that convert the units to SI.

If the log contains a force, a current or a command instead of the torque, k_T is the torque per
unit of the logged signal."""
KNOWN = [unit for table in UNITS.values() for unit in table]
COUNTS = "counts"
SI = {"time": "s", "torque": "Nm", "angle": "rad", "speed": "rad/s"}

_LOWER = {unit.lower(): unit for unit in reversed(KNOWN)}
_SPELLINGS = {
    "newton": "N", "newtonmet(er|re)": "Nm", "amp(ere)?|arms": "A", "volt": "V",
    "lbin|inlbf?": "lbfin", "lbft|ftlbf?": "lbfft", "ozin|inoz": "ozfin",
    "°|degrees?": "deg", "radians?": "rad", "turns?": "rev", "inch": "in", "met(er|re)": "m",
    "sec(onds?)?": "s", "minutes": "min", "hz": "rev/s", "(1|u|rev)/min|min1": "rpm",
}  # fmt: skip

# torque_mA is a current in mA, but torque_ma may be a moving average
ENDING = re.compile(
    r".*_(mA|(?i:ms|us|ns|sec|m?nm|lbf?in|lbft|ozin|m?rad|deg|rev|[mu]m|rpm"
    r"|(rad|deg|mm|m)_s|(rad|deg|mm)ps))"
)
"""Pattern of column names that end in an underscore and a unit."""

WORDS = {
    "time": "time zeit temps",
    "torque": "torque drehmoment motormoment moment couple motorstrom strom courant",
    "angle": "angle position motorwinkel winkel",
    "speed": "speed velocity drehzahl geschwindigkeit vitesse",
}
"""Recognised column names in English, German and French, the preferred name first.

Upper and lower case are equivalent."""


def spelt(text: str, kind: str = "") -> str:
    """Convert a unit to its spelling in `UNITS`; ``nm`` is nanometres for an angle, else N m."""
    plain = re.sub("[µμ]", "u", re.sub(r"[\s·*.^-]", "", text))
    if plain in KNOWN and (plain != "nm" or kind == "angle"):
        return plain
    if second := re.fullmatch(r"(.+)(/s|_s|ps)", plain):
        return f"{spelt(second[1])}/s"
    small = plain.lower()
    words = (unit for pattern, unit in _SPELLINGS.items() if re.fullmatch(pattern, small))
    return next(words, _LOWER.get(small, plain))


def is_unit(text: str) -> bool:
    """Return whether a string in brackets is a unit rather than an index."""
    return text != "1" and spelt(text) in (*KNOWN, COUNTS)


def write_log(
    path: Path,
    record: Record,
    rng: np.random.Generator,
    *,
    units: Sequence[str] = (),
    gaps: int = 0,
    counts: int = 0,
) -> None:
    """Write a record as a CSV file that resembles a robot log, with columns like ``angle [deg]``.

    Parameters
    ----------
    path : Path
        Path of the CSV file.
    record : Record
        Record to write.
    rng : Generator
        Random numbers for the gaps.
    units : sequence of str
        Units of signals, such as ``("deg", "A")``. All other signals are written in SI units.
    gaps : int
        Number of gaps. Each gap omits up to `LONGEST_GAP` rows.
    counts : int
        Encoder counts per turn of the motor. The angle is rounded to whole counts, unless `counts`
        is 0.

    Raises
    ------
    LogError
        If a unit is unknown, or if `gaps` or `counts` is negative.
    """
    if wrong := [unit for unit in units if unit not in KNOWN]:
        raise LogError(f"--units: {unknown('unit', wrong[0], KNOWN)}")
    if min(gaps, counts) < 0:
        raise LogError("--gaps and --counts must be 0 or more")
    n, signals = len(record.time), {name: getattr(record, name) for name in SI}
    if counts and record.angle is not None:
        step = 2 * np.pi / counts
        signals["angle"] = step * np.rint(record.angle / step)
    kept = valid_of(record).copy()
    for begin in rng.integers(1, max(n - LONGEST_GAP - 1, 2), gaps):  # the last sample is kept
        kept[begin : begin + rng.integers(1, LONGEST_GAP + 1)] = False
    table = pd.DataFrame()
    for name, values in signals.items():
        unit = next((unit for unit in units if unit in UNITS[name]), SI[name])
        if values is not None:
            table[f"{name} [{unit}]"] = values[kept] / UNITS[name][unit]
    with new_file(path) as part:
        table.to_csv(part, index=False, float_format="%.10g")
