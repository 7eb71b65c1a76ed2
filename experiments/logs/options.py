"""Command-line options of the commands that read or write logs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def pair(text: str) -> tuple[str, str]:
    """Split text such as ``angle=deg`` into the name of the signal and the value."""
    name, value = text.split("=")
    return name.strip(), value.strip()


def assignment(text: str) -> tuple[str, float | None]:
    """Split ``NAME=VALUE`` into a name and a number, which is None if the value is missing."""
    name, equals, value = text.partition("=")
    return name.strip(), float(value) if equals else None


PAIRS: dict[str, Any] = {"action": "append", "default": [], "type": pair}
LOG_OPTIONS: dict[str, str | tuple[str, dict[str, Any]]] = {
    "--map MAP.toml": ("Read the options for the log from a TOML file (default: none).",
                       {"type": Path}),
    "--time COLUMN": "Column with the time (default: recognised by its name).",
    "--torque COLUMN": "Column with the torque command or the motor current (default: recognised "
    "by its name).",
    "--angle COLUMN": "Column with the motor angle (default: recognised by its name).",
    "--speed COLUMN": "Column with the motor speed (default: recognised by its name).",
    "--rows A:B": "Read only samples A to B-1 (default: all).",
    "--rate HZ": ("Sampling rate [Hz], necessary if the log has no time column (default: computed "
                  "from the time column).", {"type": float}),
    "--header LINE": ("Number of the line that contains the column names of a CSV file, counted "
                      "from 1 (default: detected from the content).", {"type": int}),
    "--unit SIGNAL=UNIT": ("Unit of a signal, such as angle=deg (default: taken from the column "
                           "name, else SI).", PAIRS),
    "--scale SIGNAL=FACTOR": ("Factor by which a signal is multiplied, such as torque=0.6 (in "
                              "N m/A) or torque=-1 (default: 1).", PAIRS),
    "--torque-is KIND": (
        "Kind of torque (default: detected from the log). 'held' is a command that is constant "
        "until the next sample (zero-order hold), and 'smooth' is a measured current.",
        {"choices": ("held", "smooth")},
    ),
    "--resample HZ": ("Reduced sampling rate [Hz], which must be the logged rate divided by an "
                      "integer (default: the logged rate).", {"type": float}),
    "--burn-in S": ("Time at the start of the log that the fit ignores [s] (default: 0 if the log "
                    "starts at rest, else 1).", {"type": float}),
    "--as-log FORMAT": ("Write a CSV file that resembles the log of a real robot (default: write a "
                        "record).", {"choices": ("csv",)}),
    "--units U,…": ("Units of the written log, such as deg,A,rpm,ms (default: SI).",
                    {"default": ""}),
    "--gaps N": ("Number of gaps in the written log (default: 0).",
                 {"type": int, "default": 0}),
    "--counts N": ("Encoder counts per turn of the motor, for an angle that is logged in counts or "
                   "rounded to counts (default: none).", {"type": int}),
}  # fmt: skip
"""Options of the commands that read or write logs, in the format of `commands.options`."""

READING = (
    "--map", "--time", "--torque", "--angle", "--speed", "--rows", "--rate", "--header",
    "--unit", "--counts", "--scale", "--torque-is", "--resample", "--burn-in",
)  # fmt: skip
"""Names of the options for reading a log."""


def tables_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of `fx.import_log`. Options override values in the ``--map`` file."""
    from flexaxis.experiments.logs.findings import LogError, checked
    from flexaxis.experiments.logs.mapping import LogMap
    from flexaxis.sim.text_files import read_toml

    tables = read_toml(args.map, LogError) if args.map else {}
    checked(LogMap, tables, args.map)
    for name in (*LogMap.model_fields, "burn_in"):
        value = getattr(args, name)
        if isinstance(value, list):  # of pairs
            value = tables.get(name, {}) | dict(value) or None
        if value is not None:
            tables[name] = value
    return tables
