"""Find the setting of an estimator's knob that matches the reference's standard deviation.

On the nominal axis without a fault, started at the truth, over the seeds meant for tuning; the
reference is rpem-forgetting at its default. What is reported elsewhere is on other seeds.

example:
  flexaxis tune ekf --match-std --seeds 0:16
"""

from __future__ import annotations

import argparse
import os

HELP = "find the knob that matches the reference's standard deviation"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR")
    parser.add_argument("--match-std", action="store_true", required=True)
    parser.add_argument("--seeds", default="0:16", metavar="N or A:B", help="default: 0:16")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def main(args: argparse.Namespace) -> int:
    """Tune and print."""
    from dataclasses import asdict

    from flexaxis.experiments.cache import default_cache
    from flexaxis.experiments.results import dumps
    from flexaxis.experiments.seeds import parse_seeds
    from flexaxis.experiments.tuning import match_std

    seeds = parse_seeds(args.seeds)
    found = match_std(args.estimator, seeds, jobs=args.jobs, store=default_cache())
    if args.json:
        print(dumps(asdict(found)))
        return 0
    each = ", ".join(f"{name} {ratio:.2f}" for name, ratio in found.ratios.items())
    print(f"{found.setting}: std {found.ratio:.3f} times the reference's ({each})")
    return 0
