"""Identify the nominal values of an axis from its log, or from a record.

Three fits are made: whitened prediction errors, white ones, and for a rigid axis its inverse
dynamics. The one that best simulates pieces of the log that it was not fitted to is taken, and
where they differ by more than they claim, deviations are widened to that. Dry friction, gravity
and friction with two sides are taken where such simulations are better with them. A log of one
axis shows ratios to k_T only, so k_T (and the gear ratio r) stay at their values unless freed.
Status 0: the numbers can be used as far as their deviations say; 1: they cannot.

MODEL is one_mass, two_mass, three_mass, or a TOML of your own (docs/logs.md).

example:
  flexaxis identify rec.nc --model two_mass -o axis.toml
  flexaxis identify rec.nc --model two_mass --friction coulomb --validate tuesday.nc
  flexaxis identify log.csv --torque current --angle phi --fix k_T=0.6 --fix f_l=0.01
  flexaxis identify rec.nc --model one_mass --friction coulomb --fix f_c=0.12
  flexaxis identify rec.nc --model my_axis.toml --free J_m --free k --json
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import check_not_input
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import say_problems, waiting
from flexaxis.experiments.logs.options import add_log_options, assignments, tables_of, treatment
from flexaxis.sim.errors import did_you_mean

if TYPE_CHECKING:
    from flexaxis.experiments.logs.axis_file import Axis
    from flexaxis.sim.record import Record

HELP = "identify the nominal values of your axis from a log"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG|REC.nc")
    parser.add_argument("--model", default="two_mass", metavar="MODEL", help="default: two_mass")
    parser.add_argument(
        "--free",
        action="append",
        default=[],
        metavar="PARAMETER",
        help="identify this, and no others",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="PARAMETER[=VALUE]",
        help="do not identify this; f_c, f_s … of --friction as well",
    )
    parser.add_argument(
        "--start", action="append", default=[], metavar="PARAMETER=VALUE", help="where to start"
    )
    parser.add_argument(
        "--delay", type=float, metavar="S", help="known delay of the torque [s]; default: find it"
    )
    parser.add_argument(
        "--friction",
        choices=("auto", "none", "coulomb", "lugre", "static"),
        default="auto",
        help="law of dry friction of the motor; default auto: none or Coulomb's, by simulation of "
        "held-out pieces",
    )
    parser.add_argument(
        "--gravity",
        choices=("auto", "none", "sine"),
        default="auto",
        help="a torque by sine and cosine of the angle; default auto: where the log shows it",
    )
    parser.add_argument(
        "--highpass", type=float, metavar="HZ",
        help="residuals below this do not count; default: found from the log",
    )  # fmt: skip
    parser.add_argument(
        "--validate",
        type=Path,
        metavar="OTHER.nc",
        help="try the result on a log that was not used: simulation and prediction",
    )
    add_output(parser, "AXIS.toml", "default: LOG-axis.toml")
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Identify, report and save."""
    from dataclasses import replace
    from functools import partial

    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.files import require_suffix, spare_foreign
    from flexaxis.experiments.logs.identification.identify import identify
    from flexaxis.experiments.logs.identification.validate import validate
    from flexaxis.experiments.logs.pages.identify_page import (
        content,
        identification_page,
        print_identification,
    )
    from flexaxis.experiments.logs.pages.page import write_page

    path = args.output or args.log.with_name(args.log.stem + "-axis.toml")
    report = path.with_suffix(".html")
    check_not_input((args.log, args.map, args.model, args.validate), path, report)
    require_suffix(path, ".toml", "an axis")
    spare_foreign(path, report)
    fixed, starts = assignments("fix", args.fix), assignments("start", args.start)
    if None in starts.values():
        raise LogError("--start takes NAME=VALUE")
    axis = find_axis(args.model)
    values = {name: v for name, v in (starts | fixed).items() if v is not None}
    own, given = _told(axis, values)
    axis = axis.having(own)
    if own.keys() & starts.keys():
        axis = replace(axis, known=True)
    record = _read(args.log, args)
    other = _read(args.validate, args) if args.validate else None
    with waiting(f"identifying {axis.model.name} from {args.log.name}"):
        found = identify(
            record,
            axis,
            free=args.free,
            fix=tuple(fixed),
            given=given,
            delay=args.delay,
            friction=args.friction,
            gravity=args.gravity,
            highpass=args.highpass,
        )
    tried = None if other is None else validate(other, found.axis)
    found.axis.save(path)
    title, command = f"{found.axis.model.name} from {args.log.name}", args.line
    write_page(identification_page(found, record.period, tried, title, command), report)
    status = 1 if found.warnings or (tried is not None and tried.unlike) else 0
    told = content(found, tried) | {"axis": path, "report": report}
    said = partial(print_identification, found, tried)
    return answer(args, told, status, path, report, show=said)


def _told(axis: Axis, values: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Return values of parameters that an axis has, and of those that a law of friction brings."""
    from flexaxis.experiments.logs.identification.identify import LAWFUL

    mine = axis.model.parameters
    for name in values:
        if name not in {*mine, *LAWFUL}:
            raise LogError(
                f"{axis.model.name} has no parameter {name!r}."
                f"{did_you_mean(name, [*mine, *LAWFUL])} It has {', '.join(mine)}; laws of "
                f"--friction have {', '.join(name for name in LAWFUL if name not in mine)}"
            )
    own = {name: value for name, value in values.items() if name in mine}
    return own, {name: value for name, value in values.items() if name not in own}


def _read(path: Path, args: argparse.Namespace) -> Record:
    """Return a log as a record, and say what is wrong with it but for what is done about it."""
    from flexaxis.experiments.logs.files import is_record
    from flexaxis.experiments.logs.importing import import_any

    tables = tables_of(args)
    if is_record(path) and not all(map(is_record, filter(None, (args.log, args.validate)))):
        tables = {}  # they are of the other one
    with waiting(f"reading {path.name}"):
        found = import_any(path, tables, **treatment(args))
    say_problems(path, found.checks, met=() if args.friction == "none" else ("dry friction",))
    return found.record
