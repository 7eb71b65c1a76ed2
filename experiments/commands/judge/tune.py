"""Find the setting of an estimator's knob at which it is as noisy as the reference.

On the nominal axis without a fault, started at the truth, over the seeds meant for tuning; the
reference is rpem-forgetting at its default. What is equal is the excess prediction error, one
number for all parameters, or with --match the standard deviation of one of them. What is reported
elsewhere is on other seeds. With --minimize lag, other options are chosen to be fastest after the
fault of a scenario, the knob matched for each. A match takes at most 12 settings, from 1/1024 to
1024 times the usual one.

example:
  flexaxis tune ekf
  flexaxis tune ekf --match f_m
  flexaxis tune --all --save
  flexaxis tune cusum-reset --minimize lag --option reset --scenario fm_step-v1
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_json, add_output, answer
from flexaxis.experiments.running.seeds import parse_seeds
from flexaxis.experiments.storage.files import OutputError
from flexaxis.sim.errors import FlexaxisError

HELP = "find the knob at which an estimator is as noisy as the reference"
GROUP = "judge"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", nargs="?")
    parser.add_argument(
        "--all",
        action="store_true",
        help="every registered one with a knob, and again whatever is in the file for a scenario",
    )
    parser.add_argument(
        "--match",
        default="excess",
        metavar="NAME",
        help="what is to be equal: excess, or a parameter whose std is (default: excess)",
    )
    parser.add_argument("--minimize", choices=["lag"], help="turn other options, too")
    parser.add_argument("--option", action="append", default=[], metavar="NAME", help="which")
    parser.add_argument("--scenario", metavar="SCENARIO", help="and after which fault")
    parser.add_argument("--seeds", default="0:16", metavar="N or A:B", help="default: 0:16")
    parser.add_argument(
        "--save",
        type=Path,
        nargs="?",
        const=True,
        metavar="FILE",
        help="write it to this TOML file (default: the one that the registry reads)",
    )
    options.add_jobs(parser, what="the settings do")
    add_output(parser, "DIR", "where its runs are kept (default: results/tune/ESTIMATOR)")
    options.add_resume(parser)
    options.add_time_limit(parser)
    add_json(parser)


def main(args: argparse.Namespace) -> int:
    """Tune and print."""
    from flexaxis.experiments.running.bench import Bench

    tasks = _tasks(args)
    path = _file(args.save)
    _check_own(args)
    found: list[dict[str, Any]] = []
    missed: list[str] = []
    scenarios = _scenarios(tasks)
    folder = args.output or Path("results") / "tune" / _folder(args.estimator or "all")
    how = {"overwrite": args.overwrite}
    # How many cases it takes is not known: the progress is that of the settings found.
    what = f"{len(tasks)} to tune"
    with (
        options.working(args, what, len(tasks), by_case=False) as (means, advance),
        Bench(scenarios, folder, means, **how) as bench,
    ):
        for task in tasks:
            tuned = _tuned(task, bench, path, alone=len(tasks) == 1)
            advance(1)
            if tuned is None:
                missed.append(task.estimator)
                continue
            found.append(asdict(tuned) | {"estimator": task.estimator})
            if not args.json:
                print(_in_words(task, tuned), flush=True)
    if missed:
        print(f"not matched, and not in the file: {', '.join(missed)}", file=sys.stderr)
    status = int(bool(missed))
    alone = {} if args.all else found[0]
    return answer(args, alone | {"tuned": found, "missed": missed}, status) if args.json else status


def _tuned(task: argparse.Namespace, bench: Any, path: Path | None, *, alone: bool) -> Any:
    """Return what was found, after it was saved; None where nothing was, if others may follow."""
    from flexaxis.experiments.studies.tuned_file import forget, save
    from flexaxis.experiments.studies.tuning import Trials

    try:
        tuned = _tune(task, Trials(parse_seeds(task.seeds), bench, task.match))
    except FlexaxisError as error:
        if alone:
            raise
        print(error, file=sys.stderr)  # the others can still be tuned
        if path:
            forget(path, task.estimator, scenario=task.scenario)
        return None
    if path:
        save(path, task.estimator, tuned, command=_command(task), scenario=task.scenario)
    return tuned


def _in_words(task: argparse.Namespace, tuned: Any) -> str:
    each = ", ".join(f"{p} {ratio:.2f}" for p, ratio in tuned.ratios.items())
    lag = "" if tuned.lag is None else f"; lag {tuned.lag:.3f} s on {task.scenario}"
    return (
        f"{tuned.setting}: {task.match} {tuned.ratio:.3f} times the reference's (std: {each}){lag}"
    )


def _scenarios(tasks: list[argparse.Namespace]) -> list[Any]:
    """Return all scenarios that tuning will run on."""
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.studies.tuning import tuning_scenario

    names = dict.fromkeys(task.scenario for task in tasks if task.scenario)
    return [tuning_scenario(), *map(find_scenario, names)]


def _file(given: Path | bool | None) -> Path | None:
    """Return where to write, and try it before an hour of tuning."""
    from flexaxis.estimators import tuned

    if given is None:
        return None
    own = Path(tuned.__file__).with_name("tuned.toml")
    path = given if isinstance(given, Path) else own
    _can_be_saved(path)
    return path


def _check_own(args: argparse.Namespace) -> None:
    """Refuse to write an estimator of a user to the file of the registry."""
    from flexaxis.experiments.building.guest import is_guest

    if args.save is True and args.estimator and is_guest(args.estimator):
        raise FlexaxisError(
            "--save without a file writes to that of the registry, which your estimator is not "
            "in: give a file, --save mine.toml"
        )


def _folder(estimator: str) -> str:
    """Return a name for a folder: path/file.py:Class holds what a folder's name may not."""
    return "".join(c if c.isalnum() or c in "-_.=," else "-" for c in estimator)


def _can_be_saved(path: Path) -> None:
    """Refuse a place that cannot be written before the tuning, which takes long."""
    folder = path.parent
    if path.is_dir() or not folder.is_dir():
        reason = "it is a folder" if path.is_dir() else f"there is no folder {folder}"
    elif not os.access(path if path.exists() else folder, os.W_OK):
        reason = "that is not permitted"
    else:
        return
    raise OutputError(f"--save {path}: cannot be written: {reason}. Nothing was tuned")


def _tasks(args: argparse.Namespace) -> list[argparse.Namespace]:
    """Return what is to be tuned: one, or all that the file of the registry holds."""
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.estimators.tuned import tunings

    if args.all == (args.estimator is not None):
        eaten = f" (--save took {args.save} for its FILE)" if isinstance(args.save, Path) else ""
        raise FlexaxisError(f"name one estimator, or give --all{eaten}")
    if args.all and (args.minimize or args.option or args.scenario or args.match != "excess"):
        raise FlexaxisError(
            "--all tunes all as the file of the registry has them, at equal excess error: leave "
            "--match, --minimize, --option and --scenario out, or name one estimator"
        )
    if bool(args.minimize) != bool(args.option and args.scenario):
        raise FlexaxisError("--minimize lag, --option and --scenario go together")
    if not args.all:
        return [args]
    parser = argparse.ArgumentParser()
    configure(parser)
    words = [[n, "--seeds", args.seeds] for n, e in REGISTRY.items() if e.knob]
    words += [t.command.split()[2:] for t in tunings() if t.scenario]
    return [parser.parse_args(each) for each in words]


def _tune(task: argparse.Namespace, trials: Any) -> Any:
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.studies.tuning import least_lag, match_noise

    if task.minimize:
        return least_lag(task.estimator, task.option, find_scenario(task.scenario), trials)
    return match_noise(task.estimator, trials)


def _command(task: argparse.Namespace) -> str:
    """Return what finds this setting again."""
    words = ["flexaxis tune", task.estimator, "--seeds", task.seeds]
    if task.match != "excess":
        words += ["--match", task.match]
    if task.minimize:
        words += ["--minimize lag", *(f"--option {o}" for o in task.option)]
        words += ["--scenario", task.scenario]
    return " ".join(words)
