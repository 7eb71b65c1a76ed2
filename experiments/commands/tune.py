"""Find the setting of an estimator's knob that matches the reference's standard deviation.

On the nominal axis without a fault, started at the truth, over the seeds meant for tuning; the
reference is rpem-forgetting at its default. What is reported elsewhere is on other seeds. With
--minimize lag, other options are chosen to be fastest after the fault of a scenario, the knob
matched for each.

example:
  flexaxis tune ekf --match-std
  flexaxis tune --all --match-std --save estimators/tuned.toml
  flexaxis tune cusum-reset --match-std --minimize lag --option reset --scenario fm_step-v1
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

HELP = "find the knob that matches the reference's standard deviation"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", nargs="?")
    parser.add_argument("--all", action="store_true", help="every registered one with a knob")
    parser.add_argument("--match-std", action="store_true", required=True)
    parser.add_argument("--minimize", choices=["lag"], help="turn other options, too")
    parser.add_argument("--option", action="append", default=[], metavar="NAME", help="which")
    parser.add_argument("--scenario", metavar="SCENARIO", help="and after which fault")
    parser.add_argument("--seeds", default="0:16", metavar="N or A:B", help="default: 0:16")
    parser.add_argument("--save", type=Path, metavar="FILE", help="write it to this TOML file")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def main(args: argparse.Namespace) -> int:
    """Tune and print."""
    from dataclasses import asdict

    from flexaxis.experiments.cache import default_cache
    from flexaxis.experiments.results import dumps
    from flexaxis.experiments.seeds import parse_seeds
    from flexaxis.experiments.tuning import Bench, save

    names = _names(args)
    _can_be_saved(args.save)
    bench = Bench(parse_seeds(args.seeds), args.jobs, default_cache())
    found = {}
    for name in names:
        found[name] = tuned = _tune(name, args, bench)
        if args.save:
            save(args.save, name, tuned, command=_command(name, args), scenario=args.scenario)
        if not args.json:
            each = ", ".join(f"{p} {ratio:.2f}" for p, ratio in tuned.ratios.items())
            lag = "" if tuned.lag is None else f"; lag {tuned.lag:.3f} s on {args.scenario}"
            print(f"{tuned.setting}: std {tuned.ratio:.3f} times the reference's ({each}){lag}")
    if args.json:
        results = {name: asdict(tuned) for name, tuned in found.items()}
        print(dumps(results if args.all else results[args.estimator]))
    return 0


def _names(args: argparse.Namespace) -> list[str]:
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.sim.errors import FlexaxisError

    if args.all == (args.estimator is not None):
        raise FlexaxisError("name one estimator, or give --all")
    if bool(args.minimize) != bool(args.option and args.scenario):
        raise FlexaxisError("--minimize lag, --option and --scenario go together")
    return [n for n, e in REGISTRY.items() if e.knob] if args.all else [args.estimator]


def _can_be_saved(path: Path | None) -> None:
    """Refuse a place that cannot be written before the tuning, which takes long."""
    from flexaxis.experiments.results import OutputError

    if path is None:
        return
    folder = path.parent
    if path.is_dir() or not folder.is_dir():
        reason = "it is a folder" if path.is_dir() else f"there is no folder {folder}"
    elif not os.access(path if path.exists() else folder, os.W_OK):
        reason = "that is not permitted"
    else:
        return
    raise OutputError(f"--save {path}: cannot be written: {reason}. Nothing was tuned")


def _tune(name: str, args: argparse.Namespace, bench):
    from flexaxis.experiments.catalogue import find_scenario
    from flexaxis.experiments.tuning import least_lag, match_std

    if args.minimize:
        return least_lag(name, args.option, find_scenario(args.scenario), bench)
    return match_std(name, bench)


def _command(name: str, args: argparse.Namespace) -> str:
    """Return what finds this setting again."""
    words = ["flexaxis tune", name, "--match-std", "--seeds", args.seeds]
    if args.minimize:
        words += ["--minimize lag", *(f"--option {o}" for o in args.option)]
        words += ["--scenario", args.scenario]
    return " ".join(words)
