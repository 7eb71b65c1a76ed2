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
from collections.abc import Mapping
from pathlib import Path

from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import check_not_input

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


def main(args: argparse.Namespace) -> int:
    """Estimate and save."""
    import flexaxis as fx
    from flexaxis.experiments.running.user_code import code_file

    path = args.output or args.record.with_name(args.record.stem + "-estimates.nc")
    check_not_input((args.record, args.scenario, code_file(args.estimator)), path)
    estimate = fx.estimate(args.record, args.estimator, scenario=args.scenario)
    estimate.save(path, covariance=not args.no_covariance)
    truth = {name: float(values[-1]) for name, values in estimate.truth.items()}
    content = {"estimates": path, "estimator": args.estimator, "samples": len(estimate.theta)}
    content |= {"last": estimate.last, "truth": truth}
    return answer(args, content, 0, path, show=lambda: _print(estimate.last, truth))


def _print(last: Mapping[str, float], truth: Mapping[str, float]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("parameter", "last estimate", "truth", "error [%]", box=None, pad_edge=False)
    for name, value in last.items():
        true = truth.get(name)
        known = ("", "") if true is None else (f"{true:.6g}", f"{100 * (value / true - 1):+.3f}")
        table.add_row(name, f"{value:.6g}", *known)
    Console().print(table)
