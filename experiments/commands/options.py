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
"""Function and option names of each command, keyed by the name of the command."""


def command(*options: str) -> Callable[[Main], Main]:
    """Return a decorator that registers a function as a command of the same name.

    The docstring of the function is the help text of the command.

    Parameters
    ----------
    *options : str
        Names of the command's options, which `OPTIONS` defines.
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
NUMBER, WHOLE, ZERO = {"type": float}, {"type": int}, {"type": int, "default": 0}
NAMES = "Suites and scenarios: names from `flexaxis list`, or paths to TOML files"
ESTIMATOR = (
    "Estimator: a name from `flexaxis list estimators`, optionally with options as in "
    "ekf[walk=0.1]; or your own, as file.py:Class, module:Class or pipe:COMMAND"
)

OPTIONS: dict[str, str | tuple[str, Mapping[str, Any]]] = {
    "-q": "Print only results and errors (default: print progress, too).",
    "--traceback": "Print the full traceback of a crash (default: one line).",
    "--json": "Print one JSON object on stdout, and nothing else (default: tables and sentences).",
    # inputs
    "names SUITE|SCENARIO": (f"{NAMES} (required unless --from is given).", {"nargs": "*"}),
    "compare: names SUITE|SCENARIO|RUN": (
        f"{NAMES} (default: the suite gate). Instead, you can give the folders of two finished "
        "runs.", {"nargs": "*"},
    ),
    "scenario SCENARIO": "Name of a scenario, or path of its TOML file.",
    "name SCENARIO|SUITE|ESTIMATOR": "Name of a scenario, suite or estimator, or path of a TOML "
    "file.",
    "kind KIND": (
        "Entries to list: scenarios, suites, estimators, or faults with the scenarios for each "
        "fault (default: the groups of scenarios, and the suites).",
        {"nargs": "?", "choices": ("scenarios", "suites", "estimators", "faults")},
    ),
    "file STUDY.toml": ("TOML file that defines the study (see docs/studies.md).", PATH),
    "record RECORD.nc": ("Record that `flexaxis simulate` or `flexaxis import` wrote.", PATH),
    "folder DIR": ("Results folder of a run or a study.", PATH),
    "path FILE.py|c|m": ("File to write: Python (.py), C (.c) or GNU Octave (.m).", PATH),
    "estimator ESTIMATOR": f"{ESTIMATOR}.",
    "estimators ESTIMATOR": (
        "Estimators to tune (default: all registered estimators with a tuning parameter).",
        {"nargs": "*"},
    ),
    "log LOG|REC.nc": ("Log (CSV, MAT, HDF5 or NetCDF), or record.", PATH),
    "identify: log LOG|REC.nc|FOLDER": ("Log, record, or folder of logs.", PATH),
    "lesson LESSON.toml": (
        "TOML file with timed actions that replace clicks (default: none).",
        {"nargs": "?", **PATH},
    ),
    # which runs
    "--estimator E": (f"{ESTIMATOR}. Repeat the option for several estimators (default: the "
                      "estimators of the suite).", SEVERAL),
    "estimate: --estimator E": (f"{ESTIMATOR} (default: %(default)s).",
                                {"default": "rpem-forgetting"}),
    "track: --estimator E": f"{ESTIMATOR} (default: ekf, or glr for an axis with dry friction).",
    "demo: --estimator E": (f"{ESTIMATOR}. Give the option twice. Both estimators run on the same "
                            "data (default: the estimators of the lesson, else rpem-forgetting and "
                            "glr).", SEVERAL),
    "--base E": "Estimator to compare the candidate with, such as old.py:Mine.",
    "--candidate E": "Estimator to test against the base, such as new.py:Mine.",
    "--seeds N|A:B": "Seeds: N seeds starting at 1000, or the seeds A to B-1. Use the seeds 0 to "
    "99 for tuning, and 1000 to 4999 for results (default: the number of seeds of the suite, or 8 "
    "for single scenarios).",
    "compare: --seeds N|A:B": "Seeds: N seeds starting at 1000, or the seeds A to B-1 (default: "
    "the number of seeds of the suite, 32 for single scenarios, or the common seeds of two "
    "finished runs).",
    "tune: --seeds N|A:B": "Seeds: N seeds starting at 1000, or the seeds A to B-1 (default: "
    "0:16).",
    "--sample N": ("Run only N cases, evenly spaced among all cases (default: run all cases).",
                   ZERO),
    "--seed N": ("Random seed: the same seed gives the same run (default: 0).", ZERO),
    "demo: --seed N": ("Random seed of excitation and noise (default: the lesson's seed, or 0).",
                       WHOLE),
    # how to run
    "--jobs N": ("Number of worker processes, which does not affect the results (default: one per "
                 "core, here %(default)s).", {"type": int, "default": os.cpu_count() or 1}),
    "--dask ADDRESS": "Address of the scheduler of a Dask cluster that runs the cases (default: "
    "processes on this machine).",
    "--shard I/N": ("Run only shard I of N. `flexaxis run --from` merges finished shards (default: "
                    "1/1).", {"type": part, "default": (1, 1)}),
    "--from DIR": ("Merge the finished shards in these folders into the folder given by -o, "
                   "without running any case (default: none).",
                   {"dest": "shards", "nargs": "+", **PATH}),
    "--overwrite": "Delete the old contents of the folder first (default: keep them, and run only "
    "missing cases).",
    "--time-limit S": ("Time limit for one run of your own code [s] (default: 600).", NUMBER),
    "--dry-run": "Print the variants, the estimated time and the disk space, without running any "
    "case (default: run the cases).",
    # what to list
    "--group GROUP": ("List only one group of scenarios, such as steps (default: all groups).",
                      {"default": ""}),
    "--find TEXT": ("List only entries that contain this text (default: all entries).",
                    {"default": ""}),
    "--all": "Print all lines (default: at most 60).",
    # how to judge
    "--max-seeds N": ("Add seeds, up to N, while the verdict is undecided (default: add none).",
                      ZERO),
    "--margin SCORE=%[,…]": (
        "Largest relative change of a score that counts as negligible, for the scores lag, std, "
        "t10, std_after, cross_talk and excess (default: lag=2%%,std=2%%).", {"default": ""},
    ),
    "--match-std": "Tune both estimators to the same noise first, and compare only the lag "
    "(default: compare the estimators as they are).",
    "--strict": "Exit with status 3 whenever the verdict is undecided (default: only in the cases "
    "listed above).",
    "--sweep SCENARIO": ("Run several settings of each estimator on this scenario, instead of "
                         "tuning. Repeat the option for several scenarios (default: tune).",
                         SEVERAL),
    "--save FILE.toml": ("Also write the settings to this file (default: only print them).", PATH),
    # logs of a real axis
    "--model MODEL": ("Model: one_mass, two_mass, three_mass, or a TOML file (default: "
                      "%(default)s).", {"default": "two_mass"}),
    "track: --model AXIS.toml": ("Axis file that `flexaxis identify` wrote.", {"required": True}),
    "--free PARAMETER": ("Identify only this parameter. Repeat the option for several (default: "
                         "all parameters that the log determines).", SEVERAL),
    "--fix PARAMETER[=VALUE]": ("Hold this parameter at VALUE [SI], or at its start value. Repeat "
                                "the option for several (default: hold none).", VALUES),
    "identify: --start PARAMETER=VALUE": ("Start value of a parameter for the search [SI]. Repeat "
                                          "the option for several (default: estimated from the "
                                          "log).", VALUES),
    "track: --start F": ("Initial estimate as a multiple of the identified value, to test "
                         "convergence (default: 1).", {"type": float, "default": 1.0}),
    "--delay S": ("Known delay of the torque [s] (default: the delay is identified).", NUMBER),
    "--friction LAW": (
        "Dry friction of the motor: none, coulomb or stribeck (default: auto, which chooses the "
        "law that best simulates held-out pieces of the log).", {"default": "auto"},
    ),
    "--gravity LAW": ("Gravity torque: none, or sine for a sum of sine and cosine of the angle "
                      "(default: auto, which chooses sine if the log contains such a torque).",
                      {"default": "auto"}),
    "--validate OTHER": ("Second log, for testing the simulations and predictions of the "
                         "identified model (default: none).", PATH),
    "--identify PARAMETER": (
        "Parameter to track, or its inverse, such as 1/J_l. For several, write 1/J_l,k or repeat "
        "the option.", {"required": True, **SEVERAL},
    ),
    "--covariate NAME": ("Column with a quantity, such as a temperature, that may explain why the "
                         "estimates differ between the logs of a folder. Repeat the option for "
                         "several (default: none).", SEVERAL),
    "--false-alarms P": ("Probability of a false alarm: the report on a folder of logs shows a "
                         "change, although no parameter changed (default: 0.01).",
                         {"type": float, "default": 0.01}),
    # the live axis
    "--port N": ("Port of the page (default: 8080, or the next free port).", WHOLE),
    "--no-browser": "Print only the address of the page (default: open a browser).",
    # outputs
    "-o PATH": "File or folder to write (default: a name in the folder of the input).",
    "run: -o DIR": "Folder for rows, summary and report (default: results/NAME).",
    "study: -o DIR": "Folder for rows and report (default: results/NAME).",
    "compare: -o DIR": "Folder for rows, verdict and report (default: results/compare).",
    "tune: -o DIR": "Folder for rows and figure (default: results/tune).",
    "simulate: -o FILE": "File for the record or log (default: SCENARIO-SEED.nc or .csv).",
    "estimate: -o FILE": "File for the estimates (default: RECORD-estimates.nc).",
    "import: -o REC.nc": "File for the record (default: LOG-imported.nc).",
    "identify: -o AXIS.toml": "File for the identified axis, or for the estimates from a folder of "
                               "logs (default: LOG-axis.toml, or FOLDER-estimates.csv).",
    "track: -o EST.nc": "File for the estimates (default: LOG-track.nc).",
    "paper: -o DIR": "Folder for figures and claims (default: results/paper).",
    **LOG_OPTIONS,
}  # fmt: skip
"""All options of all commands.

The key contains the name and the metavar of an option. The value is the help text of the option,
or a tuple of the help text and keyword arguments of `add_argument`. An option without a metavar is
a flag. A key with a prefix such as "track: " applies only to that command, and takes precedence
over the key without the prefix. Help texts contain the unit and the default value.
"""


def add_options(parser: argparse.ArgumentParser, name: str) -> None:
    """Add the options of a command to its parser."""
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
    """Print the result of a command as lines, or as one JSON object with ``--json``.

    Parameters
    ----------
    args : Args
        Arguments of the command line.
    content : mapping
        Result to print with ``--json``. Numbers that are not finite become null.
    status : int
        Exit status, which this function returns.
    *lines : object
        Result to print without ``--json``. Each object is one line or block of text.
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
