r"""Find the setting of an estimator's knob at which it is as noisy as the reference.

On the nominal axis without a fault, started at the truth, over the seeds meant for tuning; the
reference is rpem-forgetting at its default. What is equal is the excess prediction error, one
number for all parameters, or with --match the standard deviation of one of them. What is reported
elsewhere is on other seeds. A match takes at most 12 settings, from 1/1024 to 1024 times the usual
one.

With --sweep each estimator runs at many settings of its knob instead, and the lags after the faults
of some scenarios are compared at equal noise, beside the bound. A row that begins with "at most" is
of an estimator that is quieter than the reference at every setting, "at least" of one that is
noisier. It writes sweep.json and sweep.svg.

example:
  flexaxis tune ekf
  flexaxis tune ekf --match f_m
  flexaxis tune --all --save
  flexaxis tune rpem-forgetting glr --sweep fm_step kt_step
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
from flexaxis.experiments.files import OutputError, write_json
from flexaxis.experiments.seeds import parse_seeds
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.comparison.tune import Tuned

HELP = "find the knob at which an estimator is as noisy as the reference, or sweep it"

SWEPT = ("rpem-forgetting", "rpem-drift", "ekf", "glr")
"""What --sweep compares where no estimator is named."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", nargs="*")
    parser.add_argument("--all", action="store_true", help="every registered one with a knob")
    parser.add_argument(
        "--match", default="excess", metavar="NAME",
        help="what is to be equal: excess, or a parameter whose std is (default: excess)",
    )  # fmt: skip
    parser.add_argument(
        "--sweep", nargs="+", metavar="SUITE|SCENARIO",
        help="compare the estimators over all settings of their knobs on these scenarios",
    )  # fmt: skip
    parser.add_argument(
        "--seeds", metavar="N or A:B", help="default: 0:16, with --sweep 1000 to 1015"
    )
    parser.add_argument(
        "--save", type=Path, nargs="?", const=True, metavar="FILE",
        help="write it to this TOML file (default: the one that the registry reads)",
    )  # fmt: skip
    options.add_jobs(parser, what="the settings do")
    add_output(parser, "DIR", "default: results/tune/ESTIMATOR, with --sweep results/sweep")
    options.add_resume(parser)
    options.add_time_limit(parser)


def main(args: argparse.Namespace) -> int:
    """Tune, or sweep, and print."""
    return _sweep(args) if args.sweep else _tune(args)


def _sweep(args: argparse.Namespace) -> int:
    """Sweep the knobs, match the noise and draw."""
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.comparison.ranking import overall
    from flexaxis.experiments.comparison.sweep import TURNS, reference, settings, sweep, texts
    from flexaxis.experiments.reporting.figures import speed_noise
    from flexaxis.experiments.reporting.terminal import equal_noise_table, show
    from flexaxis.experiments.reporting.words import fault_words, faults_of

    scenarios, *_ = select(args.sweep)
    estimators = list(dict.fromkeys(args.estimator)) or [*SWEPT]
    seeds = parse_seeds(args.seeds or "16")
    command, folder = options.line(args), args.output or Path("results/sweep")
    most = len(texts(settings(estimators, factors=TURNS))) * len(scenarios) * len(seeds)
    with options.working(args, f"at most {most} cases", most, folder) as (runner, _):
        swept = sweep(scenarios, estimators, seeds, runner.rows)
        ranking = overall(swept.at_excess)
        content: dict[str, Any] = {"command": command, "seeds": seeds, "reference": reference()}
        content |= asdict(swept) | {"overall": ranking}
        content |= {"definitions": {s.name: s.resolved() for s in scenarios}}
        path = folder / "sweep.svg"
        speed_noise(faults_of(swept.points), estimators, fault_words(content)).savefig(path)
        write_json(folder / "sweep.json", content)
    table = equal_noise_table(content, len(seeds))
    return answer(args, content | {"figure": path}, 0, path, show=lambda: show(table))


def _tune(args: argparse.Namespace) -> int:
    """Tune and print."""
    from flexaxis.experiments.comparison.tune import (
        Trials,
        match_noise,
        save_setting,
    )
    from flexaxis.experiments.running.user_code import is_of_the_machine

    names, path = _names(args), _file(args)
    seeds = args.seeds or "0:16"
    found: list[dict[str, Any]] = []
    missed: list[str] = []
    folder = args.output or Path("results") / "tune" / _folder("all" if args.all else names[0])
    # How many cases it takes is not known: the progress is that of the settings found.
    work = options.working(args, f"{len(names)} to tune", len(names), folder, by_case=False)
    with work as (runner, advance):
        for name in names:
            try:
                trials = Trials(parse_seeds(seeds), runner.rows, args.match)
                tuned = match_noise(name, trials)
            except FlexaxisError as error:
                if not args.all or is_of_the_machine(error):
                    raise
                print(error, file=sys.stderr)  # the others can still be tuned
                missed.append(name)
                if path:
                    save_setting(path, name, None)
                continue
            finally:
                advance(1)
            if path:
                more = [] if args.match == "excess" else ["--match", args.match]
                words = ["flexaxis tune", name, "--seeds", seeds, *more]
                save_setting(path, name, tuned, command=" ".join(words))
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

    if args.all == bool(args.estimator) or len(args.estimator) > 1:
        eaten = f" (--save took {args.save} for its FILE)" if isinstance(args.save, Path) else ""
        raise FlexaxisError(f"name one estimator, or give --all{eaten}")
    if args.all and args.match != "excess":
        raise FlexaxisError(
            "--all tunes all as the file of the registry has them, at equal excess error: leave "
            "--match out, or name one estimator"
        )
    return [name for name, e in REGISTRY.items() if e.knob] if args.all else args.estimator


def _file(args: argparse.Namespace) -> Path | None:
    """Return where to write; refuse what cannot be, before the tuning, which takes long."""
    from flexaxis.estimators import tuned
    from flexaxis.experiments.running.user_code import names_code

    if args.save is None:
        return None
    if args.save is True and args.estimator and names_code(args.estimator[0]):
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
