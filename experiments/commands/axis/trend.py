"""Follow the parameters of an axis over many logs, and tell wear from warmth.

Each log gives estimates with intervals, from the values of AXIS.toml on; the page shows each
parameter from log to log, when it changed, and what a covariate such as the temperature explains.
Dates are taken from the logs or their names, else the logs are numbered. A log is computed once:
run it again when there are more, or after Ctrl-C, and only what is new is done. Status 1 if
something changed, or a log is not like the others.

example:
  flexaxis trend days/ --model axis.toml --covariate temp -o trend/
  flexaxis trend monday.csv tuesday.csv … --model axis.toml --map bench.toml --free f_m --free f_c
  flexaxis trend days/ --model axis.toml --covariate temperatures.csv --jobs 4 --json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.files import REPORT, write_json
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import tell
from flexaxis.experiments.logs.options import add_log_options, tables_of, treatment

if TYPE_CHECKING:
    from flexaxis.experiments.logs.trend.trend import Trend

HELP = "follow the parameters of your axis over many logs: worn, or warm?"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="FOLDER|LOG")
    parser.add_argument("--model", required=True, metavar="AXIS.toml", help="from identify")
    parser.add_argument(
        "--covariate", action="append", default=[], metavar="NAME|FILE.csv",
        help="what may explain the estimates: a column of the logs, of which the mean is taken, or "
        "a CSV with the name of each log and its value; repeat for several",
    )  # fmt: skip
    parser.add_argument(
        "--free", action="append", default=[], metavar="PARAMETER",
        help="estimate this, and no others; default: what the first log tells to 10 %%",
    )  # fmt: skip
    parser.add_argument(
        "--false-alarms", type=float, default=0.01, metavar="P",
        help="probability that a page of an axis that does not change says that it does; "
        "default: 0.01",
    )  # fmt: skip
    parser.add_argument(
        "--smallest", type=float, default=1.0, metavar="X",
        help="change that is worth a word [%%]; default: 1",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes; default: 1")
    add_output(parser, "FOLDER", "default: trend", default=Path("trend"))
    add_log_options(parser)


def main(args: argparse.Namespace) -> int:
    """Estimate, judge, report."""
    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.trend.estimates import Source
    from flexaxis.experiments.logs.trend.trend import ailments, trend_of
    from flexaxis.experiments.logs.trend.words import remarks

    if not 0 < args.false_alarms < 0.5:
        raise LogError(f"--false-alarms {args.false_alarms}: give a probability, such as 0.01")
    if not 0 <= args.smallest < 100:
        raise LogError(f"--smallest {args.smallest}: give per cent, such as 1")
    axis = find_axis(args.model)
    try:
        found = trend_of(
            args.logs, axis, Source(tables_of(args), treatment(args)), args.output,
            free=args.free, covariates=args.covariate, false_alarms=args.false_alarms,
            smallest=args.smallest / 100, jobs=args.jobs,
        )  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt("what was done is kept; the same line goes on") from None
    report = _page(args, found)
    status = 1 if found.changed or ailments(found.rows) else 0
    content = _result(args, found, report)
    return answer(args, content, status, report, show=lambda: tell(remarks(found)))


def _page(args: argparse.Namespace, found: Trend) -> Path:
    """Write the page; return where it is."""
    from flexaxis.experiments.logs.pages.page import write_page
    from flexaxis.experiments.logs.pages.trend_page import trend_page

    report, model = args.output / REPORT, Path(args.model).stem
    title = f"Trend of {model} over {len(found.good)} logs"
    write_page(trend_page(found, title=title, command=args.line), report)
    return report


def _result(args: argparse.Namespace, found: Trend, report: Path) -> dict[str, Any]:
    """Write the result; return it."""
    from flexaxis.experiments.logs.trend.estimates import RESULT
    from flexaxis.experiments.logs.trend.trend import ailments
    from flexaxis.experiments.logs.trend.words import summary

    content = {
        "parameters": {one.name: summary(one, found) for one in found.verdicts},
        "logs": len(found.rows),
        "problems": {row["log"]: row["problem"] for row in found.rows if row["problem"]},
        "unlike_the_others": ailments(found.rows),
        "false_alarms": args.false_alarms,
        "smallest": args.smallest / 100,
        "report": str(report),
    }
    write_json(args.output / RESULT, content)
    return content
