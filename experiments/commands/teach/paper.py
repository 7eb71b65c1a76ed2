"""Reproduce the paper: every figure, every claim checked on MuJoCo data, and a page with the story.

The folder gets index.html, claims.json, and fig3 to fig9 as .svg and .png. Exit
status 1 if a claim does not hold.

example:
  flexaxis paper -o results/paper
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.progress import progress

HELP = "reproduce the paper's figures and check its claims"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_output(parser, "DIR", "default: results/paper", default=Path("results/paper"))
    options.add_jobs(parser, what="the claims do")
    options.add_cache(parser, default=True)


def main(args: argparse.Namespace) -> int:
    """Reproduce, check, and say what failed."""
    from flexaxis.experiments.paper.reproduce import PAGE, claims_table, reproduce
    from flexaxis.experiments.reporting.terminal import lines, show
    from flexaxis.experiments.running.cache import default_cache

    try:
        with progress("paper", 1) as advance:
            claims = reproduce(
                args.output,
                command=args.line,
                jobs=args.jobs,
                store=default_cache() if args.cache else None,
                advance=advance,
            )
    except KeyboardInterrupt:
        kept = "the records that were simulated are" if args.cache else "nothing is"
        again = args.line
        raise KeyboardInterrupt(f"{kept} kept; begin again with: {again}") from None
    page = args.output / PAGE
    status = int(not all(claim.holds for claim in claims))
    caption = f"{sum(claim.holds for claim in claims)} of {len(claims)} claims hold"
    told = {"claims": [claim.as_json() for claim in claims], "page": page}
    shown = lines(claims_table(claims)._replace(name=caption))
    return answer(args, told, status, page, show=lambda: show(shown))
