r"""Run estimators on scenarios over many seeds, score them, and write a report.

SUITE and SCENARIO are names of `flexaxis list`, or paths to TOML files. Without --estimator the
suite's estimators run (those of `smoke` where only scenarios are named). The folder gets
scores.jsonl (one row per scenario, estimator, seed and parameter), summary.json, curves.nc and
report.html. An estimator given as path/file.py:Class, package.module:Class or entry point is code
that is run.

Simulated records are kept (`flexaxis cache info`), so that another estimator on the same scenarios
and seeds simulates nothing.

example:
  flexaxis run smoke
  flexaxis run fm_step-v1 kt_step-v1 --estimator rpem-forgetting \
           --estimator 'rpem-forgetting[forgetting=0.99]' --seeds 30 -o results/lambda
  flexaxis run mine.toml --estimator my_estimator.py:Mine --seeds 0:20
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

HELP = "run estimators on scenarios, score them, write a report"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="+", metavar="SUITE|SCENARIO")
    parser.add_argument("--estimator", action="append", metavar="E", help="repeat for several")
    parser.add_argument(
        "--seeds",
        metavar="N or A:B",
        help="N seeds from 1000 on, or those from A to B-1 (default: the suite's number); "
        "0 to 99 are meant for tuning, 1000 to 4999 for reporting",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one a core); the scores do not depend on it",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="default: results/FIRST_NAME"
    )
    parser.add_argument(
        "--no-cache", action="store_true", help="simulate every record, and keep none"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def main(args: argparse.Namespace) -> int:
    """Run, score and report."""
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.reporting.terminal import score_table, show
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.files import REPORT, dumps
    from flexaxis.experiments.running.harness import Done
    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.running.seeds import parse_seeds
    from flexaxis.experiments.scoring.ranking import REFERENCE
    from flexaxis.experiments.studies.benchmark import Plan, benchmark, command_line
    from flexaxis.sim.errors import FlexaxisError

    if args.jobs < 1:
        raise FlexaxisError(f"--jobs {args.jobs}: give the number of processes, 1 or more")
    chosen = select(args.names)
    estimators = list(dict.fromkeys(args.estimator or chosen.estimators))
    swept = list(dict.fromkeys([REFERENCE, *estimators]))
    plan = Plan(
        title=" ".join(args.names),
        scenarios=chosen.scenarios,
        estimators=estimators,
        seeds=parse_seeds(args.seeds or str(chosen.seeds)),
        command=command_line(args.words),
        swept_scenarios=chosen.swept_scenarios,
        swept_estimators=swept if args.estimator else chosen.swept_estimators,
    )
    folder = args.output or Path("results") / Path(args.names[0]).stem
    store = None if args.no_cache else default_cache()
    simulated = 0
    with progress(f"{plan.cases} cases", plan.cases) as advance:

        def done(task: Done) -> None:
            nonlocal simulated
            simulated += task.simulated
            advance(len(task.cases))

        def say(text: str) -> None:
            if plan.cases > 2000:  # else it is a matter of a few seconds
                print(text, file=sys.stderr)

        found = benchmark(plan, folder, jobs=args.jobs, store=store, advance=done, say=say)
    records = len({s.hash for s in [*plan.scenarios, *plan.swept_scenarios]}) * len(plan.seeds)
    print(f"{records} records: {simulated} simulated, the others from the cache", file=sys.stderr)
    if args.json:
        print(dumps(found.summary | {"report": str(folder / REPORT)}))
    else:
        show(score_table(found.summary["rows"]))
        print(folder / REPORT)
    return 0
