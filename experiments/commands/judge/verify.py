r"""Verify an entry of a board: its files, its rows again, its scores where nobody could know them.

First its files: digests, form, suite, rows; --form ends there, and runs nothing. Then its code,
under bubblewrap: in a process of its own for each case, without network, files and variables of
yours. Where the system does not give that, nothing is run (status 2). --unconfined runs code of
your own with all your rights, and never accepts it (status 3).

The code is given samples, one by one, and never a seed, a fault or the truth: a sample of its
reported cases, and cases that are drawn now, each with a seed and a time of the fault of its own,
against the reported ones. What they were drawn from is printed: --seed-from repeats them.
docs/board.md says what remains possible. `flexaxis rerun` runs rows of a run or a study again.

example:
  flexaxis verify entry --form
  flexaxis verify entry --run-code --hidden 16 -o verdict.json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.building.code import add_run_code
from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import UNDECIDED, add_output, answer, at_most, say
from flexaxis.experiments.storage.files import STUDY, spare, write_json
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.board.verification import Check, Verification

HELP = "verify an entry of a board: run its code where it can do no harm, and compare"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="ENTRY")
    parser.add_argument("--form", action="store_true", help="its files only; nothing is run")
    add_run_code(parser, "the files of ENTRY")
    parser.add_argument(
        "--unconfined", action="store_true", help="run code of your own with all your rights"
    )
    parser.add_argument(
        "--sample", type=at_most(10**6), default=10, metavar="N", help="its cases (default: 10)"
    )
    parser.add_argument(
        "--hidden", type=at_most(1000), default=8, metavar="N",
        help="unknown cases of each setting (default: 8)",
    )  # fmt: skip
    parser.add_argument("--seed-from", metavar="TEXT", help="what an earlier verdict has printed")
    add_output(parser, "FILE", "write the verdict (JSON)")
    options.add_time_limit(parser)


def main(args: argparse.Namespace) -> int:
    """Look at the files, run the code, and say what is found."""
    from flexaxis.experiments.board.entry import ENTRY, EntryError
    from flexaxis.experiments.board.hidden_seeds import Draw
    from flexaxis.experiments.board.verification import Ask, of_form, verify_entry
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.engine import Means

    _check(args)
    draw = Draw.new(args.seed_from)
    if args.output:
        spare([args.folder / ENTRY], args.output)
    ask = Ask(args.sample, args.hidden, draw, args.time_limit or 600.0, not args.unconfined)
    told = _tell if not args.json else lambda check: None
    try:
        if args.form:
            _, verdict = of_form(args.folder)
            for check in verdict.checks:
                told(check)
        else:
            _show_code(args)
            verdict = verify_entry(
                args.folder, ask, run_code=args.run_code, command=args.line,
                means=Means(store=default_cache()), told=told,
            )  # fmt: skip
    except EntryError as error:
        return _refused(args, error.problems)
    if args.output:
        write_json(args.output, verdict.as_json())
    status = 1 if not verdict.holds else UNDECIDED if verdict.ran and not verdict.accepted else 0
    return answer(args, verdict.as_json(), status, show=lambda: _conclude(args, verdict))


def _check(args: argparse.Namespace) -> None:
    from flexaxis.experiments.board.entry import ENTRY

    if args.sample < 1:
        raise FlexaxisError(f"--sample {args.sample}: give the number of cases, 1 or more")
    if args.hidden < 2:
        raise FlexaxisError(f"--hidden {args.hidden}: give the number of cases, 2 or more")
    if (args.folder / ENTRY).is_file():
        return
    if (args.folder / STUDY).is_file():
        raise FlexaxisError(
            f"{args.folder} is a run or a study, and no entry of a board: `flexaxis rerun "
            f"{args.folder}` runs some of its cases again and compares"
        )
    raise FlexaxisError(
        f"{args.folder} is no entry (it has no {ENTRY}): make one with `flexaxis submit`"
    )


def _refused(args: argparse.Namespace, problems: Any) -> int:

    if args.json:
        return answer(args, {"holds": False, "problems": list(problems)}, 1)
    for problem in problems:
        say(problem)
    print("REJECTED: not an entry as it was written; nothing was run")
    return 1


def _show_code(args: argparse.Namespace) -> None:
    """Say what would be run, before anything is."""
    from flexaxis.experiments.board.entry import read

    for path in read(args.folder).code:
        say(f"its code: {path} ({path.stat().st_size} bytes)")


def _tell(check: Check) -> None:
    word = {True: "holds", False: "FAILS", None: "-"}[check.holds]
    print(f"{word:<6} {check.name}: {check.seen}", flush=True)


def _conclude(args: argparse.Namespace, verdict: Verification) -> None:
    if verdict.ran:
        held = [what for what, yes in verdict.isolation.items() if yes]
        how = (
            f"under bubblewrap, with {', '.join(held)}" if verdict.confined else "with your rights"
        )
        print(f"its code ran {how}")
        print(f"drawn from {verdict.token}: repeat with --seed-from {verdict.token}")
    trying = "; few seeds: for trying" if verdict.quick else ""
    label = verdict.label
    if not verdict.holds:
        print(f"REJECTED: {label}{trying}")
    elif verdict.accepted:
        print(f"ACCEPTED: {label}{trying}")
    elif verdict.ran:
        print(f"UNCONFINED: {label}: nothing was found, and nothing is accepted so{trying}")
    else:
        print(f"well-formed: {label} (form only: nothing was run){trying}")
    if args.output:
        print(args.output)
