r"""Run a study: sweep keys of scenarios, faults and estimators over many seeds.

FILE.toml names scenarios, estimators and seeds, and the axes; docs/studies.md has every key:

  scenario = "fm_step-v1"
  estimators = ["rpem-forgetting", "glr"]
  seeds = 60
  [sweep]
  "fault[0].factor" = [1.1, 1.5, 2.0, 3.0]      # a key of the scenario, of its faults too
  "rpem-forgetting.forgetting" = [0.99, 0.995]  # an option of one estimator ("estimator.X": of all)

The plan is printed first. Rows are added to the folder as they come, and what it holds is kept: the
same line runs what is missing, after a kill or after estimators, seeds or values were added to the
file; --overwrite removes what is there first. A case
that cannot be run is a row that says why; the exit status is then 1, or 70 if code crashed. The
folder gets report.html.

A file that names code (path.py:Class, module:Class, pipe:COMMAND) is refused, and the code shown;
--run-code runs it. A dry run never does.

example:
  flexaxis study docs/examples/friction_steps.toml --dry-run
  flexaxis study docs/examples/friction_steps.toml -o results/friction --jobs 4
  flexaxis study docs/examples/friction_steps.toml -o /net/friction3 --shard 3/100
  flexaxis study --from /net/friction* -o results/friction
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.building.code import add_run_code, require
from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.progress import remark
from flexaxis.experiments.storage.files import REPORT, STUDY, spare
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.running.plan import Plan, Work

HELP = "sweep scenarios, faults and estimators over many seeds, resumable"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, metavar="FILE.toml", nargs="?")
    add_output(parser, "DIR", "default: results/NAME")
    options.add_engine(parser)
    options.add_from(parser)
    parser.add_argument("--dry-run", action="store_true", help="print the plan, and stop")
    parser.add_argument(
        "--keep",
        choices=("none", "all"),
        default="none",
        help="whose estimates to write to DIR/trajectories (default: none)",
    )
    options.add_cache(parser, default=False)
    add_run_code(parser, "estimators of FILE.toml")


def main(args: argparse.Namespace) -> int:
    """Read, ask for consent, plan, run and report."""
    from flexaxis.experiments.studies.definition import load_study

    if args.shards:
        return options.merge_shards(args)
    if args.file is None:
        raise FlexaxisError("name the study's TOML file; docs/studies.md has every key")
    study = load_study(args.file)
    consent = {"source": str(args.file), "command": args.line.replace(" --dry-run", "")}
    if not args.dry_run:
        require(args.run_code, study.estimators, **consent)
    try:
        status = _planned_and_run(args, study)
    except KeyboardInterrupt as error:
        if error.args or args.dry_run:
            raise
        raise KeyboardInterrupt(options.go_on(args, 0)) from None  # while it was planned
    require(args.run_code, study.estimators, **consent)
    return status


def _planned_and_run(args: argparse.Namespace, study: Any) -> int:
    from flexaxis.experiments.running.folder import check, done
    from flexaxis.experiments.running.plan import make_plan

    shard = options.shard(args)
    plan = make_plan(study, shard=shard, run_code=not args.dry_run)
    folder = args.output or Path("results") / plan.study.name
    spare([args.file], folder, *(folder / name for name in (STUDY, REPORT)))
    if folder.is_dir() and not args.overwrite:
        check(plan.study, folder)
    there = None if args.overwrite else done(folder, plan)
    with ExitStack() as stack:
        place = options.executor(args, stack)
        whole, todo = plan.work(), plan.work(there).cases
        told = _announced(plan, whole, todo)
        if not args.dry_run:
            remark(told)
            return _run(args, plan, folder, place, todo)
    planned = {"folder": folder, "variants": len(plan.variants), "cases": whole.cases}
    return answer(args, planned | {"records": whole.records, "to_run": todo}, 0, told)


def _announced(plan: Plan, whole: Work, todo: int) -> str:
    """Return the plan in words."""
    text = (
        f"{_several(len(plan.variants), 'variant')} of "
        f"{_several(len(plan.study.scenarios), 'scenario')} × "
        f"{_several(len(plan.study.seeds), 'seed')}: {_several(whole.cases, 'case')} on "
        f"{_several(whole.records, 'record')}"
    )
    if whole.cases > todo:
        text += f"; {_several(whole.cases - todo, 'case')} done, {todo} to run"
    return text


def _several(number: int, what: str) -> str:
    return f"{number} {what}{'s'[: number != 1]}"


def _run(
    args: argparse.Namespace, plan: Plan, folder: Path, place: tuple[Any, int], todo: int
) -> int:
    from flexaxis.experiments.running.engine import run_study

    working = options.working(args, _several(todo, "case"), todo, cache=args.cache, place=place)
    with working as (means, _):
        finished = run_study(
            plan,
            folder,
            means,
            overwrite=args.overwrite,
            keep=args.keep,
            traced=not plan.study.axes,
            run_code=args.run_code,
            about={"title": plan.study.name, "command": options.line(args)},
        )
    return _report(args, plan, folder, finished.cases)


def _report(args: argparse.Namespace, plan: Plan, folder: Path, run: int) -> int:
    from flexaxis.experiments.results.results import Results
    from flexaxis.experiments.running.folder import done
    from flexaxis.experiments.studies.benchmark import report

    total = plan.work().cases
    counted = total - plan.work(done(folder, plan)).cases
    failures = Results.load(folder).failures()
    # The report is of all shards, by `study --from`.
    path = report(folder) if plan.shard[1] == 1 else folder
    status = options.failed(failures, args.remarks)
    told = {"folder": folder, "report": path, "cases": counted, "of": total}
    told |= {"run": run, "failed": len(failures)}
    words = f"{counted} of {_several(total, 'case')} done, {run} of them just now"
    options.tell_failures(failures)
    return answer(args, told, status, words, path)
