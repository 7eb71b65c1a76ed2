"""The program `flexaxis`, which prints results to stdout, and progress and errors to stderr.

Each subcommand is a function in a module of `flexaxis.experiments.commands`. The decorator
`options.command` registers each function as a subcommand. The option `--help` is fast, because a
subcommand imports slow modules only when it runs.
"""

import argparse
import os
import re
import shlex
import signal
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from inspect import getdoc
from pkgutil import iter_modules
from typing import Any, NoReturn

from flexaxis.experiments import commands as home
from flexaxis.experiments.commands.options import COMMANDS, add_options, answer
from flexaxis.sim.errors import FlexaxisError, did_you_mean

WRONG_USE, CRASH, INTERRUPTED = 2, 70, 130

EPILOG = """\
first steps:
  flexaxis run smoke                       a first benchmark, with a report
  flexaxis list                            scenario groups and suites
  flexaxis simulate fm_step -o rec.nc      a record with the true parameters
  flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc

`flexaxis COMMAND --help` explains a command and gives examples.

exit status:
  0 success; 1 a finding, such as a failed case, a changed parameter or a worse
  candidate; 2 wrong use or bad input; 3 undecided (compare); 70 a crash or a full
  disk; 130 Ctrl-C or SIGTERM
"""


class Parser(argparse.ArgumentParser):
    """An argument parser that suggests the most similar known word for an unknown word."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the command line, and reject unknown options and extra words."""
        parsed, rest = super().parse_known_args(args, namespace)
        if rest:
            option = rest[0].partition("=")[0]
            self.error(
                f"unknown argument {option!r}.{did_you_mean(option, self._option_string_actions)}"
            )
        return parsed, rest

    def error(self, message: str) -> NoReturn:
        """Print an error message that suggests a similar known word, and exit."""
        if wrong := re.search(r"invalid choice: '?([^' ]*)'? \(choose from (.*)\)", message):
            hint = did_you_mean(wrong[1], re.findall(r"[\w.-]+", wrong[2]))
            message = f"unknown argument {wrong[1]!r}.{hint or f' Choose from {wrong[2]}.'}"
        self.exit(WRONG_USE, f"{self.prog}: {message} See {self.prog} --help.\n")


def parser() -> Parser:
    """Return the command-line parser with all commands."""
    for module in iter_modules(home.__path__):
        import_module(f"{home.__name__}.{module.name}")
    style: Any = {"allow_abbrev": False, "formatter_class": argparse.RawDescriptionHelpFormatter}
    words = "Benchmark recursive estimators of the parameters of a geared, flexible robot axis."
    top = Parser(prog="flexaxis", description=words, epilog=EPILOG, **style)
    top.add_argument("--version", action="version", version=f"flexaxis {version('flexaxis')}",
                     help="Print the version of flexaxis and exit.")  # fmt: skip
    subs = top.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands",
                              help="The command to run.")  # fmt: skip
    for name, (main, _) in COMMANDS.items():
        text = str(getdoc(main))
        sub = subs.add_parser(name, help=text.partition("\n")[0], description=text, **style)
        add_options(sub, name)
        sub.set_defaults(main=main)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    # NumPy reads these variables at import. Many threads slow small matrices down several times.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:  # a job scheduler stops a command with SIGTERM
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    args = parser().parse_args(words or ["--help"])
    args.line = shlex.join(["flexaxis", *(word for word in words if word not in {"-q", "--quiet"})])

    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.experiments.files import NotRun
    from flexaxis.experiments.running import progress
    from flexaxis.experiments.running.user_code import EstimatorCrash, describe, is_of_the_machine

    progress.QUIET.set(args.quiet)
    progress.LINE.set(args.line)
    warnings.formatwarning = lambda message, *_, **__: f"flexaxis: {message}\n"
    try:
        return int(args.main(args))
    except KeyboardInterrupt:
        again = args.line.replace(" --overwrite", "")
        status, text = INTERRUPTED, f"interrupted: to resume from the saved results, run {again}"
    except (FlexaxisError, EstimatorError) as error:
        crash = isinstance(error, EstimatorCrash | NotRun) or is_of_the_machine(error)
        status, text = CRASH if crash else WRONG_USE, str(error)
    except BaseException as error:  # SystemExit can only come from user code
        if args.traceback:
            raise
        text = f"{args.command} crashed: {describe(error)}; add --traceback to print the traceback"
        status = CRASH
    for line in text.splitlines():
        print(f"flexaxis: {line}", file=sys.stderr)
    return answer(args, {"error": text}, status) if args.json else status
