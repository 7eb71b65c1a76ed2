"""Run an estimator over the log of a real axis: estimates, residuals, changes, alarms.

AXIS.toml is what `flexaxis identify` wrote. The estimates go to a NetCDF file, and a report says
which parameter changed and when. Where the log has a load angle, it is predicted from the motor
angle and compared. Status 1 if a change was found, or if the log does not fit the axis: another
unit or sign, or another axis.

example:
  flexaxis track rec.nc --model axis.toml --identify k_T --identify 1/J_l --identify k
  flexaxis track rec.nc --model axis.toml --identify k --estimator rpem-forgetting[forgetting=.999]
  flexaxis track rec.nc --model axis.toml --identify f_m --estimator glr
  flexaxis track rec.nc --model axis.toml --identify k_T --start 1.2 --json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import check_not_input
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import problems_of, say_problems, show, tell, waiting
from flexaxis.experiments.logs.options import add_log_options, tables_of, treatment

if TYPE_CHECKING:
    from flexaxis.experiments.logs.track import Tracked

HELP = "run an estimator on a log of your axis"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG|REC.nc")
    parser.add_argument("--model", required=True, metavar="AXIS.toml", help="from identify")
    parser.add_argument(
        "--identify",
        action="append",
        required=True,
        metavar="PARAMETER",
        help="parameter to track, or its inverse, such as 1/J_l; several: 1/J_l,k, or repeat it",
    )
    parser.add_argument(
        "--estimator",
        metavar="E",
        help="default: ekf, or glr where the axis has laws",
    )
    parser.add_argument(
        "--start", type=float, default=1.0, metavar="F", help="θ(0) over nominal; default 1"
    )
    add_output(parser, "EST.nc", "default: LOG-track.nc")
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Track, report and save."""
    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.files import require_suffix, spare_foreign
    from flexaxis.experiments.logs.importing import import_any
    from flexaxis.experiments.logs.pages.page import write_page
    from flexaxis.experiments.logs.pages.track_page import content, track_page
    from flexaxis.experiments.logs.track import (
        default_estimator,
        save,
        track,
    )
    from flexaxis.experiments.running.estimators import parse
    from flexaxis.experiments.running.user_code import code_file

    path = args.output or args.log.with_name(args.log.stem + "-track.nc")
    report = path.with_suffix(".html")
    check_not_input((args.log, args.map, args.model, code_file(args.estimator or "")), path, report)
    require_suffix(path, ".nc", "a file of estimates")
    spare_foreign(path, report)
    if not args.start > 0:
        raise LogError(f"--start {args.start}: give a factor above 0")
    axis = find_axis(args.model)
    with waiting(f"reading {args.log.name}"):
        log = import_any(args.log, tables_of(args), **treatment(args))
    met = {"dry friction"} if axis.model.laws else set()
    say_problems(args.log, log.checks, met=met)
    record = log.record
    names = list(dict.fromkeys(name for text in args.identify for name in text.split(",")))
    spec = parse(args.estimator or default_estimator(axis))
    with waiting(f"tracking {', '.join(names)}"):
        found = track(record, axis, spec, identify=names, start=args.start)
    save(found, path, estimator=spec.text)
    problems = problems_of(log.checks, met=met)
    page = track_page(
        found,
        record.period,
        spec.text,
        problems=problems,
        log=args.log.name,
        command=args.line,
    )
    write_page(page, report)
    status = 1 if found.changes or found.doubts else 0
    told = content(found) | {"estimates": path, "report": report}
    return answer(args, told, status, path, report, show=lambda: _print(found))


def _print(found: Tracked) -> None:
    from flexaxis.experiments.logs.pages.track_page import estimates_of, findings

    show(("parameter", "last estimate", "nominal", "over nominal"), estimates_of(found))
    tell(findings(found))
