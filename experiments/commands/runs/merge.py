"""Put the shares of a run or a study together: every case once, and the report.

Where cases of the study are in no share, that is said, and the exit status is 1.

example:
  flexaxis merge share1 share2 share3 -o results/friction
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands.answers import FINDING, FINE, add_output, answer, say
from flexaxis.experiments.storage.files import spare

HELP = "put the shares of a run or a study together"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    add_output(parser, "DIR", required=True)


def main(args: argparse.Namespace) -> int:
    """Merge and report; what is missing is said, and is a finding."""
    from flexaxis.experiments.running.merge import merge
    from flexaxis.experiments.studies.benchmark import report

    spare(args.folders, args.output)
    merged = merge(args.folders, args.output)
    path = report(args.output)
    if merged.makers[1:]:
        say("the rows were made with different versions:\n" + "\n".join(merged.makers))
    if merged.missing is None:
        say("the folders are of unlike estimators or seeds: what is still missing is not known")
    if merged.missing:
        say(f"incomplete: {merged.missing} of {merged.cases + merged.missing} cases are missing")
    told: dict[str, object] = {"cases": merged.cases, "doubles": merged.doubles}
    told |= {"missing": merged.missing, "folder": args.output, "report": path}
    count = f"{merged.cases} cases, {merged.doubles} more were doubles"
    return answer(args, told, FINDING if merged.missing else FINE, count, path)
