"""Put the shares of a run or a study together: every case once, and the report.

Where cases of the study are in no share, that is said, and the exit status is 1.

example:
  flexaxis merge share1 share2 share3 -o results/friction
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "put the shares of a run or a study together"
GROUP = "run"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True)
    parser.add_argument("--json", action="store_true", help="print what was done as JSON")


def main(args: argparse.Namespace) -> int:
    """Merge and report; what is missing is said, and is a finding."""
    from flexaxis.experiments.cli import FINDING, FINE, say
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.merge import merge
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.studies.report import report

    spare(args.folders, args.output)
    merged = merge(args.folders, args.output)
    path = report(args.output)
    if merged.makers[1:]:
        say("the rows were made with different versions:\n" + "\n".join(merged.makers))
    if merged.missing is None:
        say("the folders are of unlike estimators or seeds: what is still missing is not known")
    if merged.missing:
        say(f"incomplete: {merged.missing} of {merged.cases + merged.missing} cases are missing")
    if args.json:
        told = {"cases": merged.cases, "doubles": merged.doubles, "missing": merged.missing}
        print(dumps(told | {"folder": str(args.output), "report": str(path)}))
    else:
        print(f"{merged.cases} cases, {merged.doubles} more were doubles")
        print(path)
    return FINDING if merged.missing else FINE
