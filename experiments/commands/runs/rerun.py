"""Run some cases of a run or a study again, chosen at random, and compare.

Every number of a row must be the same, except `cost`; the exit status is 1 if one is not. Code that
the rows name as their estimators is run: rerun only what you trust.

example:
  flexaxis rerun results/friction --sample 20
"""

from __future__ import annotations

import argparse
from pathlib import Path

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


def main(args: argparse.Namespace) -> int:
    """Run again, compare, and name what differs."""
    from flexaxis.experiments.running.results import Results, rerun
    from flexaxis.experiments.running.run import Runner

    if args.sample < 1:
        raise FlexaxisError(f"--sample {args.sample}: give the number of cases, 1 or more")
    results = Results.load(args.folder, whole=True)
    with Runner() as runner:
        differ = rerun(results, args.sample, runner, seed=args.seed)
    number, wrong = min(args.sample, results.cases), len(differ.index.unique("case"))
    names = results.frame.drop_duplicates("case").set_index("case")
    lines = []
    for (case, parameter, column), line in differ.iterrows():
        run = ", ".join(map(str, names.loc[case, ["scenario", "setting", "seed"]]))
        values = f"was {line['before']} and is {line['now']}"
        lines.append(f"{run}, {parameter}: {column} {values}")
    lines += [f"{number - wrong} of {number} cases agree"]
    content = {"cases": number, "differ": wrong, "differences": lines[:-1]}
    return answer(args, content, int(bool(wrong)), *lines)
