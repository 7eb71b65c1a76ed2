r"""Compare a candidate estimator with a base: better, worse, slight, same, or undecided.

Both run on the same records. Scores are compared seed by seed, lost runs over all scenarios;
docs/gate.md explains the statistics. SUITE and SCENARIO as for `run` (default gate). Two folders
of finished runs are compared as they are, if their scenarios and versions agree, on the seeds that
both have (those of --seeds, if given).

With --match-std both are tuned to one noise first (that of rpem-forgetting, on seeds 0 to 15): to
equal std of the parameter that changes, or, where several do, equal excess prediction error. Then
noise is equal and lag alone is judged. For any class that names its knob; docs/scores.md.

exit status: 0 no regression; 1 worse; 2 wrong use; 3 undecided, with --strict or where two runs
or more were newly lost, or one failed, or rows of the candidate are not there; 70 a crash

example:
  flexaxis compare --base rpem-forgetting --candidate my_estimator.py:Mine
  flexaxis compare --base rpem-forgetting --candidate 'pipe:octave-cli -q my.m' fm_step-v1 \
                   --max-seeds 128 --margin lag=5%,std=5%
  flexaxis compare --base glr --match-std --candidate my_estimator.py:Mine fm_step-v1
  flexaxis compare results/old results/new
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer, at_most, say
from flexaxis.experiments.running.seeds import MOST, parse_seeds
from flexaxis.experiments.storage.files import SUMMARY, spare
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.gate.gate import Comparison

HELP = "say whether an estimator got better or worse, with an exit status"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="*", metavar="SUITE|SCENARIO|RUN")
    parser.add_argument("--base", metavar="E", help="what to compare with")
    parser.add_argument("--candidate", metavar="E", help="what to judge")
    parser.add_argument(
        "--seeds",
        metavar="N or A:B",
        help="as for `run` (default: the suite's number, 32)",
    )
    parser.add_argument(
        "--max-seeds", type=at_most(MOST), metavar="N", help="add seeds up to N while undecided"
    )
    parser.add_argument(
        "--margin",
        action="append",
        default=[],
        metavar="SCORE=%[,…]",
        help="smaller changes do not matter (default lag=2%%,std=2%%; others: t10, std_after, "
        "cross_talk, excess)",
    )
    parser.add_argument(
        "--match-std", action="store_true", help="tune both to one noise first, and judge the lag"
    )
    parser.add_argument("--strict", action="store_true", help="exit 3 if undecided")
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: all cores)")
    options.add_resume(parser)
    options.add_time_limit(parser)
    add_output(parser, "DIR", "default results/compare")


def main(args: argparse.Namespace) -> int:
    """Compare, report, and return the verdict as a status."""
    from flexaxis.experiments.gate.pairs import parse_margins
    from flexaxis.experiments.gate.stored import is_run

    margins = parse_margins(args.margin)
    if len(args.names) == 2 and all(map(is_run, args.names)):
        _refuse(args, "finished runs, which are compared as they are", "max_seeds", "jobs",
                "overwrite", "resume", "match_std")  # fmt: skip
        return _stored(args, margins)
    if not (args.base and args.candidate):
        raise FlexaxisError(
            "say what to compare: --base E --candidate E, or two folders of finished runs"
        )
    return _fresh(args, margins)


def _refuse(args: argparse.Namespace, what: str, *names: str) -> None:
    """Refuse options that would be ignored."""
    given = [f"--{name.replace('_', '-')}" for name in names if getattr(args, name)]
    if given:
        raise FlexaxisError(f"{' and '.join(given)}: no option of {what}; leave it out")


def _fresh(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.catalogue.find import find_scenario, select, suite_names
    from flexaxis.experiments.gate.gate import SUITE, ask, compare, default_seeds
    from flexaxis.experiments.gate.report import write
    from flexaxis.experiments.running.bench import Bench

    names = args.names or [SUITE]
    seeds = parse_seeds(args.seeds or str(default_seeds(names)))
    question, left_out = ask(
        args.base, args.candidate, select(names).scenarios, seeds, margins, args.max_seeds or 0
    )
    for name, reason in left_out.items():
        say(f"{name} is left out: {reason}")
    sources = {find_scenario(n).name: n for n in names if n not in suite_names()}
    most = question.most(match_std=args.match_std)
    command, folder = options.line(args), _output(args)
    how = {"overwrite": args.overwrite, "traced": True, "about": {"command": command}}
    with (
        options.working(args, f"at most {most} case{'s'[: most != 1]}", most) as (means, _),
        Bench(question.scenarios, folder, means, **how) as bench,
    ):
        found = compare(question, bench, match_std=args.match_std)
        path = write(folder, found, question.scenarios, sources=sources, command=command)
    return _told(args, found, path, sources)


def _output(args: argparse.Namespace) -> Path:
    return args.output or Path("results/compare")


def _stored(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.gate.report import write
    from flexaxis.experiments.gate.stored import compare_runs

    base, candidate = map(Path, args.names)
    spare(args.names, _output(args))
    if (_output(args) / SUMMARY).exists():
        raise FlexaxisError(f"{_output(args)} holds a run: choose another folder with -o")
    seeds = parse_seeds(args.seeds) if args.seeds else None
    estimators = (args.base, args.candidate)
    found = compare_runs(base, candidate, margins, estimators=estimators, seeds=seeds)
    return _told(args, found, write(_output(args), found), {})


def _told(args: argparse.Namespace, found: Comparison, path: Path, sources: dict[str, str]) -> int:
    from flexaxis.experiments.gate.report import terminal_table
    from flexaxis.experiments.gate.wording import headline, knobs, meaning, row_command, worst
    from flexaxis.experiments.reporting.terminal import show

    status = found.status(strict=args.strict)
    lines = ["", headline(found), meaning(found), *([knobs(found)] if found.equal else [])]
    if status in (1, 3):
        lines.append(f"look at the worst seed: {row_command(found, worst(found), sources)}")
    content = found.as_dict() | {"report": path}
    return answer(args, content, status, *lines, path, show=lambda: show(terminal_table(found)))
