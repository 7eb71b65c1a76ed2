r"""Make an entry for a board: run the frozen suite, and put rows, code and terms into a folder.

ESTIMATOR is as for `run --estimator`. A file path.py:Class is copied into the entry with what it
imports from its folder, and run from there, so that whoever verifies runs what was scored; what a
program or a module needs besides, `install` says. The suite and its seeds are frozen: `flexaxis
show board-v2` lists them. Knobs are turned as for `flexaxis tradeoff`, for a board compares at
equal noise.

What is asked may stand in a file for --about: name, version, licence, contact, description,
install (where it needs something), tuned_on. Everything that is missing is told at once. --quick
takes five seeds, for trying: such an entry is marked, and a board ranks it only with --quick.
--resume goes on after Ctrl-C.

example:
  flexaxis submit glr -o entry --quick --name glr --licence Apache-2.0 \
           --contact https://example.org --description 'The one that jumps, as shipped.' \
           --tuned-on 0:100
  flexaxis submit my_estimator.py:Mine -o entry --about entry.toml
  flexaxis verify entry --run-code
  flexaxis board entry other-entry -o site
"""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.building.code import names_code
from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.progress import remark
from flexaxis.experiments.storage.files import spare

if TYPE_CHECKING:
    from flexaxis.experiments.board.entry import About

HELP = "make an entry for a board of estimators"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", help="as for `run --estimator`")
    add_output(parser, "DIR", required=True)
    parser.add_argument("--about", type=Path, metavar="FILE", help="TOML with what is asked below")
    words = {
        "name": "of the entry; its versions share it (default: the estimator's, if registered)",
        "version": "of the entry (default: 1)",
        "licence": "an SPDX name, such as MIT",
        "contact": "an address of mail, or https://…",
        "description": "a sentence or two",
        "install": "the line that installs what it needs besides flexaxis (default: nothing)",
        "tuned-on": "seeds that were looked at while tuning, such as 0:100, or none",
    }
    for name, text in words.items():
        parser.add_argument(f"--{name}", metavar="TEXT", help=text)
    parser.add_argument("--quick", action="store_true", help="five seeds: for trying, not eligible")
    options.add_jobs(parser, what="the rows do")
    parser.add_argument(options.RESUME, action="store_true", help="go on after Ctrl-C")
    options.add_time_limit(parser)


def main(args: argparse.Namespace) -> int:
    """Run the suite and write the entry."""
    from flexaxis.experiments.board.ranking import board
    from flexaxis.experiments.board.submission import cases, submit

    about = _about(args)
    if args.about:
        spare([args.about], args.output)
    wanted = board().quick() if args.quick else board()
    total = cases(args.estimator, wanted)
    with options.working(args, f"{total} cases or more", total) as (means, _):
        entry = submit(
            args.estimator, args.output, about, wanted, means, quick=args.quick,
            resume=args.resume, command=options.line(args, whole=True), say=remark,
        )  # fmt: skip
    found = {"entry": args.output, "label": entry.label, "digest": entry.digest}
    found |= {"quick": entry.quick, "left_out": entry.left_out}
    eligible = "for trying (few seeds)" if entry.quick else "eligible"
    lines = [f"{entry.label}, {eligible}, digest {entry.digest[:16]}"]
    where, quick = shlex.quote(str(args.output)), " --quick" if entry.quick else ""
    run = " --run-code" if names_code(entry.estimator) else ""
    lines += [f"next: flexaxis verify {where}{run}, then flexaxis board {where}{quick} -o site"]
    return answer(args, found, 0, *lines, args.output)


def _about(args: argparse.Namespace) -> About:
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.board.entry import ASKED, about_from

    given = {key: getattr(args, key) for key in ASKED}
    usual: dict[str, str] = {"version": "1"}
    if args.estimator in REGISTRY:
        usual |= {
            "name": args.estimator,
            "description": REGISTRY[args.estimator].summary,
        }
    return about_from(args.about, given, usual)
