"""Measure what estimators cost: time a sample, the longest step, memory; what a run takes.

Without more, every shipped estimator is timed beside a matrix exponential, other ways to do the
same, the extended Kalman filter of other libraries (`pip install 'flexaxis[peers]'`) and the
plant. All are measured in one process, in turn, for some rounds, in processor time; the ratios
within a round are what can be trusted on a shared machine.

With --steps each step of the estimators is timed by itself, on an axis without and with a fault
every five seconds, and the longest are told. With --memory they are run for hours of samples, and
it is told what they hold, and whether that grows. With --deadline those that take one are run
without and with it, and it is told how much later their findings come.

With --campaign a suite or some scenarios are run instead, as `flexaxis run` would, with nothing in
the cache, and it is told where the core-seconds went: the plant, each estimator, bounds, scores,
pooling, the report, waiting. Its results are thrown away.

example:
  flexaxis speed
  flexaxis speed --rounds 15 --estimator relocate --estimator ekf --json
  flexaxis speed --steps 1000000 --estimator 'relocate[deadline=0.001]'
  flexaxis speed --memory 10
  flexaxis speed --deadline 0.001 --seeds 300:310
  flexaxis speed --campaign smoke --seeds 4
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_json, answer
from flexaxis.experiments.commands.numbers import at_most
from flexaxis.sim.errors import FlexaxisError

HELP = "measure time per sample, the longest step, memory"
GROUP = "judge"
ROUNDS = 7
WIDTH = 160  # characters of a table that no terminal shows


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--rounds", type=at_most(10_000), metavar="N", help=f"default {ROUNDS}")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--steps", type=at_most(10**8), metavar="N", help="the longest of so many steps"
    )
    what.add_argument(
        "--memory", type=at_most(10_000, float), metavar="HOURS", help="what is held after HOURS"
    )
    what.add_argument("--deadline", type=float, metavar="S", help="what a deadline of a step does")
    what.add_argument(
        "--campaign", nargs="+", metavar="SUITE|SCENARIO", help="where the time of a run goes"
    )
    parser.add_argument(
        "--estimator", action="append", metavar="E", help="as for `flexaxis run`; default: all"
    )
    parser.add_argument("--seeds", metavar="N or A:B", help="of --campaign and --deadline")
    options.add_jobs(parser)
    parser.set_defaults(jobs=None)  # so that it is seen whether it was typed
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Measure and print the table."""
    _check(args)
    if args.campaign:
        return _campaign(args)
    if args.steps:
        return _steps(args)
    if args.memory:
        return _memory(args)
    return _deadline(args) if args.deadline else _samples(args)


def _check(args: argparse.Namespace) -> None:
    """Refuse numbers that cannot be, and options that nothing would come of."""
    for name in ("rounds", "steps", "memory", "deadline"):
        given = getattr(args, name)
        if given is not None and not 0 < given < math.inf:
            raise FlexaxisError(f"--{name} {given:g}: give more than 0, and not inf")
    if args.seeds and not args.campaign and args.deadline is None:
        raise FlexaxisError("--seeds are those of a --campaign or of a --deadline")
    if args.jobs is not None and not args.campaign:
        raise FlexaxisError("--jobs are those of a --campaign: all else is timed in one process")
    other = next((n for n in ("campaign", "steps", "memory", "deadline") if getattr(args, n)), "")
    if args.rounds is not None and other:
        raise FlexaxisError(f"--rounds are not those of --{other}, which measures once")


def _campaign(args: argparse.Namespace) -> int:
    """Run a campaign and print where its time went."""
    from tempfile import TemporaryDirectory

    from flexaxis.experiments.commands.run import wanted
    from flexaxis.experiments.running.cache import RecordCache
    from flexaxis.experiments.studies.campaign import campaign

    args.jobs = args.jobs if args.jobs is not None else os.cpu_count() or 1
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
    total = sum(found.spent.values())
    rows = [(n, f"{s:.2f}", f"{100 * s / total:.1f}") for n, s in found.spent.items()]
    _show(("core-seconds of", "s", "%"), rows)
    print(
        f"{found.wall:.1f} s on {found.jobs} process{'es' * (found.jobs > 1)}; {found.cases} cases "
        f"on {found.records} records; {100 * found.overhead:.0f} % of the processor time "
        "is neither plant nor estimators"
    )
    return 0


def _samples(args: argparse.Namespace) -> int:
    """Measure what a sample takes and print the table."""
    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.speed.contenders import contenders
    from flexaxis.experiments.speed.rounds import measure

    rounds = args.rounds or ROUNDS
    wanted, missing = contenders(args.estimator or ())
    with progress("measuring", rounds) as advance:
        for found in measure(wanted, rounds):
            rows = found
            advance(1)
    if args.json:
        return answer(args, {"rounds": rounds, "rows": rows, "missing": missing})
    lines = []
    for row in rows:
        meaning = f"times as fast as {row['unit']}" if row["faster"] else f"times {row['unit']}"
        span = f"{row['low']:.3g} … {row['high']:.3g}"
        cells = f"{row['us_per_sample']:.3g}", f"{row['ratio']:.3g}", span
        lines.append((row["name"], *cells, "" if row["name"] == row["unit"] else meaning))
    _show(("name", "µs", "ratio", "range", ""), lines)
    print("\n".join(f"{row['name']}: {row['what']}" for row in rows if row.get("by") != "step"))
    for name, why in missing.items():
        print(f"{name} is left out: {why}")
    return 0


def _steps(args: argparse.Namespace) -> int:
    """Time each step and print the longest."""
    from flexaxis.experiments.speed.steps import PERCENTILES, TIMER, stepped, steps

    estimators = args.estimator or stepped()
    rows = _told(args, "stepping", 2 * len(estimators) + 1, steps(args.steps, estimators))
    if args.json:
        return answer(args, {"steps": args.steps, "rows": rows})
    lines = [
        (
            row["estimator"],
            "yes" if row["faults"] else "no",
            *(f"{row['cpu_us'][p]:.3g}" for p in PERCENTILES),
            f"{row['wall_us']['max']:.3g}",
            f"{100 * row['of_period']:.2g}",
            "" if row["findings"] is None else str(row["findings"]),
        )
        for row in rows
    ]
    _show(("µs a step", "faults", *PERCENTILES, "max (wall)", "max, % of T", "findings"), lines)
    print(f"{args.steps} steps of each, in processor time; {TIMER}: of a step that does nothing,")
    print("and part of all others")
    return 0


def _memory(args: argparse.Namespace) -> int:
    """Stream hours of samples and print what is held."""
    from flexaxis.experiments.speed.memory import memory
    from flexaxis.experiments.speed.steps import stepped

    estimators = args.estimator or stepped()
    rows = _told(args, "streaming", len(estimators), memory(args.memory, estimators))
    if args.json:
        return answer(args, {"hours": args.memory, "rows": rows})
    numbers = ("made", "early", "late", "grown", "resident_grown", "findings")
    lines = [
        (r["estimator"], *("" if r[n] is None else str(r[n]) for n in numbers),
         "yes" if r["flat"] else "no", f"{r['cpu_s']:.3g}")
        for r in rows
    ]  # fmt: skip
    heads = ("bytes of", "made", f"after {0.1 * args.memory:g} h", f"after {args.memory:g} h",
             "grown", "of the process", "findings", "flat", "s")  # fmt: skip
    _show(heads, lines)
    return 0


def _deadline(args: argparse.Namespace) -> int:
    """Run with and without a deadline and print what it does."""
    from flexaxis.experiments.running.seeds import parse_seeds
    from flexaxis.experiments.speed.deadline import deadline
    from flexaxis.experiments.speed.steps import WITH_DEADLINE

    estimators = args.estimator or WITH_DEADLINE
    seeds = parse_seeds(args.seeds or "10")
    rows = _told(args, "stepping", len(estimators), deadline(args.deadline, seeds, estimators))
    if args.json:
        return answer(args, {"deadline": args.deadline, "rows": rows})
    numbers = ("steps", "longest_us", "longest_with_us", "findings", "findings_with", "alike",
               "later_median", "later_max", "claim", "claim_with")  # fmt: skip
    lines = [
        (r["estimator"], *("" if r[n] is None else f"{r[n]:.6g}" for n in numbers)) for r in rows
    ]
    heads = ("", "steps", "longest [µs]", "with", "findings", "with", "of these alike", "later",
             "at most", "first claim", "with")  # fmt: skip
    _show(heads, lines)
    print(f"with: a deadline of {args.deadline:g} s; later: alarms, in samples, in the median")
    return 0


def _told(
    args: argparse.Namespace, doing: str, count: int, rows: Iterator[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return all rows, telling on stderr how far one is."""
    from flexaxis.experiments.running.progress import progress

    found = []
    with progress(doing, count) as advance:
        for row in rows:
            found.append(row)
            advance(1)
    return found


def _show(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table, its numbers to the right."""
    from rich.console import Console
    from rich.table import Table

    table = Table(heads[0], box=None, pad_edge=False)
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    # a table that is read by a program, or kept, is not cut to the width of a terminal
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)
