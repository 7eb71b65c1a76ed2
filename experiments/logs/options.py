"""The options of the command line that several commands for logs have, and what they mean."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.logs.errors import LogError

if TYPE_CHECKING:
    from flexaxis.experiments.logs.as_log import LogStyle

SIGNALS = ("time", "torque", "angle", "speed")
KEYS = (*SIGNALS, "rate", "torque_is", "rows", "header", "resample", "burn_in")
SEVERAL: dict[str, Any] = {"action": "append", "default": []}


LOG_OPTIONS: dict[str, str | tuple[str, dict[str, Any]]] = {
    "--map MAP.toml": ("Read these options from a TOML file (default: none).", {"type": Path}),
    "--time COLUMN": "Column of the time (default: found by its name).",
    "--torque COLUMN": "Column of the torque command or motor current (default: found by its "
    "name).",
    "--angle COLUMN": "Column of the motor angle (default: found by its name).",
    "--speed COLUMN": "Column of the motor speed (default: found by its name).",
    "--axis N": "Axis number that replaces {} in column names, for files of several axes "
    "(default: none).",
    "--rows A:B": "Samples to read, from A to B-1 (default: all).",
    "--rate HZ": ("Sampling rate [Hz], if the log has no time column (default: from the time).",
                  {"type": float}),
    "--header LINE": ("Line of the names of a CSV, from 1 (default: found by content).",
                      {"type": int}),
    "--unit SIGNAL=UNIT": ("Unit of a signal, such as angle=deg (default: from the column's name, "
                           "else SI).", SEVERAL),
    "--scale SIGNAL=FACTOR": (
        "Multiply a signal by a factor, such as torque=0.6 (N m/A) or a sign, torque=-1 (default: "
        "1).", SEVERAL,
    ),
    "--torque-is KIND": (
        "held: a command, constant until the next sample (zero-order hold); smooth: a measured "
        "current, which changes between samples (default: seen from the log).",
        {"choices": ("held", "smooth")},
    ),
    "--resample HZ": ("Resample the log to this rate [Hz] (default: as logged).", {"type": float}),
    "--burn-in S": ("Time from the start that is not fitted [s] (default: 0 for a log that starts "
                    "at rest, else 1).", {"type": float}),
    "--as-log FORMAT": ("Write what a robot would log, as csv (default: a record).",
                        {"choices": ("csv",)}),
    "--units U,…": "Units of the written log, such as deg,A,rpm,ms (default: SI).",
    "--jitter S": ("Standard deviation of the written time stamps [s] (default: 0).",
                   {"type": float, "default": 0.0}),
    "--gaps N": ("Number of times at which samples are missing (default: 0).",
                 {"type": int, "default": 0}),
    "--counts N": ("Counts of the encoder per turn of the motor: of an angle in counts, or to "
                   "round the written angle (default: none).", {"type": int, "default": 0}),
}  # fmt: skip
"""Options of the commands that read or write logs, as in `experiments.commands.options`."""

READING = (
    "--map", "--time", "--torque", "--angle", "--speed", "--axis", "--rows", "--rate", "--header",
    "--unit", "--counts", "--scale", "--torque-is", "--resample", "--burn-in",
)  # fmt: skip
"""Those that say how a log is read."""
WRITING = ("--as-log", "--units", "--jitter", "--gaps", "--counts")
"""Those that say how one is written."""


def tables_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return how a log is read, as for `fx.import_log`: options go before those of the file."""
    from flexaxis.experiments.logs.mapping import load_mapping

    tables = load_mapping(args.map) if args.map else {}
    named = {name: getattr(args, name) for name in KEYS} | {"counts": args.counts or None}
    tables |= {name: value for name, value in named.items() if value is not None}
    if args.axis is not None:
        tables |= {n: str(tables[n]).replace("{}", args.axis) for n in SIGNALS if n in tables}
    for key in ("unit", "scale"):
        if pairs := dict(_pair(key, text) for text in getattr(args, key)):
            tables[key] = {**tables.get(key, {}), **pairs}
    return tables


def assignments(option: str, texts: list[str]) -> dict[str, float | None]:
    """Return names with their values from ``NAME=VALUE``, or None from ``NAME`` alone."""
    pairs = (text.partition("=") for text in texts)
    return {
        name.strip(): _number(option, value) if equals else None for name, equals, value in pairs
    }


def _pair(key: str, text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise LogError(f"--{key} {text}: write SIGNAL=VALUE, such as angle=deg or torque=0.6")
    return name.strip(), _number(key, value) if key == "scale" else value.strip()


def _number(option: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise LogError(f"--{option}: {value!r} is not a number") from None


def style_of(args: argparse.Namespace) -> LogStyle:
    """Return the style that a command line asks for."""
    from flexaxis.experiments.logs.as_log import LogStyle

    units = tuple(unit.strip() for unit in args.units.split(",")) if args.units else ()
    return LogStyle(units, args.jitter, args.gaps, args.counts)
