"""The options of the command line that several commands for logs have, and what they mean."""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexaxis.experiments.building.specs import Spec
    from flexaxis.experiments.logs.as_log import LogStyle

SIGNALS = ("time", "torque", "angle", "speed", "load_angle")
_FORGETTING = re.compile(r"\s*(?P<value>[0-9.]+(e-?[0-9]+)?)\s*(?P<unit>ms|s|min)?\s*")
_SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0}


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
        "--highpass", type=float, metavar="HZ", help="take offset and drift away below this"
    )
    group.add_argument(
        "--burn-in", type=float, metavar="S", help="time from the start that is not fitted"
    )


def treatment(args: argparse.Namespace) -> dict[str, float | None]:
    """Return what the options say is to be done to a log, as for `importing.read_any`."""
    return {name: getattr(args, name) for name in ("resample", "highpass", "burn_in")}


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
    group.add_argument(
        "--scale", action="append", default=[], metavar="SIGNAL=F",
        help="a factor that the importer has to find, such as torque=0.6 N m in an ampere",
    )  # fmt: skip
    group.add_argument("--no-header", action="store_true", help="neither names nor units")
    group.add_argument("--decimal-comma", action="store_true", help="CSV as some countries have it")
    group.add_argument(
        "--jitter", type=float, default=0.0, metavar="S", help="of the time stamps [s], 1 σ"
    )
    group.add_argument(
        "--gaps", type=int, default=0, metavar="N", help="times at which samples are missing"
    )
    group.add_argument(
        "--counts", type=int, default=0, metavar="N", help="of the encoder in a turn of the motor"
    )
    group.add_argument(
        "--torque-step", type=float, default=0.0, metavar="X", help="resolution of the torque [N m]"
    )
    group.add_argument(
        "--offset", action="append", default=[], metavar="SIGNAL=X",
        help="a constant on a signal [SI], such as torque=0.1",
    )  # fmt: skip


def style_of(args: argparse.Namespace) -> LogStyle:
    """Return the style that a command line asks for."""
    from flexaxis.experiments.logs.as_log import LogStyle

    return LogStyle(
        units=tuple(unit.strip() for unit in args.units.split(",")) if args.units else (),
        header=not args.no_header,
        decimal_comma=args.decimal_comma,
        jitter=args.jitter,
        gaps=args.gaps,
        counts=args.counts,
        torque_step=args.torque_step,
        offset=_numbers("offset", args.offset),
        scale=_numbers("scale", args.scale),
    )


def _numbers(option: str, texts: list[str]) -> dict[str, float]:
    from flexaxis.experiments.logs.errors import LogError

    found = {}
    for name, value in assignments(option, texts).items():
        if value is None:
            raise LogError(f"--{option} {name}: write SIGNAL=VALUE, such as torque=0.1")
        found[name] = value
    return found


def with_forgetting(spec: Spec, text: str, period: float) -> Spec:
    """Return an estimator with a forgetting factor, given as λ or as a time constant.

    Parameters
    ----------
    spec : Spec
    text : str
        ``"0.995"``, or a time such as ``"1 s"`` or ``"500 ms"``: λ = 1 − T/τ, the memory of
        samples T apart fades by 1/e in τ.
    period : float
        [s].

    Raises
    ------
    LogError
        If it is neither, or not possible.
    EstimatorError
        If the estimator forgets in no such way.
    """
    from flexaxis.experiments.building.specs import parse
    from flexaxis.experiments.logs.errors import LogError

    match = _FORGETTING.fullmatch(text)
    value = float(match["value"]) if match else 0.0
    unit = match["unit"] if match else None
    if unit:
        value = 1 - period / (value * _SECONDS[unit]) if value else 0.0
    if not 0 < value < 1:
        raise LogError(
            f"--forgetting {text!r}: give a time such as '1 s', longer than the sampling period of "
            f"{1e3 * period:g} ms, or a factor between 0 and 1 such as 0.995"
        )
    parse(f"{spec.text.partition('[')[0]}[forgetting={value!r}]")  # refuses who has no such option
    return replace(spec, options=dict(spec.options) | {"forgetting": value})
