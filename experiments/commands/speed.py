"""Measure how long a sample takes: shipped estimators, their rivals, and the plant.

All are measured in one process, in turn, for some rounds; the ratios within a round are what can
be trusted on a shared machine. `pip install 'flexaxis[peers]'` adds filterpy.

With --campaign a suite or some scenarios are run instead, as `flexaxis run` would, with nothing in
the cache, and it is told where the core-seconds went: the plant, each estimator, bounds, scores,
pooling, the report, waiting. Its results are thrown away.

example:
  flexaxis speed
  flexaxis speed --rounds 15 --json
  flexaxis speed --campaign smoke --seeds 4
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_json, answer
from flexaxis.sim.errors import FlexaxisError

HELP = "measure time per sample against rivals, as ratios"
GROUP = "judge"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--rounds", type=int, default=7, metavar="N", help="default 7")
    parser.add_argument(
        "--campaign", nargs="+", metavar="SUITE|SCENARIO", help="where the time of a run goes"
    )
    parser.add_argument("--estimator", action="append", metavar="E", help="as for `flexaxis run`")
    parser.add_argument("--seeds", metavar="N or A:B", help="as for `flexaxis run`")
    options.add_jobs(parser)
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Measure and print the table."""
    if args.campaign:
        return _campaign(args)
    if args.seeds or args.estimator:
        raise FlexaxisError("--seeds and --estimator are those of a --campaign")
    return _samples(args)


def _campaign(args: argparse.Namespace) -> int:
    """Run a campaign and print where its time went."""
    from tempfile import TemporaryDirectory

    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.commands.run import wanted
    from flexaxis.experiments.running.cache import RecordCache
    from flexaxis.experiments.studies.campaign import campaign

    work = wanted(args, args.campaign)
    cases = f"{work.cases} case{'s'[: work.cases != 1]}"
    with (
        TemporaryDirectory(prefix="flexaxis-") as folder,
        options.working(args, cases, work.cases, cache=False) as (means, _),
    ):
        store = RecordCache(Path(folder) / "records")
        found = campaign(work, Path(folder) / "run", replace(means, store=store))
    if args.json:
        return answer(args, found.as_json())
    table = Table("core-seconds of", box=None, pad_edge=False)
    for heading in ("s", "%"):
        table.add_column(heading, justify="right")
    total = sum(found.spent.values())
    for name, seconds in found.spent.items():
        table.add_row(name, f"{seconds:.2f}", f"{100 * seconds / total:.1f}")
    Console().print(table)
    print(
        f"{found.wall:.1f} s on {found.jobs} process{'es' * (found.jobs > 1)}; {found.cases} cases "
        f"on {found.records} records; {100 * found.overhead:.0f} % of the processor time "
        "is neither plant nor estimators"
    )
    return 0


def _samples(args: argparse.Namespace) -> int:
    """Measure what a sample takes and print the table."""
    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.studies.speed import measure

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
