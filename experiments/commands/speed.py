"""Measure how long a sample takes: shipped estimators, their rivals, and the plant.

All are measured in one process, in turn, for some rounds; the ratios within a round are what can
be trusted on a shared machine. `pip install 'flexaxis[peers]'` adds filterpy.

example:
  flexaxis speed
  flexaxis speed --rounds 15 --json
"""

from __future__ import annotations

import argparse

from flexaxis.experiments.commands.answers import add_json, answer

HELP = "measure time per sample against rivals, as ratios"
GROUP = "judge"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--rounds", type=int, default=7, metavar="N", help="default 7")
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Measure and print the table."""
    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.studies.speed import measure
    from flexaxis.sim.errors import FlexaxisError

    if args.rounds < 1:
        raise FlexaxisError(f"--rounds {args.rounds}: give 1 or more")
    with progress("measuring", args.rounds) as advance:
        for found in measure(args.rounds):
            rows = found
            advance(1)
    if args.json:
        return answer(args, {"rounds": args.rounds, "rows": rows})
    table = Table("name", box=None, pad_edge=False)
    for heading in ("µs", "ratio", "range"):
        table.add_column(heading, justify="right")
    table.add_column("", no_wrap=True)
    for row in rows:
        meaning = f"times as fast as {row['unit']}" if row["faster"] else f"times {row['unit']}"
        span = f"{row['low']:.3g} … {row['high']:.3g}"
        cells = f"{row['us_per_sample']:.3g}", f"{row['ratio']:.3g}", span
        table.add_row(row["name"], *cells, "" if row["name"] == row["unit"] else meaning)
    Console().print(table)
    print("\n".join(f"{row['name']}: {row['what']}" for row in rows))
    return 0
