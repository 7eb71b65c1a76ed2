r"""Sweep each estimator over its own knob and draw speed against variance, with the bound.

Any estimator can be made faster and noisier. Compared are whole curves, and lags where the standard
deviation is that of rpem-forgetting at its default (geometric mean over the estimated parameters,
before the fault). Writes tradeoff.json and tradeoff.svg.

example:
  flexaxis tradeoff fm_step-v1 kt_step-v1 --estimator rpem-forgetting --estimator relocate
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

HELP = "sweep estimators over their knobs: speed against variance, beside the bound"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="+", metavar="SCENARIO")
    parser.add_argument("--estimator", action="append", metavar="E", help="repeat for several")
    parser.add_argument("--seeds", default="16", metavar="N or A:B", help="default: 16")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/tradeoff"))
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def main(args: argparse.Namespace) -> int:
    """Sweep, match and draw."""
    import json

    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments import tradeoff
    from flexaxis.experiments.benchmark import command_line
    from flexaxis.experiments.cache import default_cache
    from flexaxis.experiments.catalogue import select
    from flexaxis.experiments.figures import svg
    from flexaxis.experiments.report import number
    from flexaxis.experiments.results import dumps, write_text, writing
    from flexaxis.experiments.seeds import parse_seeds

    scenarios, *_ = select(args.names)
    estimators = args.estimator or ["rpem-forgetting", "rpem-drift", "ekf", "relocate"]
    seeds = parse_seeds(args.seeds)
    points = tradeoff.sweep(scenarios, estimators, seeds, jobs=args.jobs, store=default_cache())
    table = tradeoff.matched(points)
    content = {
        "command": command_line(args.words),
        "seeds": seeds,
        "reference": tradeoff.with_knob(tradeoff.REFERENCE, 1.0),
        "points": points,
        "matched": table,
    }
    with writing(args.output):
        args.output.mkdir(parents=True, exist_ok=True)
    write_text(args.output / "tradeoff.json", json.dumps(content, allow_nan=False, indent=1) + "\n")
    write_text(args.output / "tradeoff.svg", svg(tradeoff.figure(points)))
    if args.json:
        print(dumps(content))
        return 0
    shown = Table(box=None, title="lag where std is that of the reference", title_justify="left")
    for heading in ("scenario", "estimator", "θ", "lag [s]", "bound [s]", "× bound", "own std"):
        shown.add_column(heading)
    for row in table:
        values = [number(row[key]) for key in ("lag", "bound", "over_bound", "own_ratio")]
        shown.add_row(row["scenario"], row["estimator"], row["parameter"], *values)
    Console().print(shown)
    print(args.output / "tradeoff.svg")
    return 0
