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
    options.add_cache(parser, default=True)


def main(args: argparse.Namespace) -> int:
    """Reproduce, check, and list the claims."""
    from flexaxis.experiments.paper.reproduce import PAGE, reproduce
    from flexaxis.experiments.running.cache import default_cache

    store = default_cache() if args.cache else None
    with progress("paper", 1) as advance:
        claims = reproduce(args.output, command=args.line, store=store, advance=advance)
    page, held = args.output / PAGE, sum(claim["holds"] for claim in claims)

    def show() -> None:
        print(f"{held} of {len(claims)} claims hold")
        for claim in claims:
            if not claim["holds"]:
                print(f"✗ {claim['claim']} ({claim['source']}): {claim['measured']}")

    told = {"claims": claims, "page": page}
    return answer(args, told, int(held < len(claims)), page, show=show)
