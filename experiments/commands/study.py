r"""Run a study: sweep keys of scenarios, faults and estimators over many seeds.

FILE.toml names scenarios, estimators and seeds, and the axes; docs/studies.md has every key:

  scenario = "fm_step-v1"
  estimators = ["rpem-forgetting", "relocate"]
  seeds = 60
  [sweep]
  "fault[0].factor" = [1.1, 1.5, 2.0, 3.0]      # a key of the scenario, of its faults too
  "rpem-forgetting.forgetting" = [0.99, 0.995]  # an option of one estimator ("estimator.X": of all)

The plan is printed first. Rows are appended to the folder as they come, and --resume runs only what
is missing there, after a kill or after estimators, seeds or values were added to the file. A case
that cannot be run is a row that says why; the exit status is then 1. The folder gets report.html.

A file that names code (path.py:Class, module:Class, pipe:COMMAND) is refused, and the code shown;
--run-code runs it. A dry run never does.

example:
  flexaxis study docs/examples/friction_steps.toml --dry-run
  flexaxis study docs/examples/friction_steps.toml -o results/friction --jobs 4
  flexaxis study docs/examples/friction_steps.toml -o results/friction --resume
  flexaxis study docs/examples/friction_steps.toml -o /net/friction --shard 3/100
"""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.running.consent import add_run_code

if TYPE_CHECKING:
    from flexaxis.experiments.running.plan import Plan

HELP = "sweep scenarios, faults and estimators over many seeds, resumable"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, metavar="FILE.toml")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: results/NAME")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one a core); the rows do not depend on it",
    )
    where.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster that runs")
    parser.add_argument(
        "--shard", metavar="I/N", help="run only the I-th of N shares, to a file of rows of its own"
    )
    parser.add_argument("--resume", action="store_true", help="run what is missing in DIR")
    parser.add_argument("--dry-run", action="store_true", help="print the plan, and stop")
    parser.add_argument(
        "--keep",
        choices=("none", "worst", "all"),
        default="none",
        help="whose estimates to write to DIR/trajectories (default: none)",
    )
    parser.add_argument(
        "--cache",
        action="store_true",
        help="keep simulated records (`flexaxis cache info`), for studies of the same records",
    )
    add_run_code(parser, "estimators of FILE.toml")
    parser.add_argument("--json", action="store_true", help="print what was done as JSON")


def main(args: argparse.Namespace) -> int:
    """Plan, run and report."""
    from flexaxis.experiments.running import rows
    from flexaxis.experiments.running.consent import require
    from flexaxis.experiments.running.folder import REPORT, STUDY, check
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.running.plan import make_plan
    from flexaxis.experiments.studies.benchmark import command_line
    from flexaxis.experiments.studies.definition import load_study
    from flexaxis.sim.errors import FlexaxisError

    if args.jobs < 1:
        raise FlexaxisError(f"--jobs {args.jobs}: give the number of processes, 1 or more")
    study, shard = load_study(args.file), _shard(args.shard)
    typed = [word for word in args.words if word != "--dry-run"]
    consent = {"source": str(args.file), "command": command_line(typed)}
    if not args.dry_run:
        require(args.run_code, study.estimators, **consent)
    plan = make_plan(study, shard=shard, run_code=not args.dry_run)
    folder = args.output or Path("results") / plan.study.name
    spare([args.file], folder, *(folder / name for name in (STUDY, REPORT)))
    if folder.is_dir():
        check(plan.study, folder)
    done = rows.done(folder)
    with ExitStack() as stack:
        executor, workers = _executor(args, stack)
        told = _announced(plan, done, workers, dry=args.dry_run)
        print(told, file=sys.stdout if args.dry_run else sys.stderr)
        if not args.dry_run:
            return _run(args, plan, folder, executor, workers)
    require(args.run_code, study.estimators, **consent)
    return 0


def _announced(plan: Plan, done: Any, workers: int, *, dry: bool) -> str:
    """Return the plan in words; a few cases are run to know how long it takes."""
    from flexaxis.experiments.running.forecast import forecast, without_code

    whole, todo = plan.work(), plan.work(done)
    text = (
        f"{len(plan.variants)} variants of {len(plan.study.scenarios)} scenario(s) × "
        f"{len(plan.study.seeds)} seeds: {whole.cases} cases on {whole.records} records"
    )
    if whole.cases > todo.cases:
        text += f"; {whole.cases - todo.cases} cases done, {todo.cases} to run"
    unit = next(plan.units(done), None)
    tried = without_code(unit) if unit and dry else unit
    if unit and not tried:
        text += "; how long it takes is not known before its code is run"
    return text if tried is None else f"{text}; {forecast(tried, todo).in_words(workers)}"


def _run(args: argparse.Namespace, plan: Plan, folder: Path, executor: Any, workers: int) -> int:
    from flexaxis.experiments.running import rows
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.engine import run_study
    from flexaxis.experiments.running.progress import progress
    from flexaxis.sim.errors import FlexaxisError

    total = plan.work().cases
    todo = plan.work(rows.done(folder)).cases
    counted = total - todo

    def landed(outcome: Any) -> None:
        nonlocal counted
        counted += outcome.cases
        advance(outcome.cases)

    try:
        with progress(f"{todo} cases", todo or 1) as advance:
            finished = run_study(
                plan,
                folder,
                executor,
                jobs=1 if executor else args.jobs,
                in_flight=2 * workers,
                resume=args.resume,
                keep=args.keep,
                store=default_cache() if args.cache else None,
                advance=landed,
                run_code=args.run_code,
            )
    except KeyboardInterrupt:
        print(f"flexaxis: interrupted; {_go_on(args, counted, total)}", file=sys.stderr)
        return 130
    except FlexaxisError as error:
        if counted > total - todo:
            raise FlexaxisError(f"{error}\n{_go_on(args, counted, total)}") from error
        raise
    return _report(args, plan, folder, finished, counted, total)


def _go_on(args: argparse.Namespace, counted: int, total: int) -> str:
    import shlex

    words = [word for word in args.words if word != "--resume"]
    return f"{counted} of {total} cases done; go on with: " + shlex.join(
        ["flexaxis", *words, "--resume"]
    )


def _report(  # noqa: PLR0917
    args: argparse.Namespace, plan: Plan, folder: Path, finished: Any, counted: int, total: int
) -> int:
    from flexaxis.experiments.reporting.study_page import write_report
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.results import Results

    results = Results.load(folder)
    failed = len(results.failures())
    # A share is reported on when all are merged.
    path = write_report(results) if plan.shard[1] == 1 else folder
    if args.json:
        told = {"folder": str(folder), "report": str(path), "cases": counted, "of": total}
        print(dumps(told | {"run": finished.cases, "failed": failed}))
        return 1 if failed else 0
    print(f"{counted} of {total} cases done, {finished.cases} of them just now")
    if failed:
        print(f"{failed} cases could not be run: `error` in their rows says why")
    print(path)
    return 1 if failed else 0


def _shard(text: str | None) -> tuple[int, int]:
    from flexaxis.sim.errors import FlexaxisError

    if text is None:
        return 1, 1
    mine, _, shares = text.partition("/")
    if not (mine.isdigit() and shares.isdigit() and 1 <= int(mine) <= int(shares)):
        raise FlexaxisError(f"--shard {text!r}: give I/N with I from 1 to N, such as 3/100")
    return int(mine), int(shares)


def _executor(args: argparse.Namespace, stack: ExitStack) -> tuple[Any, int]:
    """Return where to work, None for processes of our own, and how many work there."""
    from flexaxis.sim.errors import FlexaxisError

    if args.dask is None:
        return None, args.jobs
    from flexaxis.experiments.running.results import needed

    distributed = needed("distributed")
    try:
        client = stack.enter_context(distributed.Client(args.dask, timeout=10))
    except (OSError, ValueError) as error:
        raise FlexaxisError(f"--dask {args.dask}: no scheduler answers there: {error}") from error
    workers = sum(client.nthreads().values())
    if not workers:
        raise FlexaxisError(f"--dask {args.dask}: the cluster has no workers yet")
    return client.get_executor(), workers
