"""Make a record of a robot's own log, and report whether it is plausible.

LOG is CSV, MAT (all versions), HDF5 or NetCDF. The report says what to doubt before any estimator
runs: time stamps, gaps, clipping, resolution, dead time, band of the excitation, and, with
--model, which parameters that excitation can see.

example:
  flexaxis import log.csv --torque current --angle motor_pos --unit angle=deg -o rec.nc
  flexaxis import bench.mat --map bench.toml --highpass 5 --model two_mass -o rec.nc
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from flexaxis.experiments.logs.options import add_log_options, tables_of, treatment

HELP = "make a record of your own log, with a plausibility report"
GROUP = "your own axis"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="REC.nc", help="default: LOG.nc, or LOG-imported.nc"
    )
    parser.add_argument(
        "--model", metavar="MODEL", help="say which of its parameters the excitation can see"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Import, report and save."""
    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.importing import import_log
    from flexaxis.experiments.logs.log_figures import log_figure, visibility_figure
    from flexaxis.experiments.logs.log_page import LogPage, write_page
    from flexaxis.experiments.logs.visibility import expected_deviations
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.studies.benchmark import command_line

    path = args.output or _beside(args.log)
    report = path.with_suffix(".html")
    spare((args.log, args.map, args.model), path, report)
    axis = find_axis(args.model) if args.model else None
    found = import_log(args.log, tables_of(args), **treatment(args))
    seen = expected_deviations(found.record, axis) if axis else {}
    found.record.save(path)
    rows = [
        (c.name, "" if c.value is None else f"{c.value:.4g} {c.unit}", c.verdict, c.text)
        for c in found.checks
    ]
    figures = [("The log", log_figure(found.record), "")]
    if seen:
        figures.append(
            (
                "What the excitation can see",
                visibility_figure(seen),
                "From the spectrum of the torque alone; orange is not seen.",
            )
        )
    page = LogPage(
        title=f"Import of {args.log.name}",
        command=command_line(args.words),
        remarks=[(c.verdict, f"{c.name}: {c.text}") for c in found.checks if c.verdict != "ok"],
        tables=[("Plausibility", ("", "measured", "", ""), rows)],
        figures=figures,
    )
    write_page(page, report)
    if args.json:
        checks = [check.told() for check in found.checks]
        print(dumps({"record": str(path), "checks": checks, "seen": seen, "report": str(report)}))
        return 0
    _print(rows, seen)
    print(path)
    print(report)
    return 0


def _beside(log: Path) -> Path:
    """Return where the record of a log goes by default: next to it, and never over it."""
    from flexaxis.experiments.running.outputs import same

    path = log.with_suffix(".nc")
    return log.with_name(f"{log.stem}-imported.nc") if same(path, log) else path


def _print(rows: Sequence[tuple[str, str, str, str]], seen: dict[str, float]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, show_header=False)
    for name, value, verdict, text in rows:
        style = {"ok": None, "note": "yellow", "problem": "red"}[verdict]
        mark = {"ok": "✓", "note": "!", "problem": "✗"}[verdict]
        table.add_row(mark, name, value, text, style=style)
    Console().print(table)
    for name, deviation in seen.items():
        text = "seen" if deviation < 0.5 else "NOT seen by this excitation"
        print(f"  {name}: ±{100 * deviation:.2g} % were all others known: {text}")
