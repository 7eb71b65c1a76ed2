"""Run some cases of a run or a study again, chosen at random, and compare.

Rows that were made on this machine with these versions must be identical (but for `cost`); others
agree within 1e-6 of the value or 1e-9. The exit status is 1 if any does not. Rows that name code as
their estimator are refused, and the code shown; --run-code runs it.

example:
  flexaxis rerun results/friction --sample 20
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.building.code import add_run_code
from flexaxis.experiments.commands.answers import SEED, answer, at_most
from flexaxis.sim.errors import FlexaxisError

HELP = "run random cases of a run or a study again and compare"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="RUN")
    parser.add_argument(
        "--sample", type=at_most(10**6), default=10, metavar="N", help="cases (default: 10)"
    )
    parser.add_argument("--seed", type=at_most(SEED), default=0, help="of the choice (default: 0)")
    add_run_code(parser, "rows in RUN")


def main(args: argparse.Namespace) -> int:
    """Run again, compare, and name what differs."""
    from dataclasses import asdict

    from flexaxis.experiments.running.verify import verify

    if args.sample < 1:
        raise FlexaxisError(f"--sample {args.sample}: give the number of cases, 1 or more")
    command = args.line
    how = {"sample": args.sample, "seed": args.seed, "run_code": args.run_code}
    verdicts = list(verify(args.folder, command=command, **how))
    wrong = [verdict for verdict in verdicts if verdict.differences]
    cases = [asdict(verdict) for verdict in verdicts]
    lines = ["\n  ".join((f"{each.case} ({each.what}):", *each.differences)) for each in wrong]
    exact = sum(verdict.exact for verdict in verdicts)
    lines += [
        f"{len(verdicts) - len(wrong)} of {len(verdicts)} cases agree; {exact} had to be identical "
        f"(made on this machine with these versions), the others within the tolerance"
    ]
    return answer(args, {"cases": cases, "differ": len(wrong)}, int(bool(wrong)), *lines)
