"""Find the setting of an estimator's knob at which it is as noisy as the reference.

On the nominal axis without a fault, started at the truth, over the seeds meant for tuning; the
reference is rpem-forgetting at its default. What is equal is the excess prediction error, one
number for all parameters, or with --match the standard deviation of one of them. What is reported
elsewhere is on other seeds. A match takes at most 12 settings, from 1/1024 to 1024 times the usual
one.

example:
  flexaxis tune ekf
  flexaxis tune ekf --match f_m
  flexaxis tune --all --save
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.seeds import parse_seeds
from flexaxis.experiments.storage.files import OutputError
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.studies.tuning import Tuned

HELP = "find the knob at which an estimator is as noisy as the reference"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", nargs="?")
    parser.add_argument("--all", action="store_true", help="every registered one with a knob")
    parser.add_argument(
        "--match", default="excess", metavar="NAME",
        help="what is to be equal: excess, or a parameter whose std is (default: excess)",
    )  # fmt: skip
    parser.add_argument("--seeds", default="0:16", metavar="N or A:B", help="default: 0:16")
    parser.add_argument(
        "--save", type=Path, nargs="?", const=True, metavar="FILE",
        help="write it to this TOML file (default: the one that the registry reads)",
    )  # fmt: skip
    options.add_jobs(parser, what="the settings do")
    add_output(parser, "DIR", "where its runs are kept (default: results/tune/ESTIMATOR)")
    options.add_resume(parser)
    options.add_time_limit(parser)


def main(args: argparse.Namespace) -> int:
    """Tune and print."""
    from flexaxis.experiments.building.crashes import no_room
    from flexaxis.experiments.running.bench import Bench
    from flexaxis.experiments.studies.tuning import (
        Trials,
        forget,
        match_noise,
        save,
        tuning_scenario,
    )

    names, path = _names(args), _file(args)
    found: list[dict[str, Any]] = []
    missed: list[str] = []
    folder = args.output or Path("results") / "tune" / _folder(args.estimator or "all")
    # How many cases it takes is not known: the progress is that of the settings found.
    work = options.working(args, f"{len(names)} to tune", len(names), by_case=False)
    with (
        work as (means, advance),
        Bench([tuning_scenario()], folder, means, overwrite=args.overwrite) as bench,
    ):
        for name in names:
            try:
                tuned = match_noise(name, Trials(parse_seeds(args.seeds), bench, args.match))
            except FlexaxisError as error:
                if not args.all or no_room(error):
                    raise
                print(error, file=sys.stderr)  # the others can still be tuned
                missed.append(name)
                if path:
                    forget(path, name)
                continue
            finally:
                advance(1)
            if path:
                more = [] if args.match == "excess" else ["--match", args.match]
                words = ["flexaxis tune", name, "--seeds", args.seeds, *more]
                save(path, name, tuned, command=" ".join(words))
            found.append(asdict(tuned) | {"estimator": name})
            if not args.json:
                print(_in_words(args.match, tuned), flush=True)
    if missed:
        print(f"not matched, and not in the file: {', '.join(missed)}", file=sys.stderr)
    status = int(bool(missed))
    alone = {} if args.all else found[0]
    return answer(args, alone | {"tuned": found, "missed": missed}, status)


def _in_words(match: str, tuned: Tuned) -> str:
    each = ", ".join(f"{p} {ratio:.2f}" for p, ratio in tuned.ratios.items())
    return f"{tuned.setting}: {match} {tuned.ratio:.3f} times the reference's (std: {each})"


def _names(args: argparse.Namespace) -> list[str]:
    """Return who is to be tuned: one, or all that the file of the registry holds."""
    from flexaxis.estimators.registry import REGISTRY

    if args.all == (args.estimator is not None):
        eaten = f" (--save took {args.save} for its FILE)" if isinstance(args.save, Path) else ""
        raise FlexaxisError(f"name one estimator, or give --all{eaten}")
    if args.all and args.match != "excess":
        raise FlexaxisError(
            "--all tunes all as the file of the registry has them, at equal excess error: leave "
            "--match out, or name one estimator"
        )
    return [name for name, e in REGISTRY.items() if e.knob] if args.all else [args.estimator]


def _file(args: argparse.Namespace) -> Path | None:
    """Return where to write; refuse what cannot be, before the tuning, which takes long."""
    from flexaxis.estimators import tuned
    from flexaxis.experiments.building.guest import is_guest

    if args.save is None:
        return None
    if args.save is True and args.estimator and is_guest(args.estimator):
        raise FlexaxisError(
            "--save without a file writes to that of the registry, which your estimator is not "
            "in: give a file, --save mine.toml"
        )
    path = Path(tuned.__file__).with_name("tuned.toml") if args.save is True else args.save
    folder = path.parent
    if path.is_dir() or not folder.is_dir():
        reason = "it is a folder" if path.is_dir() else f"there is no folder {folder}"
    elif not os.access(path if path.exists() else folder, os.W_OK):
        reason = "that is not permitted"
    else:
        return path
    raise OutputError(f"--save {path}: cannot be written: {reason}. Nothing was tuned")


def _folder(estimator: str) -> str:
    """Return a name for a folder: path/file.py:Class holds what a folder's name may not."""
    return "".join(c if c.isalnum() or c in "-_.=," else "-" for c in estimator)
