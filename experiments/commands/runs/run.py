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
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.progress import remark
from flexaxis.experiments.running.seeds import parse_seeds
from flexaxis.experiments.storage.files import REPORT, spare
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.catalogue.find import Selection

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
    from flexaxis.experiments.studies.benchmark import benchmark

    if args.shards:
        return options.merge_shards(args)
    if not args.names:
        raise FlexaxisError("name a suite or a scenario, such as smoke; `flexaxis list` shows them")
    work, share = wanted(args, args.names), options.shard(args)
    folder = args.output or Path("results") / Path(args.names[0]).stem
    spare(args.names, folder)
    with ExitStack() as stack:
        place = options.executor(args, stack)
        about = f"{work.cases} case{'s'[: work.cases != 1]}"
        working = options.working(args, about, work.cases, cache=args.cache, place=place)
        simulated = 0

        def landed(outcome: Any) -> None:
            nonlocal simulated
            simulated += outcome.simulated

        with working as (means, _):
            found = benchmark(
                work, folder, means.also(landed), shard=share, overwrite=args.overwrite,
                say=lambda text: _say(work, text),
            )  # fmt: skip
    remark(f"{simulated} record{'s'[: simulated != 1]} simulated")
    if found is None:
        return _share_told(args, folder, share)
    return _told(args, folder, found)


def _say(work: Any, text: str) -> None:

    if work.cases > 2000:  # else it is a matter of a few seconds
        remark(text)


def wanted(args: argparse.Namespace, names: Sequence[str]) -> Any:
    """Return what is to be run: the benchmark of some names, with `estimator` and `seeds`."""
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.comparison.ranking import REFERENCE
    from flexaxis.experiments.running.study import Study
    from flexaxis.experiments.studies.benchmark import Benchmark

    chosen = select(names)
    estimators = list(dict.fromkeys(args.estimator or chosen.estimators))
    swept = list(dict.fromkeys([REFERENCE, *estimators]))
    readable = _readable(chosen, args.estimator or ())
    title = " ".join(names)
    return Benchmark(
        study=Study(
            name=title,
            scenarios=tuple(s for s in chosen.scenarios if s.name in readable),
            estimators=tuple(estimators),
            seeds=tuple(parse_seeds(args.seeds or str(chosen.seeds))),
        ),
        title=title,
        command=options.line(args, whole=True),
        swept_scenarios=[s for s in chosen.swept_scenarios if s.name in readable],
        swept_estimators=swept if args.estimator else chosen.swept_estimators,
    )


def _readable(chosen: Selection, estimators: Sequence[str]) -> set[str]:
    """Return the names of the scenarios that all estimators can read which were typed.

    Those of a suite read whatever it has. Where nothing is left to run, all are, so that it is
    told why they cannot be.
    """
    both = {s.name: s for s in [*chosen.scenarios, *chosen.swept_scenarios]}
    if not estimators:
        return set(both)
    kept = {s.name for s in options.leave_out(list(both.values()), estimators)}
    return kept if kept & {s.name for s in chosen.scenarios} else set(both)


def _share_told(args: argparse.Namespace, folder: Path, share: tuple[int, int]) -> int:
    """Print what became of a share; the report is of all of them, by `run --from`."""
    from flexaxis.experiments.results.results import Results

    failures = Results.load(folder).failures()
    options.tell_failures(failures)
    told = {"folder": str(folder), "shard": "/".join(map(str, share)), "failed": len(failures)}
    status = options.failed(failures, args.remarks)
    return answer(args, told, status, folder)


def _told(args: argparse.Namespace, folder: Path, found: Any) -> int:
    """Print what was found; what could not be run is said, and is a finding or a crash."""
    from flexaxis.experiments.reporting.terminal import show_run

    failures = found.summary["failures"]
    status = options.failed(failures, args.remarks)
    if not args.json:
        show_run(found.summary)
    options.tell_failures(failures)
    path = folder / REPORT
    return answer(args, found.summary | {"report": path}, status, path)
