"""The options of the command line that say how a robot writes its log."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexaxis.experiments.logs.as_log import LogStyle


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
    from flexaxis.experiments.logs.options import assignments

    found = {}
    for name, value in assignments(option, texts).items():
        if value is None:
            raise LogError(f"--{option} {name}: write SIGNAL=VALUE, such as torque=0.1")
        found[name] = value
    return found
