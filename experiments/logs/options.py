"""The options of the command line that several commands for logs have, and what they mean."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexaxis.experiments.logs.as_log import LogStyle

SIGNALS = ("time", "torque", "angle", "speed", "load_angle")


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    group = parser.add_argument_group("columns of the log")
    group.add_argument("--map", type=Path, metavar="MAP.toml", help="the same as a file")
    for name, meaning in (
        ("time", "time"),
        ("torque", "torque command, or motor current"),
        ("angle", "motor angle"),
        ("speed", "motor speed"),
        ("load-angle", "angle of the load: kept for comparison, no estimator gets it"),
    ):
        group.add_argument(f"--{name}", metavar="COLUMN", help=meaning)
    group.add_argument(
        "--axis", metavar="N", help="of several in a file: what stands for {} in names of columns"
    )
    group.add_argument("--rows", metavar="A:B", help="samples from A to before B")
    group.add_argument("--rate", type=float, metavar="HZ", help="of a log without time")
    group.add_argument(
        "--unit", action="append", default=[], metavar="SIGNAL=UNIT", help="such as angle=deg"
    )
    group.add_argument(
        "--scale", action="append", default=[], metavar="SIGNAL=FACTOR", help="such as torque=0.6"
    )
    group.add_argument(
        "--torque-is",
        choices=("held", "smooth"),
        help="held: a command, constant until the next sample; smooth: a measured current, which "
        "changes between the samples as well (default: seen from the log)",
    )
    group.add_argument("--resample", type=float, metavar="HZ", help="to another rate")
    group.add_argument(
        "--burn-in", type=float, metavar="S", help="time from the start that is not fitted"
    )


def treatment(args: argparse.Namespace) -> dict[str, float | None]:
    """Return what the options say is to be done to a log, as for `importing.read_any`."""
    return {name: getattr(args, name) for name in ("resample", "burn_in")}


def tables_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the mapping of a command line, its options over those of its file."""
    from flexaxis.experiments.logs.mapping import load_mapping

    tables = load_mapping(args.map) if args.map else {}
    named = {name: getattr(args, name) for name in (*SIGNALS, "rate", "torque_is", "rows")}
    tables |= {name: value for name, value in named.items() if value is not None}
    if args.axis is not None:
        tables |= {n: str(tables[n]).replace("{}", args.axis) for n in SIGNALS if n in tables}
    for key in ("unit", "scale"):
        given = dict(_pair(key, text) for text in getattr(args, key))
        if given:
            tables[key] = {**tables.get(key, {}), **given}
    return tables


def assignments(option: str, texts: list[str]) -> dict[str, float | None]:
    """Return names with their values from ``NAME=VALUE``, or None from ``NAME`` alone."""
    found: dict[str, float | None] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        found[name.strip()] = _float(option, text, value) if equals else None
    return found


def _pair(key: str, text: str) -> tuple[str, Any]:
    from flexaxis.experiments.logs.errors import LogError

    name, equals, value = text.partition("=")
    if not equals:
        raise LogError(f"--{key} {text}: write SIGNAL=VALUE, such as angle=deg or torque=0.6")
    return name.strip(), _float(key, text, value) if key == "scale" else value.strip()


def _float(option: str, text: str, value: str) -> float:
    from flexaxis.experiments.logs.errors import LogError

    try:
        return float(value)
    except ValueError:
        raise LogError(f"--{option} {text}: {value!r} is not a number") from None


def add_style_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    group = parser.add_argument_group("how the log is written")
    group.add_argument(
        "--units", metavar="U,…", help="such as deg,A,rpm,ms: for the signals that can have them"
    )
    for option, kind, of, meaning in (
        ("--jitter", float, "S", "of the time stamps [s], 1 σ"),
        ("--gaps", int, "N", "times at which samples are missing"),
        ("--counts", int, "N", "of the encoder in a turn of the motor"),
    ):
        group.add_argument(option, type=kind, default=0, metavar=of, help=meaning)


def style_of(args: argparse.Namespace) -> LogStyle:
    """Return the style that a command line asks for."""
    from flexaxis.experiments.logs.as_log import LogStyle

    units = tuple(unit.strip() for unit in args.units.split(",")) if args.units else ()
    return LogStyle(units, args.jitter, args.gaps, args.counts)
