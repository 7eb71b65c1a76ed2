"""The register of commands, every option of theirs declared once, and how a command answers."""

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
"""The function and the options of each command."""


def command(*options: str) -> Callable[[Main], Main]:
    """Register a function as the command of its name; its docstring is the help.

    Parameters
    ----------
    *options : str
        As in `OPTIONS`.
    """

    def register(main: Main) -> Main:
        COMMANDS[main.__name__.rstrip("_")] = main, options
        return main

    return register


def part(text: str) -> tuple[int, int]:
    """Return the number of a part and of all parts from "I/N"."""
    number, every = map(int, text.split("/"))
    if not 1 <= number <= every:
        raise ValueError(text)
    return number, every


PATH, SEVERAL = {"type": Path}, {"action": "append", "default": []}
VALUES = {**SEVERAL, "type": assignment}
NUMBER, WHOLE, ZERO = {"type": float}, {"type": int}, {"type": int, "default": 0}
NAMES = "Names of suites and scenarios as in `flexaxis list`, or paths to TOML files"
ESTIMATOR = (
    "Estimator: a name of `flexaxis list estimators`, with options as in ekf[walk=0.1]; your own "
    "as file.py:Class, module:Class or pipe:COMMAND"
)

OPTIONS: dict[str, str | tuple[str, Mapping[str, Any]]] = {
    "-q": "Print results and errors only (default: progress, too).",
    "--traceback": "Print where a crash came from (default: one line).",
    "--json": "Print one JSON object on stdout, and nothing else (default: tables and sentences).",
    # what a command is about
    "names SUITE|SCENARIO": (f"{NAMES} (required without --from).", {"nargs": "*"}),
    "compare: names SUITE|SCENARIO|RUN": (
        f"{NAMES} (default: the suite gate); or two folders of finished runs.", {"nargs": "*"},
    ),
    "scenario SCENARIO": "Scenario: a catalogue name or a TOML path.",
    "name SCENARIO|SUITE|ESTIMATOR": "Scenario, suite or estimator: its name, or a TOML path.",
    "kind KIND": (
        "What to list: scenarios, suites, estimators, or faults, which shows the scenario for each "
        "physical fault (default: the groups of scenarios, and the suites).",
        {"nargs": "?", "choices": ("scenarios", "suites", "estimators", "faults")},
    ),
    "file STUDY.toml": ("Definition of the study; docs/studies.md has every key.", PATH),
    "record RECORD.nc": ("Record, as simulate or import writes it.", PATH),
    "folder DIR": ("Folder of a run or a study.", PATH),
    "path FILE.py|c|m": ("File to write: Python (.py), C (.c) or GNU Octave (.m).", PATH),
    "estimator ESTIMATOR": f"{ESTIMATOR}.",
    "estimators ESTIMATOR": (
        "Estimators with a tuning parameter (default: all registered ones).", {"nargs": "*"},
    ),
    "log LOG|REC.nc": ("Log (CSV, MAT, HDF5 or NetCDF), or record.", PATH),
    "identify: log LOG|REC.nc|FOLDER": ("Log, record, or folder of logs.", PATH),
    "lesson LESSON.toml": (
        "TOML file of timed actions that replace clicks (default: none).",
        {"nargs": "?", **PATH},
    ),
    # which runs
    "--estimator E": (f"{ESTIMATOR}; repeat it for several (default: those of the suite).",
                      SEVERAL),
    "estimate: --estimator E": (f"{ESTIMATOR} (default: %(default)s).",
                                {"default": "rpem-forgetting"}),
    "track: --estimator E": f"{ESTIMATOR} (default: ekf, or glr for an axis with dry friction).",
    "demo: --estimator E": (f"{ESTIMATOR}; give two, which run on the same data (default: those of "
                            "the lesson, else rpem-forgetting and glr).", SEVERAL),
    "--base E": "Estimator to compare with, such as old.py:Mine.",
    "--candidate E": "Estimator to judge, such as new.py:Mine.",
    "--seeds N|A:B": "Seeds: N of them from 1000 on, or A to B-1; tune on 0 to 99, report on 1000 "
    "to 4999 (default: the number of the suite, 8 for single scenarios).",
    "compare: --seeds N|A:B": "Seeds: N of them from 1000 on, or A to B-1 (default: the number of "
    "the suite, 32 for single scenarios; all common ones of finished runs).",
    "tune: --seeds N|A:B": "Seeds: N of them from 1000 on, or A to B-1 (default: 0:16).",
    "--sample N": ("Run only N cases, spread over all (default: all).", ZERO),
    "--seed N": ("Random seed: the same number gives the same run (default: 0).", ZERO),
    "demo: --seed N": ("Random seed of excitation and noise (default: the lesson's, or 0).", WHOLE),
    # how they are run
    "--jobs N": ("Number of worker processes; results do not depend on it (default: one per core, "
                 "here %(default)s).", {"type": int, "default": os.cpu_count() or 1}),
    "--dask ADDRESS": "Address of the scheduler of a Dask cluster that runs the cases (default: "
    "processes on this machine).",
    "--shard I/N": ("Run only part I of N; --from merges the parts (default: 1/1).",
                    {"type": part, "default": (1, 1)}),
    "--from DIR": ("Merge finished shards into the folder of -o, and report (default: run).",
                   {"dest": "shards", "nargs": "+", **PATH}),
    "--overwrite": "Remove what the folder holds first (default: keep it, and run what is "
    "missing).",
    "--time-limit S": ("Longest time of one run of your own code [s] (default: 600).", NUMBER),
    "--dry-run": "Print the variants, the time on this machine and the disk space, and stop "
    "(default: run).",
    # what to list
    "--group GROUP": ("Only scenarios of a group, such as steps (default: all).", {"default": ""}),
    "--find TEXT": ("Only lines with this text (default: all).", {"default": ""}),
    "--all": "Print all lines (default: at most 60).",
    # how to judge
    "--max-seeds N": ("Add seeds up to N while the verdict is undecided (default: add none).",
                      ZERO),
    "--margin SCORE=%[,…]": (
        "Relative change of a score that does not matter; scores are lag, std, t10, std_after, "
        "cross_talk and excess (default: lag=2%%,std=2%%).", {"default": ""},
    ),
    "--match-std": "Tune both to the same noise first, and compare the lag alone (default: compare "
    "them as they are).",
    "--strict": "Exit with status 3 if the verdict is undecided (default: 0).",
    "--sweep SCENARIO": ("Run several settings of each estimator on this scenario; repeat it for "
                         "several (default: match the noise instead).", SEVERAL),
    "--save FILE.toml": ("Write the settings to this file, too (default: print them).", PATH),
    # logs of a real axis
    "--model MODEL": ("Model: one_mass, two_mass, three_mass, or a TOML file (default: "
                      "%(default)s).", {"default": "two_mass"}),
    "track: --model AXIS.toml": ("Axis, as identify wrote it.", {"required": True}),
    "--free PARAMETER": ("Identify this parameter; repeat it for several (default: all that the "
                         "log determines).", SEVERAL),
    "--fix PARAMETER[=VALUE]": ("Hold this parameter at a value [SI]; repeat it for several "
                                "(default: hold none; VALUE: its start value).", VALUES),
    "identify: --start PARAMETER=VALUE": ("Start the search here [SI]; repeat it for several "
                                          "(default: found from the log).", VALUES),
    "track: --start F": ("Initial estimate as a multiple of the identified value; tests "
                         "convergence (default: 1).", {"type": float, "default": 1.0}),
    "--delay S": ("Known delay of the torque [s] (default: identified).", NUMBER),
    "--friction LAW": (
        "Law of dry friction of the motor: none, coulomb or stribeck (default: auto, which chooses "
        "by simulating held-out pieces).", {"default": "auto"},
    ),
    "--gravity LAW": ("Gravity torque, sine and cosine of the angle: none or sine (default: auto, "
                      "which adds it if the log shows it).", {"default": "auto"}),
    "--highpass HZ": ("Ignore residuals below this frequency [Hz] (default: found from the log).",
                      NUMBER),
    "--validate OTHER": ("Simulate and predict another log with the result (default: none).", PATH),
    "--identify PARAMETER": (
        "Parameter to track, or its inverse such as 1/J_l; several as 1/J_l,k or by repeating it.",
        {"required": True, **SEVERAL},
    ),
    "--covariate NAME": ("Column whose mean may explain the estimates of a folder of logs; repeat "
                         "it for several (default: none).", SEVERAL),
    "--false-alarms P": ("False-alarm probability for a folder of logs (default: 0.01).",
                         {"type": float, "default": 0.01}),
    # the live axis
    "--port N": ("Port of the page (default: 8080, or the next free one).", WHOLE),
    "--no-browser": "Print the address only (default: open a browser).",
    # where to
    "-o PATH": "File or folder to write (default: a name beside the input).",
    "run: -o DIR": "Folder for rows, summary and report (default: results/NAME).",
    "study: -o DIR": "Folder for rows and report (default: results/NAME).",
    "compare: -o DIR": "Folder for rows, verdict and report (default: results/compare).",
    "tune: -o DIR": "Folder for rows and figure (default: results/tune).",
    "simulate: -o FILE": "File for the record or log (default: SCENARIO-SEED.nc or .csv).",
    "estimate: -o FILE": "File for the estimates (default: RECORD-estimates.nc).",
    "import: -o REC.nc": "File for the record (default: LOG-imported.nc).",
    "identify: -o AXIS.toml": "File for the axis (default: LOG-axis.toml; of a folder, "
                               "FOLDER-estimates.csv).",
    "track: -o EST.nc": "File for the estimates (default: LOG-track.nc).",
    "paper: -o DIR": "Folder for figures and claims (default: results/paper).",
    **LOG_OPTIONS,
}  # fmt: skip
"""Every option: its name and what it takes, then its help, and keywords of `add_argument`.

An option that takes nothing is a flag. One that begins with "track: " is that of `track`, and goes
before one of all commands. A help is a sentence with unit and default.
"""


def add_options(parser: argparse.ArgumentParser, name: str) -> None:
    """Declare the options of a command."""
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
    """Print the result of a command, as lines or with ``--json`` as one object.

    Parameters
    ----------
    args : Args
    content : mapping
        The result as JSON; what is not finite becomes null.
    status : int
        Exit status, which is returned.
    *lines : object
        The result in words.
    """
    if args.json:
        head = {"flexaxis": version("flexaxis"), "command": args.command, "status": status,
                "line": args.line}  # fmt: skip
        text = json.dumps({**head, **content, **head}, default=_plain)
        finite = json.loads(text, parse_constant=lambda name: None)
        lines = (json.dumps(finite, ensure_ascii=False),)
    try:
        print(*lines, sep="\n", flush=True)
    except BrokenPipeError:  # the reader has seen enough, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return status


def _plain(value: Any) -> Any:
    """Return what JSON has for an array, a number of NumPy or a path."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
