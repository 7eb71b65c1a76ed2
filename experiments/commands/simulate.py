"""Simulate one run of a scenario and save the record: what was measured, and the truth.

example:
  flexaxis simulate fm_step-v1 --seed 0 -o rec.nc
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "simulate a scenario and save the record (NetCDF-4)"
GROUP = "run"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scenario", metavar="SCENARIO", help="catalogue name or TOML path")
    parser.add_argument("--seed", type=int, default=0, help="number of the run (default 0)")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="default: SCENARIO-SEED.nc"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def main(args: argparse.Namespace) -> int:
    """Simulate and save."""
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.running.files import dumps
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.experiments.running.progress import progress
    from flexaxis.sim.simulate import simulate

    scenario = find_scenario(args.scenario)
    path = args.output or Path(f"{scenario.name}-{args.seed}.nc")
    spare([args.scenario], path)
    with progress(f"simulating {scenario.name}", 1.0) as advance:
        done = 0.0

        def report(fraction: float) -> None:
            nonlocal done
            advance(fraction - done)
            done = fraction

        record = simulate(scenario, [args.seed], progress=report)[0]
    record.save(path)
    if args.json:
        content = {"record": str(path), "scenario": scenario.name, "hash": record.hash}
        print(dumps(content | {"seed": args.seed, "samples": len(record.time)}))
    else:
        print(path)
    return 0
