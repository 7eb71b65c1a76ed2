"""Run an estimator on a record and save the estimates over time.

The estimator is told what an estimator may know: the nominal parameters and the period; the
parameters to identify and the output to read come from the record's scenario.

example:
  flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc
  flexaxis estimate rec.nc --estimator 'rpem-forgetting[forgetting=0.99, regularization=1.0]'
  flexaxis estimate rec.nc --estimator my_estimator.py:Mine        (runs the code in that file)
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.building.code import code_file
from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.progress import progress
from flexaxis.experiments.storage.files import spare

if TYPE_CHECKING:
    from flexaxis.experiments.running.estimate import Estimated

HELP = "run an estimator on a record and save the estimates (NetCDF-4)"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("record", type=Path, metavar="RECORD.nc")
    parser.add_argument(
        "--estimator", default="rpem-forgetting", metavar="E", help="default: rpem-forgetting"
    )
    parser.add_argument(
        "--scenario", metavar="SCENARIO", help="for a record that does not say its own"
    )
    add_output(parser, "FILE", "default: RECORD-estimates.nc")
    parser.add_argument(
        "--no-covariance",
        action="store_true",
        help="estimates only: several times faster on long records",
    )
    options.add_time_limit(parser)


def main(args: argparse.Namespace) -> int:
    """Estimate and save."""
    from flexaxis.experiments.building.estimator_text import parse
    from flexaxis.experiments.building.guest import limited
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.running.estimate import estimate

    path = args.output or args.record.with_name(args.record.stem + "-estimates.nc")
    spare((args.record, args.scenario, code_file(args.estimator)), path)
    spec = parse(args.estimator)
    scenario = find_scenario(args.scenario) if args.scenario else None
    what = f"estimating with {spec.text}"
    with limited(args.time_limit), progress(what, 1) as advance:
        found = estimate(
            args.record,
            spec,
            path,
            scenario=scenario,
            covariance=not args.no_covariance,
            advance=advance,
        )
    content = {"estimates": path, "estimator": spec.text, "samples": found.samples}
    content |= {"last": found.last, "truth": found.truth}
    return answer(args, content, 0, path, show=lambda: _print(found))


def _print(found: Estimated) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("parameter", "last estimate", "truth", "error [%]", box=None, pad_edge=False)
    for name, value in found.last.items():
        true = found.truth.get(name)
        known = ("", "") if true is None else (f"{true:.6g}", f"{100 * (value / true - 1):+.3f}")
        table.add_row(name, f"{value:.6g}", *known)
    Console().print(table)
