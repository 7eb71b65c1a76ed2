"""Make a record of a robot's own log, and report whether it is plausible.

LOG is a table of text, MAT (all versions), HDF5, NetCDF or parquet. The report says what to doubt
before any estimator runs, and what to type against it: time stamps and gaps, wrapping, clipping,
clocks, units, outliers, the kind of torque, dead time and signs, dry friction; and, with --model,
which parameters that excitation can see. A record that flexaxis wrote is imported already: it is
looked at as it is, and takes --burn-in.

example:
  flexaxis import log.csv --torque current --angle motor_pos --unit angle=deg -o rec.nc
  flexaxis import bench.mat --map bench.toml --model two_mass -o rec.nc
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import add_json, add_output, answer
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import MARKS, ordered, waiting
from flexaxis.experiments.logs.options import add_log_options, tables_of, treatment
from flexaxis.experiments.storage.files import spare

if TYPE_CHECKING:
    from flexaxis.experiments.logs.axis_file import Axis
    from flexaxis.experiments.logs.findings import Finding
    from flexaxis.experiments.logs.identification.visibility import Seen
    from flexaxis.sim.record import Record

HELP = "make a record of your own log, with a plausibility report"
GROUP = "your own axis"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG")
    add_output(parser, "REC.nc", "default: LOG.nc, or LOG-imported.nc")
    parser.add_argument(
        "--model", metavar="MODEL", help="say which of its parameters the excitation can see"
    )
    parser.add_argument(
        "--strict", action="store_true", help="status 1 if something spoils the estimates (✗)"
    )
    add_json(parser)
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Import, report and save."""
    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.doubts import doubts_of
    from flexaxis.experiments.logs.files import (
        is_record,
        record_beside,
        require_suffix,
        spare_foreign,
    )
    from flexaxis.experiments.logs.importing import Imported, import_any, import_log
    from flexaxis.experiments.logs.pages.import_page import import_page
    from flexaxis.experiments.logs.pages.page import write_page

    path = args.output or record_beside(args.log)
    report = path.with_suffix(".html")
    spare((args.log, args.map, args.model), path, report)
    require_suffix(path, ".nc", "a record")
    spare_foreign(path, report)
    axis = find_axis(args.model) if args.model else None
    already, tables, treated = is_record(args.log), tables_of(args), treatment(args)
    with waiting(f"importing {args.log.name}"):
        found = (import_any if already else import_log)(args.log, tables, **treated)
        if already:
            found = Imported(found.record, doubts_of(found.record))
        seen, hidden = _visible(found.record, axis) if axis else ({}, "")
    same = already and not (args.output or tables or any(v is not None for v in treated.values()))
    record = args.log if same else path
    if not same:
        found.record.save(path)
    write_page(import_page(found, seen, args.log, args.line), report)
    status = int(args.strict and any(check.kind == "problem" for check in found.checks))
    if args.json:
        checks = [check.told() for check in found.checks]
        told = {name: vars(one) for name, one in seen.items()}
        content = {"record": record, "checks": checks, "seen": told, "hidden": hidden}
        return answer(args, content | {"report": report}, status)
    _print(found.checks, seen)
    if hidden:
        print(f"what the excitation can see is not known: {hidden}")
    if already:
        print(f"{args.log} is a record already: go on with flexaxis identify {record}")
    print(record)
    print(report)
    return status


def _visible(record: Record, axis: Axis) -> tuple[dict[str, Seen], str]:
    """Return what can be seen of an axis, or why that is not known: the record is good without."""
    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.experiments.logs.identification.visibility import visible

    try:
        return visible(record, axis), ""
    except (LogError, EstimatorError) as error:
        return {}, str(error)


def _print(checks: Sequence[Finding], seen: Mapping[str, Seen]) -> None:
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
    alike: dict[str, list[str]] = {}
    for name, one in seen.items():
        alike.setdefault(one.words, []).append(name)
    for words, names in alike.items():
        print(f"  {', '.join(names)}: {words}")
