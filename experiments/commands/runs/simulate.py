"""Simulate one run of a scenario and save the record: what was measured, and the truth.

With --as-log, what a robot would have logged of it instead: no truth, its own units and clock, as
coarse and as full of gaps as you like; a log to practise `import` and `identify` on.

example:
  flexaxis simulate fm_step-v1 --seed 0 -o rec.nc
  flexaxis simulate coulomb_fm_step-v1 --as-log csv --units deg,A,ms --counts 65536 -o log.csv
  flexaxis simulate moves_fm_step-v1 --as-log csv --jitter 2e-4 --gaps 3 -o log.csv
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import SEED, add_output, answer, at_most
from flexaxis.experiments.files import check_not_input
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.options import add_style_options, style_of
from flexaxis.experiments.seeds import check_seed

if TYPE_CHECKING:
    from flexaxis.sim.record import Record

HELP = "simulate a scenario and save the record (NetCDF-4), or a log of it"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scenario", metavar="SCENARIO", help="catalogue name or TOML path")
    parser.add_argument(
        "--seed", type=at_most(SEED), default=0, help="number of the run (default 0)"
    )
    add_output(parser, "FILE", "default: SCENARIO-SEED.nc")
    parser.add_argument("--as-log", choices=("csv",), help="write what a robot would log, as this")
    add_style_options(parser)


def main(args: argparse.Namespace) -> int:
    """Simulate and save."""
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.logs.files import spare_foreign
    from flexaxis.sim.simulate import simulate

    check_seed(args.seed, what="--seed")
    scenario = find_scenario(args.scenario)
    suffix = args.as_log or "nc"
    path = args.output or Path(f"{scenario.name}-{args.seed}.{suffix}")
    if args.as_log and path.suffix != f".{suffix}":
        raise LogError(f"-o {path}: a log as {suffix} ends in .{suffix}")
    if style_given := [w for w in args.words if w.partition("=")[0] in _STYLE and not args.as_log]:
        raise LogError(f"{style_given[0]} is for a log: add --as-log csv")
    check_not_input([args.scenario], path)
    spare_foreign(path)
    record = simulate(scenario, [args.seed])[0]
    content: dict[str, object] = {"record": str(path)}
    if args.as_log:
        content = {"log": str(path), "import": _write_log(record, path, args)}
    else:
        record.save(path)
    content |= {"scenario": scenario.name, "hash": record.hash, "seed": args.seed}
    said = [f"import it by: {content['import']}"] if args.as_log else []
    return answer(args, content | {"samples": len(record.time)}, 0, *said, path)


_STYLE = ("--units", "--jitter", "--gaps", "--counts")


def _write_log(record: Record, path: Path, args: argparse.Namespace) -> str:
    """Write a record as a log, and return the line that imports it."""
    import shlex

    from flexaxis.experiments.logs.as_log import logged, write_log
    from flexaxis.sim.streams import stream

    style = style_of(args)
    write_log(path, logged(record, style, stream(record.hash, args.seed, "log")), style)
    return shlex.join(["flexaxis", "import", str(path), "--torque-is", "held"])
