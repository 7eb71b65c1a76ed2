r"""Compare a candidate estimator with a base: better, worse, same within the margin, or undecided.

Both run on the same records. Scores are compared seed by seed, with a correction for the number of
scores; docs/gate.md explains the statistics. SUITE and SCENARIO as for `run` (default gate). Two
folders of finished runs are compared as they are, if their scenarios and versions agree.

exit status: 0 no regression, 1 regression, 2 wrong use, 3 undecided (with --strict)

example:
  flexaxis compare --base rpem-forgetting --candidate my_estimator.py:Mine
  flexaxis compare --base rpem-forgetting --candidate 'pipe:octave-cli -q my.m' fm_step-v1 \
                   --seeds 8 --max-seeds 64 --margin lag=5% std=5%
  flexaxis compare results/old results/new
  flexaxis compare --self-test
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexaxis.experiments.compare.gate import Comparison

HELP = "say whether an estimator got better or worse, with an exit status"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="*", metavar="SUITE|SCENARIO|RUN")
    parser.add_argument("--base", metavar="E", help="what to compare with")
    parser.add_argument("--candidate", metavar="E", help="what to judge")
    parser.add_argument(
        "--seeds", metavar="N or A:B", help="as for `run` (default: the suite's number)"
    )
    parser.add_argument(
        "--max-seeds", type=int, default=0, metavar="N", help="add seeds up to N while undecided"
    )
    parser.add_argument(
        "--margin",
        nargs="+",
        action="extend",
        default=[],
        metavar="SCORE=%",
        help="smaller changes do not matter (default lag=2%% std=2%%; others: t10, cross_talk)",
    )
    parser.add_argument("--strict", action="store_true", help="exit 3 if undecided")
    parser.add_argument(
        "--self-test", action="store_true", help="rate of false alarms and power of the gate"
    )
    parser.add_argument(
        "--comparisons", type=int, default=2000, metavar="N", help="of the self-test"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/compare"), metavar="DIR")
    parser.add_argument("--json", action="store_true", help="print JSON")


def main(args: argparse.Namespace) -> int:
    """Compare, report, and return the verdict as a status."""
    from flexaxis.experiments.compare.pairs import parse_margins
    from flexaxis.experiments.compare.stored import is_run
    from flexaxis.sim.errors import FlexaxisError

    margins = parse_margins(args.margin)
    if args.jobs < 1:
        raise FlexaxisError(f"--jobs {args.jobs}: give the number of processes, 1 or more")
    if args.self_test:
        return _self_test(args, margins)
    if len(args.names) == 2 and all(map(is_run, args.names)):
        return _stored(args, margins)
    if not (args.base and args.candidate):
        raise FlexaxisError(
            "say what to compare: --base E --candidate E, or two folders of finished runs"
        )
    return _fresh(args, margins)


def _fresh(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.benchmark import command_line
    from flexaxis.experiments.cache import default_cache
    from flexaxis.experiments.catalogue import find_scenario, select, suite_names
    from flexaxis.experiments.compare.gate import Question, compare
    from flexaxis.experiments.compare.report import write
    from flexaxis.experiments.progress import progress
    from flexaxis.experiments.seeds import parse_seeds

    names = args.names or ["gate"]
    scenarios, _, number, *_ = select(names)
    sources = {find_scenario(n).name: n for n in names if n not in suite_names()}
    question = Question(
        base=args.base,
        candidate=args.candidate,
        scenarios=scenarios,
        seeds=parse_seeds(args.seeds or str(number)),
        margins=margins,
        max_seeds=args.max_seeds,
    )
    most = len(question.looks()[-1]) * len(scenarios) * len({args.base, args.candidate})
    with progress(f"at most {most} cases", most) as advance:
        found = compare(
            question,
            jobs=args.jobs,
            store=default_cache(),
            advance=lambda done: advance(len(done.cases)),
        )
    command = command_line(args.words)
    path = write(args.output, found, scenarios, sources=sources, command=command)
    return _told(args, found, path, sources)


def _stored(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.compare.report import write
    from flexaxis.experiments.compare.stored import compare_runs
    from flexaxis.experiments.outputs import spare

    base, candidate = map(Path, args.names)
    spare(args.names, args.output)
    found = compare_runs(base, candidate, margins, estimators=(args.base, args.candidate))
    return _told(args, found, write(args.output, found), {})


def _told(args: argparse.Namespace, found: Comparison, path: Path, sources: dict[str, str]) -> int:
    from rich.console import Console

    from flexaxis.experiments.compare.report import headline, row_command, terminal_table, worst
    from flexaxis.experiments.results import dumps

    status = found.status(strict=args.strict)
    if args.json:
        print(dumps(found.as_dict() | {"status": status, "report": str(path)}))
        return status
    Console().print(terminal_table(found))
    print(f"\n{headline(found)}")
    if status == 1:
        print(f"look at the worst seed: {row_command(found, worst(found), sources)}")
    print(path)
    return status


def _self_test(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.cache import default_cache
    from flexaxis.experiments.catalogue import select
    from flexaxis.experiments.compare.selftest import BASE, PLANTED, self_test
    from flexaxis.experiments.progress import progress
    from flexaxis.experiments.results import dumps
    from flexaxis.experiments.seeds import parse_seeds
    from flexaxis.sim.errors import FlexaxisError

    if args.comparisons < 1:
        raise FlexaxisError(f"--comparisons {args.comparisons}: give 1 or more")
    scenarios, _, number, *_ = select(args.names or ["gate"])
    planted = (args.candidate or PLANTED,)
    with progress("self-test", 3 * 64 * len(scenarios)) as advance:
        found = self_test(
            scenarios,
            parse_seeds(args.seeds or str(number)),
            margins,
            base=args.base or BASE,
            planted=planted,
            comparisons=args.comparisons,
            jobs=args.jobs,
            store=default_cache(),
            advance=lambda done: advance(len(done.cases)),
        )
    if args.json:
        print(dumps([rates.as_dict() for rates in found]))
        return int(not all(rates.kept for rates in found))
    for rates in found:
        what = "a change is found" if rates.planted else "false alarms"
        low, high = (100 * end for end in rates.interval)
        print(
            f"{rates.candidate}: {what}: called worse in {rates.worse} of {rates.comparisons} "
            f"comparisons, {100 * rates.rate:.2f} % (95 %: {low:.2f} … {high:.2f} %), better "
            f"somewhere in {rates.better}; {'as promised' if rates.kept else 'PROMISE BROKEN'}"
        )
        for name, share in sorted(rates.rows.items(), key=lambda item: -item[1]):
            print(f"  worse in {100 * share:5.1f} %: {name}")
    return int(not all(rates.kept for rates in found))
