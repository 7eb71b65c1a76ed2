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

Code that the file names (path.py:Class, module:Class, pipe:COMMAND) is run: run only files you
trust. A dry run does not run it.

example:
  flexaxis study docs/examples/friction_steps.toml --dry-run
  flexaxis study docs/examples/friction_steps.toml -o results/friction --jobs 4
  flexaxis study docs/examples/friction_steps.toml -o /net/friction3 --shard 3/100
  flexaxis study --from /net/friction* -o results/friction
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import REPORT, check_not_input
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.running.study import Study

HELP = "sweep scenarios, faults and estimators over many seeds, resumable"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, metavar="FILE.toml", nargs="?")
    add_output(parser, "DIR", "default: results/NAME")
    options.add_engine(parser)
    options.add_from(parser)
    parser.add_argument("--dry-run", action="store_true", help="print the plan, and stop")
    options.add_cache(parser, default=False)


def main(args: argparse.Namespace) -> int:
    """Read, plan, run and report."""
    from flexaxis.experiments.reporting.study import title
    from flexaxis.experiments.studies.benchmark import report
    from flexaxis.experiments.studies.definition import load_study

    if args.shards:
        return options.merge_shards(args)
    if args.file is None:
        raise FlexaxisError("name the study's TOML file; docs/studies.md has every key")
    study = load_study(args.file)
    folder = args.output or Path("results") / study.name
    check_not_input([args.file], folder, folder / REPORT)
    if args.dry_run:
        return _plan(args, study, folder)
    shard, total = options.shard(args), study.cases
    with options.working(args, f"{total} cases", total, folder, cache=args.cache) as (runner, _):
        about = {"title": study.name, "command": options.line(args)}
        results = runner.run(study, shard=shard, traces=not study.axes, about=about)
        path = report(folder, runner) if shard == (1, 1) else folder
    failures = results.failures.to_dict("records")
    options.tell_failures(failures)
    content = {"folder": folder, "report": path, "cases": results.cases, "of": total}
    content |= {"run": runner.done, "failed": len(failures)}
    words = f"{results.cases} of {total} cases done, {runner.done} of them just now"
    status = options.failed(failures, args.remarks)
    if shard != (1, 1):
        return answer(args, content, status, words, path)
    return answer(args, content, status, words, title(results), f"report: {path}")


def _plan(args: argparse.Namespace, study: Study, folder: Path) -> int:
    """Print what would be run."""
    from flexaxis.experiments.running.store import ROWS, Store
    from flexaxis.experiments.running.study import missing, units

    shard = options.shard(args)
    every = units(study)[shard[0] - 1 :: shard[1]]
    stored = (folder / ROWS).exists() and not args.overwrite
    done = Store.read(folder).done() if stored else set[str]()
    counts = {
        "variants": len({unit.scenario.hash for unit in every}),
        "records": sum(len(unit.seeds) for unit in every),
        "cases": sum(len(unit.cases()) for unit in every),
        "to_run": sum(len(unit.cases()) for unit in missing(every, done)),
    }
    words = ", ".join(f"{number} {name.replace('_', ' ')}" for name, number in counts.items())
    return answer(args, {"folder": folder, **counts}, 0, words)
