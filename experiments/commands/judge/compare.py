r"""Compare a candidate estimator with a base: better, worse, slight, same, or undecided.

Both run on the same records (SUITE and SCENARIO as for `run`; default gate), and scores are
compared seed by seed. Two folders of finished runs are compared as they are, if their scenarios and
versions agree, on the seeds that both have. docs/gate.md explains the statistics.

With --match-std both are first tuned to the same noise, that of rpem-forgetting, and lag alone is
judged. This takes an estimator that names its tuning parameter (docs/scores.md).

exit status: 0 no regression; 1 worse; 2 wrong use; 3 undecided, with --strict or if two or more
runs are newly lost, a run newly failed, or runs of the candidate are missing; 70 a crash

example:
  flexaxis compare --base old.py:Mine --candidate new.py:Mine
  flexaxis compare --base rpem-forgetting --candidate 'pipe:octave-cli -q my.m' fm_step-v1 \
                   --max-seeds 128 --margin lag=5%,std=5%
  flexaxis compare --base glr --match-std --candidate new.py:Mine fm_step-v1
  flexaxis compare results/old results/new
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer, at_most
from flexaxis.experiments.files import SUMMARY, check_not_input
from flexaxis.experiments.seeds import MOST_SEEDS, parse_seeds
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.gate.gate import Comparison

HELP = "say whether an estimator got better or worse, with an exit status"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "names", nargs="*", metavar="SUITE|SCENARIO|RUN", help="where, or two finished runs"
    )
    parser.add_argument("--base", metavar="E", help="what to compare with")
    parser.add_argument("--candidate", metavar="E", help="what to judge")
    parser.add_argument(
        "--seeds",
        metavar="N or A:B",
        help="as for `run` (default: the suite's number, 32)",
    )
    parser.add_argument(
        "--max-seeds",
        type=at_most(MOST_SEEDS),
        metavar="N",
        help="add seeds up to N while undecided",
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
        "--match-std",
        action="store_true",
        help="first tune both to the same noise, then compare lag alone",
    )
    parser.add_argument("--strict", action="store_true", help="exit 3 if undecided")
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: all cores)")
    options.add_resume(parser)
    options.add_time_limit(parser)
    add_output(parser, "DIR", "default results/compare")


def main(args: argparse.Namespace) -> int:
    """Compare, report, and return the verdict as a status."""
    from flexaxis.experiments.running.store import ROWS

    margins = _margins(args)
    if len(args.names) == 2 and all((Path(name) / ROWS).exists() for name in args.names):
        _refuse(args, "max_seeds", "jobs", "overwrite", "resume", "match_std")
        return _stored(args, margins)
    if not (args.base and args.candidate):
        raise FlexaxisError(
            "name the estimators to compare with --base E --candidate E, or two folders of "
            "finished runs"
        )
    return _fresh(args, margins)


def _refuse(args: argparse.Namespace, *names: str) -> None:
    """Refuse options that would be ignored."""
    ignored = [f"--{name.replace('_', '-')}" for name in names if getattr(args, name)]
    if ignored:
        raise FlexaxisError(f"{', '.join(ignored)}: finished runs are compared as they are")


def _fresh(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.catalogue.find import find_suite, select, suite_names
    from flexaxis.experiments.gate.gate import SUITE, compare

    names = args.names or [SUITE]
    suites = [find_suite(name) for name in names if name in suite_names()] or [find_suite(SUITE)]
    seeds = parse_seeds(args.seeds or str(max(suite.seeds for suite in suites)))
    scenarios = select(names).scenarios
    cases = 2 * len(scenarios) * max(args.max_seeds or 0, len(seeds))
    about = f"{cases} cases, and more to tune them" if args.match_std else f"at most {cases} cases"
    with options.working(args, about, cases, _output(args)) as (runner, _):
        comparison = compare(
            args.base, args.candidate, scenarios, seeds, runner, margins=margins,
            max_seeds=args.max_seeds or 0, match_std=args.match_std,
        )  # fmt: skip
    return _answer(args, comparison)


def _margins(args: argparse.Namespace) -> dict[str, float]:
    """Return the margins with those of texts such as ``lag=2%,t10=0.1`` added or changed."""
    from flexaxis.experiments.gate.gate import check_margins

    margins = {}
    for text in ",".join(args.margin).split(",") if args.margin else ():
        metric, _, number = text.strip().partition("=")
        try:
            margins[metric] = float(number.removesuffix("%")) / (100 if "%" in number else 1)
        except ValueError:
            margins[metric] = float("nan")
    return check_margins(margins)


def _output(args: argparse.Namespace) -> Path:
    return args.output or Path("results/compare")


def _stored(args: argparse.Namespace, margins: dict[str, float]) -> int:
    from flexaxis.experiments.gate.gate import compare_runs

    check_not_input(args.names, _output(args))
    if (_output(args) / SUMMARY).exists():
        raise FlexaxisError(f"{_output(args)} holds a run: choose another folder with -o")
    comparison = compare_runs(
        *map(Path, args.names), margins=margins, estimators=(args.base, args.candidate),
        seeds=parse_seeds(args.seeds) if args.seeds else None,
    )  # fmt: skip
    return _answer(args, comparison)


def _answer(
    args: argparse.Namespace,
    comparison: Comparison,
) -> int:
    import flexaxis as fx
    from flexaxis.experiments.gate.report import as_dict, write

    status = comparison.status(strict=args.strict)
    content = as_dict(comparison) | {"command": options.line(args)}
    path = write(_output(args), content)

    content["report"] = path
    return answer(args, content, status, fx.Comparison(content), "", path)
