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
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="default: RECORD-estimates.nc"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def main(args: argparse.Namespace) -> int:
    """Estimate and save."""
    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.catalogue import find_scenario
    from flexaxis.experiments.estimate import estimate
    from flexaxis.experiments.progress import progress
    from flexaxis.experiments.results import dumps
    from flexaxis.experiments.specs import parse
    from flexaxis.sim.record import load_record

    spec = parse(args.estimator)
    record = load_record(args.record)
    scenario = find_scenario(args.scenario) if args.scenario else None
    with progress(f"estimating with {spec.text}", len(record.time)) as advance:
        found = estimate(record, spec, scenario=scenario, advance=advance)
    path = args.output or args.record.with_name(args.record.stem + "-estimates.nc")
    found.save(path)
    truth = found.truth_at_end
    if args.json:
        last = dict(zip(found.names, found.theta[-1].tolist(), strict=True))
        print(dumps({"estimates": str(path), "estimator": spec.text, "last": last, "truth": truth}))
        return 0
    table = Table("parameter", "last estimate", "truth", "error [%]", box=None, pad_edge=False)
    for name, value in zip(found.names, found.theta[-1], strict=True):
        true = truth.get(name)
        error = "" if true is None else f"{100 * (value / true - 1):+.3f}"
        table.add_row(name, f"{value:.6g}", "" if true is None else f"{true:.6g}", error)
    Console().print(table)
    print(path)
    return 0
