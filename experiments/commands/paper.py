"""Reproduce the paper: every figure, every claim checked on MuJoCo data, and a page with the story.

The folder gets index.html, claims.json, and fig3 to fig9 and figA to figE as .svg and .png. Exit
status 1 if a claim does not hold.

example:
  flexaxis paper -o results/paper
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from flexaxis.experiments.commands.answers import add_json, answer

HELP = "reproduce the paper's figures and check its claims"
GROUP = "teach"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("results/paper"),
        metavar="DIR",
        help="default: results/paper",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one a core); the claims do not depend on it",
    )
    parser.add_argument(
        "--no-cache", action="store_true", help="simulate every record, and keep none"
    )
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Reproduce, check, and say what failed."""
    from flexaxis.experiments.paper.reproduce import PAGE, claims_table, reproduce
    from flexaxis.experiments.reporting.terminal import show_table
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.studies.benchmark import command_line

    try:
        with progress("paper", 1) as advance:
            claims = reproduce(
                args.output,
                command=command_line(args.words),
                jobs=args.jobs,
                store=None if args.no_cache else default_cache(),
                advance=advance,
            )
    except KeyboardInterrupt:
        kept = "nothing is" if args.no_cache else "the records that were simulated are"
        again = command_line(args.words)
        raise KeyboardInterrupt(f"{kept} kept; begin again with: {again}") from None
    page = args.output / PAGE
    status = int(not all(claim.holds for claim in claims))
    if args.json:
        return answer(args, {"claims": [claim.as_json() for claim in claims], "page": page}, status)
    held = sum(claim.holds for claim in claims)
    show_table(claims_table(claims), caption=f"{held} of {len(claims)} claims hold")
    print(page)
    return status
