r"""Run estimators on scenarios over many seeds, score them, and write a report.

SUITE and SCENARIO are names of `flexaxis list`, or paths to TOML files. Without --estimator the
suite's estimators run (those of `smoke` where only scenarios are named). The folder gets
scores.sqlite (a row for each scenario, estimator, seed, parameter), summary.json and report.html.
An estimator given as path/file.py:Class, package.module:Class or entry point is code that is run.

Simulated records are kept (see `fx.cache`), so that another estimator on the same scenarios
and seeds simulates nothing. Rows are added to DIR as they come, and what it holds is kept and not
run again: after Ctrl-C, a kill or a full disk the same line runs what is missing. The report and
summary.json are of what the line asks for; --overwrite removes what DIR holds first. A case that
cannot be run is a row that says why, and the others go on; the exit status is then 1, or 70 if code
crashed.

example:
  flexaxis run smoke
  flexaxis run fm_step-v1 kt_step-v1 --estimator rpem-forgetting \
           --estimator 'rpem-forgetting[forgetting=0.99]' --seeds 30 -o results/lambda
  flexaxis run mine.toml --estimator my_estimator.py:Mine --seeds 0:20
  flexaxis run --from shard1 shard2 -o results/whole
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer, say
from flexaxis.experiments.files import REPORT, check_not_input
from flexaxis.experiments.running.progress import remark
from flexaxis.experiments.seeds import parse_seeds
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.catalogue.find import Selection
    from flexaxis.experiments.running.results import Results
    from flexaxis.experiments.running.run import Runner

HELP = "run estimators on scenarios, score them, write a report"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="*", metavar="SUITE|SCENARIO")
    parser.add_argument("--estimator", action="append", metavar="E", help="repeat for several")
    parser.add_argument(
        "--seeds",
        metavar="N or A:B",
        help="N seeds from 1000 on, or those from A to B-1 (default: the suite's number); "
        "0 to 99 are meant for tuning, 1000 to 4999 for reporting",
    )
    options.add_engine(parser)
    options.add_from(parser)
    add_output(parser, "DIR", "default: results/FIRST_NAME")
    options.add_cache(parser, default=True)


def main(args: argparse.Namespace) -> int:
    """Run, score and report."""
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.studies.benchmark import benchmark

    if args.shards:
        return options.merge_shards(args)
    if not args.names:
        raise FlexaxisError("name a suite or a scenario, such as smoke; `flexaxis list` shows them")
    shard, folder = options.shard(args), args.output or Path("results") / Path(args.names[0]).stem
    check_not_input(args.names, folder)
    chosen = select(args.names)
    total = _most(args, chosen)
    about = f"{total} case{'s'[: total != 1]}"
    with options.working(args, about, total, folder, cache=args.cache) as (runner, _):
        work = wanted(args, chosen, runner)
        results = benchmark(work, runner, shard=shard, say=lambda text: _say(total, text))
    remark(f"{runner.simulated} record{'s'[: runner.simulated != 1]} simulated")
    if shard != (1, 1):
        return _of_shard(args, folder, results)
    return _answer(args, folder, results.summary)


def _say(cases: int, text: str) -> None:
    if cases > 2000:  # else it is a matter of a few seconds
        remark(text)


def _most(args: argparse.Namespace, chosen: Selection) -> int:
    """Return how many cases there are, the settings of a sweep included."""
    from flexaxis.experiments.comparison import sweep

    estimators = args.estimator or chosen.estimators
    swept = sweep.texts(sweep.settings(_swept(args, chosen)))
    plain = len(chosen.scenarios) * len(estimators)
    seeds = len(parse_seeds(args.seeds or str(chosen.seeds)))
    return (plain + len(chosen.swept_scenarios) * len(swept)) * seeds


def _swept(args: argparse.Namespace, chosen: Selection) -> Sequence[str]:
    from flexaxis.experiments.comparison.ranking import REFERENCE

    return (
        list(dict.fromkeys([REFERENCE, *args.estimator]))
        if args.estimator
        else (chosen.swept_estimators)
    )


def wanted(args: argparse.Namespace, chosen: Selection, runner: Runner) -> Any:
    """Return what is to be run, without the scenarios that a named estimator cannot read."""
    from flexaxis.experiments.running.study import Study
    from flexaxis.experiments.studies.benchmark import Benchmark

    every = {s.name: s for s in [*chosen.scenarios, *chosen.swept_scenarios]}
    left = runner.misfits(list(every.values()), args.estimator) if args.estimator else {}
    if all(s.name in left for s in chosen.scenarios):
        left = {}  # running them will say why
    for name, reason in left.items():
        say(f"{name} is left out: {reason}")
    title = " ".join(args.names)
    return Benchmark(
        study=Study(
            name=title,
            scenarios=tuple(s for s in chosen.scenarios if s.name not in left),
            estimators=tuple(dict.fromkeys(args.estimator or chosen.estimators)),
            seeds=tuple(parse_seeds(args.seeds or str(chosen.seeds))),
        ),
        title=title,
        command=options.line(args, whole=True),
        swept_scenarios=[s for s in chosen.swept_scenarios if s.name not in left],
        swept_estimators=_swept(args, chosen),
    )


def _of_shard(args: argparse.Namespace, folder: Path, results: Results) -> int:
    """Print what became of a shard; the report is of all of them, by `run --from`."""
    failures = results.failures.to_dict("records")
    options.tell_failures(failures)
    content = {"folder": str(folder), "shard": args.shard, "failed": len(failures)}
    return answer(args, content, options.failed(failures, args.remarks), folder)


def _answer(args: argparse.Namespace, folder: Path, summary: dict[str, Any]) -> int:
    """Print the scores; cases that failed are a finding or a crash."""
    from flexaxis.experiments.reporting.terminal import show_run

    failures = summary["failures"]
    status = options.failed(failures, args.remarks)
    if not args.json:
        show_run(summary)
    options.tell_failures(failures)
    path = folder / REPORT
    return answer(args, summary | {"report": path}, status, f"report: {path}")
