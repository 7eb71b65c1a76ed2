"""Write the report of a finished run again, from the files in its folder.

example:
  flexaxis report results/smoke
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "write report.html again from the results in a folder"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of a finished run")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="default: in DIR")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def main(args: argparse.Namespace) -> int:
    """Render and print the path."""
    from flexaxis.experiments.reporting.run_page import render
    from flexaxis.experiments.reporting.terminal import score_table, show
    from flexaxis.experiments.running.files import (
        CURVES,
        PART,
        REPORT,
        SCORES,
        SUMMARY,
        dumps,
        load,
        write_text,
    )
    from flexaxis.experiments.running.outputs import spare

    path = args.output or args.folder / REPORT
    spare((args.folder / name for name in (SCORES, PART, SUMMARY, CURVES)), path)
    found = load(args.folder)
    write_text(path, render(found))
    if args.json:
        print(dumps(found.summary | {"report": str(path)}))
    else:
        show(score_table(found.summary["rows"]))
        print(path)
    return 0
