"""Write the report of a run or a study again, from the files in its folder.

example:
  flexaxis report results/smoke
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import REPORT, SUMMARY, check_not_input, write_text

HELP = "write report.html again from the results in a folder"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of a run or a study")
    add_output(parser, "FILE", "default: in DIR")


def main(args: argparse.Namespace) -> int:
    """Render and print the path."""
    from flexaxis.experiments.running.results import Results
    from flexaxis.experiments.running.store import ROWS

    path = args.output or args.folder / REPORT
    check_not_input([args.folder / ROWS, args.folder / SUMMARY], path)
    results = Results.load(args.folder)
    return _of_study(args, path, results) if results.axes else _of_run(args, path, results)


def _of_study(args: argparse.Namespace, path: Path, results: Any) -> int:
    from flexaxis.experiments.reporting.study import render

    write_text(path, render(results))
    if args.json:
        return answer(args, {"rows": results.pooled(), "report": path})
    print(f"report: {path}")
    return 0


def _of_run(args: argparse.Namespace, path: Path, results: Any) -> int:
    from flexaxis.experiments.reporting.run import render
    from flexaxis.experiments.reporting.terminal import show_run

    summary = results.summary
    write_text(path, render(results, summary))
    if args.json:
        known = {key: value for key, value in summary.items() if key != "command"}
        return answer(args, known | {"made_by": summary["command"], "report": path})
    show_run(summary)
    options.tell_failures(summary["failures"])
    print(f"report: {path}")
    return 0
