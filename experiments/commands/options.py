"""The registry of commands and their options, and the function that prints results."""

import argparse
import json
import os
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flexaxis.experiments.logs.options import LOG_OPTIONS, assignment

Args = argparse.Namespace
Main = Callable[[Args], int]


COMMANDS: dict[str, tuple[Main, tuple[str, ...]]] = {}
"""Functions and option names of all commands, keyed by command name."""


def command(*options: str) -> Callable[[Main], Main]:
    """Return a decorator that registers a function as a command of the same name.

    The docstring of the function is the help text of the command.

    Parameters
    ----------
    *options : str
        Names of the options that the command accepts. `OPTIONS` defines these options.
    """

    def register(main: Main) -> Main:
        COMMANDS[main.__name__.rstrip("_")] = main, options
        return main

    return register


def part(text: str) -> tuple[int, int]:
    """Parse "I/N" into the shard number I and the number of shards N."""
    number, every = map(int, text.split("/"))
    if not 1 <= number <= every:
        raise ValueError(text)
    return number, every


PATH, SEVERAL = {"type": Path}, {"action": "append", "default": []}
VALUES = {**SEVERAL, "type": assignment}
LISTED = {"action": "extend", "default": [], "type": lambda text: text.split(",")}
NUMBER, WHOLE, ZERO = {"type": float}, {"type": int}, {"type": int, "default": 0}
NAMES = "Names of suites or scenarios from `flexaxis list`, or paths of TOML files"
ESTIMATOR = (
    "Name of an estimator from `flexaxis list estimators`, optionally with settings, such as "
    "ekf[walk=0.1]"
)
SEEDS = "Random seeds, given as N (N seeds from 1000 onwards) or as A:B (the seeds A to B-1)"
OWN = "For your own estimator, give file.py:Class, module:Class or pipe:COMMAND."

OPTIONS: dict[str, str | tuple[str, Mapping[str, Any]]] = {
    "-q": "Print only results and errors (default: also print progress messages).",
    "--traceback": "Print the full Python traceback after a crash (default: print one line).",
    "--json": "Print the result as one JSON object (default: print tables and sentences).",
    # inputs
    "names SUITE|SCENARIO": (f"{NAMES} (required unless you use --from).", {"nargs": "*"}),
    "compare: names SUITE|SCENARIO|RUN": (
        f"{NAMES} (default: the suite 'gate'). To compare two finished runs, give the paths of "
        "their results folders.", {"nargs": "*"},
    ),
    "scenario SCENARIO": "Name of a scenario, or path of a scenario file (TOML).",
    "name SCENARIO|SUITE|ESTIMATOR": "Name of a scenario, suite or estimator, or path of a TOML "
    "file.",
    "kind KIND": (
        "What to list: scenarios, suites, estimators or faults (default: scenario groups and "
        "suites).",
        {"nargs": "?", "choices": ("scenarios", "suites", "estimators", "faults")},
    ),
    "file STUDY.toml": ("TOML file that defines the study (see docs/studies.md).", PATH),
    "record RECORD.nc": ("Record file that `flexaxis simulate` or `flexaxis import` wrote.", PATH),
    "folder DIR": ("Folder with the results of a run or a study.", PATH),
    "path FILE.py|c|m": ("File to write, in Python (.py), C (.c) or GNU Octave (.m).", PATH),
    "estimator ESTIMATOR": f"{ESTIMATOR}. {OWN}",
    "estimators ESTIMATOR": (
        "Estimators to tune (default: all registered estimators with a tuning parameter).",
        {"nargs": "*"},
    ),
    "log LOG|REC.nc": ("Path of a log (CSV, MAT, HDF5 or NetCDF) or of a record.", PATH),
    "identify: log LOG|REC.nc|FOLDER": ("Path of a log, a record, or a folder of logs.", PATH),
    "lesson LESSON.toml": (
        "TOML file with a lesson, which is a list of timed actions that replace mouse clicks "
        "(default: no lesson).",
        {"nargs": "?", **PATH},
    ),
    # which runs
    "--estimator E": (f"{ESTIMATOR} (default: the estimators of the suite). {OWN} Repeat the "
                      "option for several estimators.", SEVERAL),
    "estimate: --estimator E": (f"{ESTIMATOR} (default: %(default)s). {OWN}",
                                {"default": "rpem-forgetting"}),
    "track: --estimator E": f"{ESTIMATOR} (default: ekf, or glr for an axis with dry friction). "
    f"{OWN}",
    "demo: --estimator E": (f"{ESTIMATOR} (default: the estimators that the lesson names, "
                            f"else rpem-forgetting and glr). {OWN} Give the option twice, once for "
                            "each of the two estimators.", SEVERAL),
    "--base E": "Reference estimator for the comparison, such as old.py:Mine.",
    "--candidate E": "Estimator to compare with the base estimator, such as new.py:Mine.",
    "--seeds N|A:B": f"{SEEDS}. By default, the command uses as many seeds as the suite specifies, "
    "or 8 seeds for single scenarios. Use the seeds 0 to 99 for tuning, and the seeds 1000 to 4999 "
    "for results.",
    "compare: --seeds N|A:B": f"{SEEDS}. By default, the command uses as many seeds as the suite "
    "specifies, or 32 seeds for single scenarios. For two finished runs, the default is all seeds "
    "that both runs contain.",
    "tune: --seeds N|A:B": f"{SEEDS} (default: 0:16).",
    "--sample N": ("Repeat only N runs, evenly spaced in the list of runs (default: repeat all "
                   "runs).", ZERO),
    "--seed N": ("Random seed (default: 0). Simulations of a scenario with the same seed are "
                 "identical.", ZERO),
    "demo: --seed N": ("Random seed of the excitation and the noise (default: the seed that the "
                       "lesson gives, else 0).", WHOLE),
    # how to run
    "--jobs N": ("Number of worker processes (default: one process per processor core, "
                 "%(default)s on this computer). The number of processes does not affect the "
                 "results.",
                 {"type": int, "default": os.cpu_count() or 1}),
    "--dask ADDRESS": "Address of a Dask scheduler, which distributes the runs over a cluster "
    "(default: use only this computer).",
    "--shard I/N": ("Divide the runs into N shards, and execute only shard I (default: 1/1). The "
                    "command `flexaxis run --from` merges finished shards.",
                    {"type": part, "default": (1, 1)}),
    "--from DIR": ("Folders of finished shards to merge into the output folder (default: "
                   "merge no shards). With --from, the command runs no estimators.",
                   {"dest": "shards", "nargs": "+", **PATH}),
    "--overwrite": "Delete the old results in the output folder first (default: keep the old "
    "results, and add only missing runs).",
    "--time-limit S": ("Time limit for one run of your own estimator [s] (default: 600).", NUMBER),
    "--dry-run": "Print the planned variants and the estimated time and disk space, but run no "
    "estimator (default: run the study).",
    # what to list
    "--group GROUP": ("List only one group of scenarios, such as steps (default: all groups).",
                      {"default": ""}),
    "--find TEXT": ("List only entries that contain this text (default: all entries).",
                    {"default": ""}),
    "--all": "Print all lines of the list (default: print at most 60 lines).",
    # how to judge
    "--max-seeds N": ("Add seeds while the verdict is undecided, up to N seeds in total (default: "
                      "add no seeds).", ZERO),
    "--margin SCORE=%[,…]": (
        "Largest relative change in a score that counts as negligible (default: lag=2%%,std=2%%). "
        "SCORE is lag, std, t10, std_after, cross_talk or excess.", {"default": ""},
    ),
    "--match-std": "Tune both estimators to the same noise, and compare only the lag (default: "
    "compare the estimators without tuning).",
    "--strict": "Use exit status 3 for every undecided verdict (default: only if runs of the "
    "candidate are missing, failed or diverged).",
    "--sweep SCENARIO": ("Run each estimator with several settings on this scenario instead of "
                         "tuning the estimator (default: no sweep). Repeat the option for several "
                         "scenarios.", SEVERAL),
    "--save FILE.toml": ("Write the tuned settings to this file (default: only print the "
                         "settings).", PATH),
    # logs of a real axis
    "--model MODEL": ("Name of an axis model (one_mass, two_mass or three_mass), or path of a TOML "
                      "file (default: %(default)s).", {"default": "two_mass"}),
    "track: --model AXIS.toml": ("Axis file that `flexaxis identify` wrote.",
                                 {"required": True}),
    "--free PARAMETER": ("Identify only this parameter (default: all parameters that the log "
                         "determines). For several parameters, separate the names with commas "
                         "(J_m,k) or repeat the option.", LISTED),
    "--fix PARAMETER[=VALUE]": ("Hold this parameter constant at VALUE [SI] (default: hold no "
                                "parameter). Without VALUE, hold the parameter at its start value. "
                                "Repeat the option for several parameters.", VALUES),
    "identify: --start PARAMETER=VALUE": ("Start value [SI] of a parameter for the search "
                                          "(default: estimated from the log). Repeat the option "
                                          "for several parameters.", VALUES),
    "track: --start F": ("Ratio of the initial estimate to the identified value, for convergence "
                         "tests (default: 1).", {"type": float, "default": 1.0}),
    "--delay S": ("Known torque delay [s] (default: identify the delay from the log).", NUMBER),
    "--friction LAW": (
        "Dry-friction model of the motor: none, coulomb, stribeck or auto (the model that best "
        "simulates held-out segments of the log; default).", {"default": "auto"},
    ),
    "--gravity LAW": ("Gravity model: none, sine (a weighted sum of the sine and cosine of the "
                      "angle) or auto (sine if the log shows gravity, else none; default).",
                      {"default": "auto"}),
    "--validate OTHER": ("Second log, on which the command tests the identified model (default: no "
                         "test).", PATH),
    "--identify PARAMETER": (
        "Parameter to track, or the inverse of a parameter, such as 1/J_l. For several parameters, "
        "separate the names with commas (1/J_l,k) or repeat the option.",
        {"required": True, **LISTED},
    ),
    "--covariate NAME": ("Name of a log column, such as temp, whose values can explain differences "
                         "between the logs in a folder (default: no column). Repeat the option for "
                         "several columns.", SEVERAL),
    "--false-alarms P": ("Probability that the report on a folder of logs shows a change although "
                         "no parameter changed (default: 0.01).",
                         {"type": float, "default": 0.01}),
    # the live axis
    "--port N": ("Network port of the demo page (default: 8080 or, if 8080 is in use, the next "
                 "free port).", WHOLE),
    "--no-browser": "Only print the address of the demo page (default: also open a browser).",
    # outputs
    "-o PATH": "Path of the output file or folder (default: a path next to the input file).",
    "run: -o DIR": "Output folder for the scores, summary and report (default: results/NAME, where "
    "NAME is the first suite or scenario).",
    "study: -o DIR": "Output folder for the scores and the report (default: results/NAME, where "
    "NAME.toml is the study file).",
    "compare: -o DIR": "Output folder for the scores, verdict and report (default: "
    "results/compare).",
    "tune: -o DIR": "Output folder for the scores and the figure (default: results/tune).",
    "simulate: -o FILE": "Output file for the record or the log (default: the file "
    "SCENARIO-SEED.nc, or SCENARIO-SEED.csv for a log).",
    "estimate: -o FILE": "Output file for the estimates (default: the file RECORD-estimates.nc).",
    "import: -o REC.nc": "Output file for the record (default: the file LOG-imported.nc).",
    "identify: -o AXIS.toml": "Output file for the identified axis or, for a folder of logs, "
    "for the estimates (default: the file LOG-axis.toml or FOLDER-estimates.csv).",
    "track: -o EST.nc": "Output file for the estimates (default: the file LOG-track.nc).",
    "paper: -o DIR": "Output folder for the figures and claims (default: results/paper).",
    **LOG_OPTIONS,
}  # fmt: skip
"""All options of all commands.

Each key contains the name and the metavar of an option. Each value is the help text of the option,
or a tuple of the help text and keyword arguments of `add_argument`. An option without a metavar is
a flag. A key with a prefix, such as `track:`, applies only to the command in the prefix, and takes
precedence over the key without the prefix. Each help text contains the unit and the default value.
"""


def add_options(parser: argparse.ArgumentParser, name: str) -> None:
    """Add the options of a command to its argument parser."""
    declared = {}
    for key, value in OPTIONS.items():
        only, _, words = key.rpartition(": ")
        option, _, metavar = words.partition(" ")
        if only in ("", name):
            declared[option] = metavar, value
    for option in (*COMMANDS[name][1], "-q", "--traceback", "--json"):
        metavar, value = declared[option]
        usual = PATH if option == "-o" else {}
        text, more = (value, usual) if isinstance(value, str) else value
        takes = {"metavar": metavar} if metavar else {"action": "store_true"}
        long = {"-o": ("--output",), "-q": ("--quiet",)}.get(option, ())
        parser.add_argument(option, *long, help=text, **{**takes, **more})  # type: ignore[arg-type]


def answer(args: Args, content: Mapping[str, Any], status: int = 0, *lines: object) -> int:
    """Print the result of a command as lines of text or, with ``--json``, as one JSON object.

    Parameters
    ----------
    args : Args
        Parsed arguments of the command line.
    content : mapping
        Result that the function prints with ``--json``. In the JSON object, null replaces infinite
        numbers and NaN.
    status : int
        Exit status of the command, which is also the return value of this function.
    *lines : object
        Result that the function prints without ``--json``. Each object is a line or a block of
        text.
    """
    if args.json:
        head = {"flexaxis": version("flexaxis"), "command": args.command, "status": status,
                "line": args.line}  # fmt: skip
        text = json.dumps({**head, **content, **head}, default=_plain)
        finite = json.loads(text, parse_constant=lambda name: None)
        lines = (json.dumps(finite, ensure_ascii=False),)
    try:
        print(*lines, sep="\n", flush=True)
    except BrokenPipeError:  # another program, such as `head`, has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return status


def _plain(value: Any) -> Any:
    """Convert an array, a NumPy number or a path to a value that JSON can represent."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
