"""Identify the nominal values of an axis from its log, or from a record.

First the frequency response that the log shows, then output error with a model of the noise; the
delay of the torque as well, unless it is given. A log of one axis shows ratios to k_T only, so k_T
(and the gear ratio r) stay at their values unless freed. Status 1 if something speaks against the
result.

MODEL is one_mass, two_mass, three_mass, or a TOML of your own (docs/logs.md).

example:
  flexaxis identify rec.nc --model two_mass -o axis.toml
  flexaxis identify log.csv --torque current --angle phi --fix k_T=0.6 --fix f_l=0.01
  flexaxis identify rec.nc --model my_axis.toml --free J_m --free k --json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.logs.options import add_log_options, assignments, tables_of, treatment

if TYPE_CHECKING:
    from flexaxis.experiments.logs.identify import Identification

HELP = "identify the nominal values of your axis from a log"
GROUP = "your own axis"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", type=Path, metavar="LOG|REC.nc")
    parser.add_argument("--model", default="two_mass", metavar="MODEL", help="default: two_mass")
    parser.add_argument(
        "--free", action="append", default=[], metavar="NAME", help="identify this, and no others"
    )
    parser.add_argument(
        "--fix", action="append", default=[], metavar="NAME[=VALUE]", help="do not identify this"
    )
    parser.add_argument(
        "--start", action="append", default=[], metavar="NAME=VALUE", help="where to start"
    )
    parser.add_argument(
        "--delay", type=float, metavar="S", help="known delay of the torque [s]; default: find it"
    )
    parser.add_argument(
        "--white", action="store_true", help="plain output error, without a model of the noise"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="AXIS.toml", help="default: LOG-axis.toml"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Identify, report and save."""
    from dataclasses import replace

    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.errors import LogError
    from flexaxis.experiments.logs.identify import identify
    from flexaxis.experiments.logs.importing import read_any
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.outputs import spare

    path = args.output or args.log.with_name(args.log.stem + "-axis.toml")
    report = path.with_suffix(".html")
    spare((args.log, args.map, args.model), path, report)
    fixed, starts = assignments("fix", args.fix), assignments("start", args.start)
    if None in starts.values():
        raise LogError("--start takes NAME=VALUE")
    axis = find_axis(args.model)
    values = {name: v for name, v in (starts | fixed).items() if v is not None}
    axis = axis.having(values)
    if starts:
        axis = replace(axis, known=True)
    record = read_any(args.log, tables_of(args), **treatment(args))
    found = identify(
        record, axis, free=args.free, fix=tuple(fixed), delay=args.delay, whiten=not args.white
    )
    found.axis.save(path)
    _write_page(found, record.period, report, args)
    if args.json:
        print(dumps(_content(found) | {"axis": str(path), "report": str(report)}))
    else:
        _print(found)
        print(path)
        print(report)
    return 1 if found.warnings else 0


def _rows(found: Identification) -> list[tuple[str, float, float]]:
    rows = zip(found.names, found.theta.tolist(), found.deviations.tolist(), strict=True)
    return [*rows, ("delay", found.delay, found.delay_deviation)]


def _content(found: Identification) -> dict[str, object]:
    return {
        "estimates": {name: {"value": v, "sd": sd} for name, v, sd in _rows(found)},
        "fit": found.fit,
        "condition": found.result.condition,
        "identifiability": found.result.identifiability,
        "residual": {
            "std": found.axis.noise,
            "correlation": found.result.correlation,
            "noise_order": len(found.axis.whitening) - 1,
        },
        "warnings": list(found.warnings),
    }


def _facts(found: Identification) -> list[tuple[str, str]]:
    return [
        ("fit of a simulation from the torque alone", f"{found.fit:.1f} %"),
        ("order of the noise model", str(len(found.axis.whitening) - 1)),
        ("correlation of successive residuals", f"{found.result.correlation:.3f}"),
        ("condition", f"{found.result.condition:.3g}"),
        ("identifiability", found.result.identifiability),
    ]


def _print(found: Identification) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("parameter", "estimate", "± sd", "[%]", box=None, pad_edge=False)
    for name, value, sd in _rows(found):
        share = f"{100 * sd / abs(value):.2g}" if value else ""
        table.add_row(name, f"{value:.5g}", f"{sd:.2g}", share)
    console = Console()
    console.print(table)
    for name, text in _facts(found):
        print(f"{name}: {text}")
    for text in found.warnings:
        console.print(f"! {text}", style="yellow", markup=False)


def _write_page(found: Identification, period: float, path: Path, args: argparse.Namespace) -> None:
    from flexaxis.experiments.logs.log_figures import bode_figure
    from flexaxis.experiments.logs.log_page import LogPage, write_page
    from flexaxis.experiments.studies.benchmark import command_line

    rows = [(name, f"{value:.5g}", f"{sd:.2g}") for name, value, sd in _rows(found)]
    page = LogPage(
        title=f"{found.axis.model.name} from {args.log.name}",
        command=command_line(args.words),
        remarks=[("note", text) for text in found.warnings],
        tables=[
            ("Estimates", ("parameter", "estimate (SI)", "standard deviation"), rows),
            ("How far to trust them", ("", ""), _facts(found)),
        ],
        figures=[
            (
                "Frequency response",
                bode_figure(found, period),
                "Dots: what the log shows without a model. Where the line leaves them, the model "
                "does not describe the axis.",
            )
        ],
    )
    write_page(page, path)
