"""Options of the commands that read or write logs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

SIGNALS = {"time", "torque", "angle", "speed"}
KEYS = (*SIGNALS, "rate", "torque_is", "counts", "rows", "header", "resample", "burn_in")


def pair(text: str) -> tuple[str, str]:
    """Return name and value of ``SIGNAL=VALUE``."""
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"write SIGNAL=VALUE, such as angle=deg, not {text}")
    return name.strip(), value.strip()


def assignment(text: str) -> tuple[str, float | None]:
    """Return a name with its number from ``NAME=VALUE``, or None from ``NAME`` alone."""
    name, equals, value = text.partition("=")
    return name.strip(), float(value) if equals else None


PAIRS: dict[str, Any] = {"action": "append", "default": [], "type": pair}
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
                           "else SI).", PAIRS),
    "--scale SIGNAL=FACTOR": ("Multiply a signal by a factor, such as torque=0.6 (N m/A) or "
                              "torque=-1 (default: 1).", PAIRS),
    "--torque-is KIND": (
        "held: a command, constant until the next sample (zero-order hold); smooth: a measured "
        "current, which changes between samples (default: seen from the log).",
        {"choices": ("held", "smooth")},
    ),
    "--resample HZ": ("Lower the rate to this one [Hz], a whole fraction of that of the log "
                      "(default: as logged).", {"type": float}),
    "--burn-in S": ("Time from the start that is not fitted [s] (default: 0 for a log that starts "
                    "at rest, else 1).", {"type": float}),
    "--as-log FORMAT": ("Write what a robot would log, as csv (default: a record).",
                        {"choices": ("csv",)}),
    "--units U,…": ("Units of the written log, such as deg,A,rpm,ms (default: SI).",
                    {"default": ""}),
    "--jitter S": ("Standard deviation of the written time stamps [s] (default: 0).",
                   {"type": float, "default": 0.0}),
    "--gaps N": ("Number of times at which samples are missing (default: 0).",
                 {"type": int, "default": 0}),
    "--counts N": ("Counts of the encoder per turn of the motor: of an angle in counts, or to "
                   "round the written angle (default: none).", {"type": int}),
}  # fmt: skip
"""As in `experiments.commands.options`."""

READING = (
    "--map", "--time", "--torque", "--angle", "--speed", "--axis", "--rows", "--rate", "--header",
    "--unit", "--counts", "--scale", "--torque-is", "--resample", "--burn-in",
)  # fmt: skip
"""Options on how to read a log."""


def tables_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return how to read a log, as for `fx.import_log`; options take precedence over the file."""
    from flexaxis.experiments.logs.findings import LogError
    from flexaxis.experiments.logs.mapping import mapping_from
    from flexaxis.sim.files import read_toml

    tables = read_toml(args.map, LogError) if args.map else {}
    mapping_from(tables, source=args.map)
    tables |= {name: value for name in KEYS if (value := getattr(args, name)) is not None}
    for key in ("unit", "scale"):
        if pairs := dict(getattr(args, key)):
            tables[key] = tables.get(key, {}) | pairs
    if args.axis is not None:
        columns = {name: tables[name].replace("{}", args.axis) for name in SIGNALS & tables.keys()}
        tables |= columns
    return tables
