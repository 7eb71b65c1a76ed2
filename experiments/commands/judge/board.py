r"""Build a static site from entries: who is ahead on each track, every version, all lines.

An ENTRY is a folder that `flexaxis submit` made. Each is checked before it is taken: digests, form,
the frozen suite, its rows; what fails is told and left out (status 1).
The reference that all are matched to is run here. Nothing of an entry is executed, and its texts
are text. What `flexaxis verify ENTRY --run-code -o verdicts/NAME.json` found is taken from
--verdicts; an entry without a verdict is shown as unverified, one that was rejected is left out.

example:
  flexaxis board entries/glr entries/ekf --verdicts verdicts -o site
  flexaxis board entry --quick -o site          (entries with few seeds, for trying)
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flexaxis.experiments.commands.answers import add_output, answer, say

HELP = "build a site of entries: who is ahead, on each track"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("entries", nargs="+", type=Path, metavar="ENTRY")
    add_output(parser, "SITE", required=True)
    parser.add_argument("--verdicts", type=Path, metavar="FOLDER", help="of `verify ENTRY -o`")
    parser.add_argument("--quick", action="store_true", help="of entries for trying, no others")


def main(args: argparse.Namespace) -> int:
    """Collect, rank, write."""
    from flexaxis.experiments.board.entry import EntryError
    from flexaxis.experiments.board.ranking import board
    from flexaxis.experiments.board.site import PAGE, Shown, collect, read_verdicts, write_site
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.engine import Means

    _check(args)
    frozen = board()
    verdicts = read_verdicts(args.verdicts)
    means = Means(store=default_cache())
    taken, left = collect(args.entries, frozen, verdicts, quick=args.quick, means=means)
    for problems in left.values():
        for problem in problems:
            say(f"left out: {problem}")
    if not taken:
        raise EntryError("no entry can be taken: nothing is written")
    mine = frozen.quick() if args.quick else frozen
    shown = Shown(taken, left, mine, args.quick, args.line)
    found = write_site(shown, args.output)
    page = args.output / PAGE
    return answer(args, found | {"site": page}, int(bool(left)), *_told(found), page)


def _check(args: argparse.Namespace) -> None:
    from flexaxis.experiments.board.entry import EntryError

    if args.verdicts is not None and not args.verdicts.is_dir():
        raise EntryError(f"{args.verdicts}: there is no such folder")
    if any(args.output.resolve() == entry.resolve() for entry in args.entries):
        raise EntryError(f"{args.output}: is an entry; choose another folder with -o")


def _told(found: dict[str, Any]) -> Iterator[str]:
    """Yield a line a track."""
    for track, table in found["tracks"].items():
        ahead = [place["label"] for place in table["places"] if place["leads"]]
        yield f"{track}: {', '.join(ahead) or 'nobody can be ranked yet'}"
