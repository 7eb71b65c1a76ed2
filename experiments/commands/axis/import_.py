"""Make a record of a robot's own log, and report whether it is plausible.

LOG is a table of text, MAT (all versions), HDF5, NetCDF or parquet. The report says what to doubt
before any estimator runs, and what to type against it: time stamps and gaps, wrapping, clipping,
clocks, units, outliers, the kind of torque, signs, dry friction.

example:
  flexaxis import log.csv --torque current --angle motor_pos --unit angle=deg -o rec.nc
  flexaxis import bench.mat --map bench.toml -o rec.nc
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import check_not_input
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import MARKS, lightened, ordered, waiting
from flexaxis.experiments.logs.options import add_log_options, tables_of, treatment

if TYPE_CHECKING:
    from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import Finding

HELP = "make a record of your own log, with a plausibility report"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG")
    add_output(parser, "REC.nc", "default: LOG.nc, or LOG-imported.nc")
    parser.add_argument(
        "--strict", action="store_true", help="status 1 if something spoils the estimates (✗)"
    )
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Import, report and save."""
    from dataclasses import replace

    from flexaxis.experiments.logs.files import (
        is_record,
        record_beside,
        require_suffix,
        spare_foreign,
    )
    from flexaxis.experiments.logs.importing import import_log
    from flexaxis.experiments.logs.pages.import_page import import_page
    from flexaxis.experiments.logs.pages.page import write_page

    path = args.output or record_beside(args.log)
    report = path.with_suffix(".html")
    check_not_input((args.log, args.map), path, report)
    require_suffix(path, ".nc", "a record")
    spare_foreign(path, report)
    if is_record(args.log):
        raise LogError(
            f"{args.log}: is a record that flexaxis wrote, and needs no import: go on with "
            f"flexaxis identify {args.log}"
        )
    with waiting(f"importing {args.log.name}"):
        found = import_log(args.log, tables_of(args), **treatment(args))
    # every axis has it, and identify looks for it
    found = replace(found, checks=lightened(found.checks, {"dry friction"}))
    found.record.save(path)
    write_page(import_page(found, args.log, args.line), report)
    status = int(args.strict and any(check.kind == "problem" for check in found.checks))
    checks = [check.told() for check in found.checks]
    told = {"record": path, "checks": checks, "report": report}
    return answer(args, told, status, path, report, show=lambda: _print(found.checks))


def _print(checks: Sequence[Finding]) -> None:
    """Print what was looked at, what spoils the estimates first."""
    from textwrap import fill

    from rich.console import Console

    console = Console()
    style = {"problem": "red", "note": "yellow", "ok": None}
    for check in ordered(checks):
        measured = check.measured.strip()
        lines = [f"{MARKS[check.kind]} {check.name}: {measured}".rstrip(": ")]
        if check.kind == "ok":
            lines[0] += f" ({check.text})" if measured else f": {check.text}"
        else:
            lines += [f"  {check.text}", *([f"  → {check.command}"] if check.command else [])]
        for line in lines:
            text = fill(line, console.width, subsequent_indent="  ", break_long_words=False)
            console.print(text, style=style[check.kind], markup=False, highlight=False)
