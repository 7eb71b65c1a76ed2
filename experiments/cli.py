"""The command `flexaxis`: results on stdout, progress and errors on stderr.

Each command is a function in a module of `flexaxis.experiments.commands`, registered by
`options.command`. Heavy imports are inside the functions, so that `--help` is quick.
"""

from __future__ import annotations

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
from pkgutil import iter_modules
from typing import Any, NoReturn

from flexaxis.experiments import commands as home
from flexaxis.experiments.commands.options import COMMANDS, add_options, answer
from flexaxis.sim.errors import FlexaxisError, did_you_mean

WRONG_USE, CRASH, INTERRUPTED = 2, 70, 130

GROUPS = ("look", "run", "judge", "your own axis", "teach")
"""What commands are for, in the order of the help."""

EPILOG = """\
first steps:
  flexaxis run smoke                       a first benchmark, with a report
  flexaxis list                            groups of scenarios, and suites
  flexaxis simulate fm_step -o rec.nc      ground truth of one run
  flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc

`flexaxis COMMAND --help` explains a command, with an example.

exit status:
  0 fine, 1 a finding, 2 wrong use or bad input, 3 undecided (compare), 70 a crash
  or a full disk, 130 Ctrl-C or SIGTERM
"""


class Parser(argparse.ArgumentParser):
    """An argument parser that names the nearest right word for a wrong one."""

    def __init__(self, **options: Any) -> None:
        text = argparse.RawDescriptionHelpFormatter
        super().__init__(allow_abbrev=False, formatter_class=text, **options)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return what was typed; refuse an option that the parser does not have."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            self._refuse(rest[0])
        return found, rest

    def _refuse(self, word: str) -> NoReturn:
        option = word.partition("=")[0]
        hint = did_you_mean(option, self._option_string_actions)
        kind = "unknown option" if option.startswith("-") else "one word too many:"
        self.error(f"{kind} {option!r}.{hint}")

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and what may have been meant."""
        if wrong := re.search(r"invalid choice: '?([^' ]*)'? \(choose from (.*)\)", message):
            hint = did_you_mean(wrong[1], re.findall(r"[\w.-]+", wrong[2]))
            message = f"unknown {wrong[1]!r}.{hint or f' Known are {wrong[2]}.'}"
        self.exit(WRONG_USE, f"{self.prog}: {message} See {self.prog} --help.\n")


def parser() -> Parser:
    """Return the parser of the command line."""
    for module in iter_modules(home.__path__):
        import_module(f"{home.__name__}.{module.name}")
    lines = ["Benchmark recursive identification of a geared, flexible robot axis."]
    for group in GROUPS:
        lines += ["", f"{group}:"]
        lines += [f"  {name:<10} {summary(name)}" for name, each in COMMANDS.items()
                  if each.group == group]  # fmt: skip
    top = Parser(prog="flexaxis", description="\n".join(lines), epilog=EPILOG)
    top.add_argument("--version", action="version", version=f"flexaxis {version('flexaxis')}",
                     help="Print the version and stop.")  # fmt: skip
    common = {
        "--traceback": "Print where a crash came from (default: one line).",
        "--quiet": "Print results and errors only (default: progress, too).",
    }
    subs = top.add_subparsers(dest="command", metavar="COMMAND", required=True,
                              help="One of the commands above.")  # fmt: skip
    for name, each in COMMANDS.items():
        sub = subs.add_parser(name, description=each.main.__doc__)
        add_options(sub, name)
        sub.set_defaults(main=each.main)
    for one in (top, *subs.choices.values()):
        for option, text in common.items():
            flags = ("-q", option) if option == "--quiet" else (option,)
            default: Any = False if one is top else argparse.SUPPRESS
            one.add_argument(*flags, action="store_true", default=default, help=text)
    return top


def summary(name: str) -> str:
    """Return the first line of the help of a command."""
    return str(COMMANDS[name].main.__doc__).partition("\n")[0]


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    # Before NumPy is imported: small matrices are several times slower on many threads.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:  # a queue of jobs ends a command by SIGTERM
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    args = parser().parse_args(words or ["--help"])
    kept = [word for word in words if word not in {"-q", "--quiet", "--traceback"}]
    args.line = shlex.join(["flexaxis", *kept])

    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.experiments.files import NotRun
    from flexaxis.experiments.running import progress
    from flexaxis.experiments.running.user_code import EstimatorCrash, describe, is_of_the_machine

    token = progress.QUIET.set(args.quiet)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show
            return int(args.main(args))
    except KeyboardInterrupt:
        line = args.line.replace(" --overwrite", "")
        return _refused(args, INTERRUPTED, f"interrupted; what is done is kept, resume with: {line}")
    except (FlexaxisError, EstimatorError) as error:
        crash = isinstance(error, EstimatorCrash | NotRun) or is_of_the_machine(error)
        return _refused(args, CRASH if crash else WRONG_USE, str(error), error)
    except BaseException as error:  # also a SystemExit of a user's code: ours raises none
        return _refused(args, CRASH, f"{args.command} crashed: {describe(error)}", error)
    finally:
        progress.QUIET.reset(token)


def _refused(args: Any, status: int, text: str, error: BaseException | None = None) -> int:
    """Print why a command has no result, on stderr and as JSON."""
    if args.traceback and error:
        import traceback

        traceback.print_exception(error)
    for line in text.splitlines():
        print(f"flexaxis: {line}", file=sys.stderr)
    return answer(args, {"error": text}, status) if getattr(args, "json", False) else status


def _show(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """Show a warning to users as a sentence, and any other with its line."""
    user = category is UserWarning
    text = f"flexaxis: {message}\n" if user else warnings.formatwarning(message, category, *where)
    sys.stderr.write(text)


if __name__ == "__main__":
    sys.exit(main())
