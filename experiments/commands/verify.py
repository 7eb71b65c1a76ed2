r"""Run some cases of a run or a study again, chosen at random, or verify an entry of a board.

Rows that were made on this machine with these versions must be identical (but for `cost`); others
agree within 1e-6 of the value or 1e-9. The exit status is 1 if any does not. Rows that name code as
their estimator are refused, and the code shown; --run-code runs it.

An entry (`flexaxis submit`) is looked at in two steps. First its files: digests, form, suite, and
whether its rows give its summary; --form ends there, and runs nothing. Then its code, in a process
without network, files and variables of yours. Where the system does not give all of that, nothing
is run, unless --plain says to run it with all your rights, which the verdict says. It is asked for
the rules of `check`, a sample of its rows, its scores on seeds that you draw (none of 0-99 and
1000-4999) against the reported ones, and faults at another time. The code is given samples, one by
one, and never a seed, a fault or the truth. What the seeds were drawn from is printed:
--seed-from repeats them. docs/board.md says what remains possible.

example:
  flexaxis verify results/friction --sample 20
  flexaxis verify entry --form
  flexaxis verify entry --run-code --hidden 16 -o verdict.json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.building.consent import add_run_code
from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_json, answer
from flexaxis.experiments.commands.numbers import SEED, at_most
from flexaxis.experiments.streams import visible

if TYPE_CHECKING:
    from flexaxis.experiments.board.verdict import Check, Verdict

HELP = "run random cases of a run or a study again and compare, or verify an entry"
GROUP = "run"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="RUN|ENTRY")
    parser.add_argument(
        "--sample", type=at_most(10**6), default=10, metavar="N", help="cases (default: 10)"
    )
    parser.add_argument("--seed", type=at_most(SEED), default=0, help="of the choice (default: 0)")
    add_run_code(parser, "rows in DIR")
    entry = parser.add_argument_group("of an entry")
    entry.add_argument("--form", action="store_true", help="its files only; nothing is run")
    entry.add_argument(
        "--plain", action="store_true", help="run its code with all your rights, not shut in"
    )
    entry.add_argument(
        "--hidden", type=at_most(1000), default=8, metavar="N", help="unknown seeds (default: 8)"
    )
    entry.add_argument("--seed-from", metavar="TEXT", help="what an earlier verdict has printed")
    entry.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the verdict (JSON)")
    options.add_time_limit(parser)
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Run again, compare, and name what differs."""
    from flexaxis.experiments.board.entry import is_entry
    from flexaxis.sim.errors import FlexaxisError

    if args.sample < 1:
        raise FlexaxisError(f"--sample {args.sample}: give the number of cases, 1 or more")
    if is_entry(args.folder):
        return _entry(args)
    if args.form or args.plain or args.seed_from or args.output:
        raise FlexaxisError(
            f"{args.folder} is no entry (it has no entry.json), and --form, --plain, --seed-from "
            "and -o are of entries: make one with `flexaxis submit`"
        )
    return _rows(args)


def _rows(args: argparse.Namespace) -> int:
    """Run a sample of the rows in a folder again."""
    from dataclasses import asdict

    from flexaxis.experiments.running.verify import verify
    from flexaxis.experiments.studies.benchmark import command_line

    verdicts = list(
        verify(
            args.folder,
            sample=args.sample,
            seed=args.seed,
            run_code=args.run_code,
            command=command_line(args.words),
        )
    )
    wrong = [verdict for verdict in verdicts if verdict.differences]
    if args.json:
        cases = [asdict(verdict) for verdict in verdicts]
        return answer(args, {"cases": cases, "differ": len(wrong)}, 1 if wrong else 0)
    for verdict in wrong:
        head = f"{verdict.case} ({verdict.what}):"
        print(visible(head), *map(visible, verdict.differences), sep="\n  ")
    exact = sum(verdict.exact for verdict in verdicts)
    print(
        f"{len(verdicts) - len(wrong)} of {len(verdicts)} cases agree; {exact} had to be identical "
        f"(made on this machine with these versions), the others within the tolerance"
    )
    return 1 if wrong else 0


def _entry(args: argparse.Namespace) -> int:
    """Verify an entry; what is wrong with it is a finding."""
    from flexaxis.experiments.board.errors import EntryError
    from flexaxis.experiments.board.hidden import Draw
    from flexaxis.experiments.board.trial import Ask, verify_entry
    from flexaxis.experiments.board.verdict import of_form
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.running.sealed import write_sealed
    from flexaxis.experiments.studies.benchmark import command_line
    from flexaxis.sim.errors import FlexaxisError

    if args.hidden < 2:
        raise FlexaxisError(f"--hidden {args.hidden}: give the number of seeds, 2 or more")
    draw = Draw.new(args.seed_from)
    if args.output:
        spare([args.folder / "entry.json"], args.output)
    ask = Ask(args.sample, args.hidden, draw, args.time_limit or 600.0, args.plain)
    told = _tell if not args.json else lambda check: None
    try:
        if args.form:
            _, verdict = of_form(args.folder)
            for check in verdict.checks:
                told(check)
        else:
            _show_code(args)
            verdict = verify_entry(
                args.folder, ask, run_code=args.run_code, command=command_line(args.words),
                store=default_cache(), told=told,
            )  # fmt: skip
    except EntryError as error:
        return _refused(args, error.problems)
    if args.output:
        write_sealed(args.output, verdict.as_json())
    status = 0 if verdict.holds else 1
    if args.json:
        return answer(args, verdict.as_json(), status)
    _conclude(args, verdict)
    return status


def _refused(args: argparse.Namespace, problems: Any) -> int:
    from flexaxis.experiments.cli import say

    if args.json:
        return answer(args, {"holds": False, "problems": list(problems)}, 1)
    for problem in problems:
        say(problem)
    print("REJECTED: not an entry as it was written; nothing was run")
    return 1


def _show_code(args: argparse.Namespace) -> None:
    """Say what would be run, before anything is."""
    from flexaxis.experiments.board.entry import read
    from flexaxis.experiments.cli import say

    entry = read(args.folder)
    for path in entry.code:
        say(f"its code: {path} ({path.stat().st_size} bytes)")


def _tell(check: Check) -> None:
    word = {True: "holds", False: "FAILS", None: "-"}[check.holds]
    print(f"{word:<6} {visible(check.name)}: {visible(check.seen)}", flush=True)


def _conclude(args: argparse.Namespace, verdict: Verdict) -> None:
    if verdict.ran:
        held = [what for what, yes in verdict.isolation.items() if yes]
        lacks = [what for what, yes in verdict.isolation.items() if not yes]
        text = f"its code ran with {', '.join(held) or 'nothing held back'}"
        print(text + (f"; NOT reached here: {', '.join(lacks)}" if lacks else ""))
        print(f"drawn from {verdict.token}: repeat with --seed-from {verdict.token}")
    how = "" if verdict.ran else " (form only: nothing was run)"
    trying = "; few seeds: for trying" if verdict.quick else ""
    word = "REJECTED" if not verdict.holds else "ACCEPTED" if verdict.ran else "well-formed"
    print(f"{word}: {visible(verdict.label)}{how}{trying}")
    if args.output:
        print(args.output)
