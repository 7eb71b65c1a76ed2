"""Put the shares of a study together: every case once, and the report.

example:
  flexaxis merge share1 share2 share3 -o results/friction
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "put the shares of a study together"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True)
    parser.add_argument("--json", action="store_true", help="print what was done as JSON")


def main(args: argparse.Namespace) -> int:
    """Merge and report."""
    from flexaxis.experiments.reporting.study_page import write_report
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.merge import merge
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.running.results import Results

    spare(args.folders, args.output)
    merged = merge(args.folders, args.output)
    path = write_report(Results.load(args.output))
    if args.json:
        told = {"cases": merged.cases, "doubles": merged.doubles}
        print(dumps(told | {"folder": str(args.output), "report": str(path)}))
    else:
        print(f"{merged.cases} cases, {merged.doubles} more were doubles")
        print(path)
    return 0
