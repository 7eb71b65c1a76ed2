"""The command `flexaxis`: results on stdout, progress and errors on stderr.

Each command is a module in a folder of `flexaxis.experiments.commands` with `HELP`,
`configure(parser)` and `main(args)`, and is found there; the heavy imports lie inside `main`, so
that `--help` is quick. Its folder says what it is for; `--json` is an option of every one that does
not say `JSON = False`.
"""

from __future__ import annotations

import argparse
import errno
import os
import shlex
import signal
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from pkgutil import walk_packages
from types import ModuleType
from typing import Any, TextIO

from flexaxis.experiments import commands as home
from flexaxis.experiments.commands.answers import (
    CRASH,
    FINE,
    INTERRUPTED,
    WRONG_USE,
    add_json,
    no_answer,
    say,
)
from flexaxis.experiments.commands.words import Parser, check_words
from flexaxis.experiments.running import progress
from flexaxis.experiments.streams import Stream, forgiving, is_text

GROUPS = {
    "look": "look",
    "runs": "run",
    "judge": "judge",
    "axis": "your own axis",
    "teach": "teach",
}
"""What the commands of each folder are for, in the order of the help."""

EPILOG = """\
first steps:
  flexaxis run smoke                       a first benchmark, with a report
  flexaxis list --group steps              scenarios; or suites, or estimators
  flexaxis simulate fm_step-v1 -o rec.nc   ground truth of one run
  flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc

`flexaxis COMMAND --help` explains a command, with an example.

exit status:
  0 fine, 1 a finding, 2 wrong use or bad input, 3 undecided (compare), 70 a crash
  or a full disk, 130 Ctrl-C or SIGTERM
"""
TRACEBACK = "--traceback"
QUIET, VERBOSE = ("-q", "--quiet"), ("-v", "--verbose")


def commands(only: str = "") -> dict[str, ModuleType]:
    """Return the modules of the commands by name: whatever lies there and has `main`.

    Where there is a command of the name `only`, it is that one alone: the others take time.
    """
    found = (each.name for each in walk_packages(home.__path__, f"{home.__name__}."))
    # An underscore keeps a name that is a word of Python, such as import_.
    places = {name.rpartition(".")[2].rstrip("_"): name for name in found}
    wanted = [only] if only in places else sorted(places)
    modules = {name: import_module(places[name]) for name in wanted}
    return {name: module for name, module in modules.items() if hasattr(module, "main")}


def parser(only: str = "") -> Parser:
    """Return the parser of the command line, with all commands or one of them."""
    known = commands(only)
    top = Parser(
        prog="flexaxis",
        description=_overview(known),
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"flexaxis {version('flexaxis')}")
    _add_common(top)
    subs = top.add_subparsers(
        dest="command", metavar="COMMAND", required=True, help="one of those above"
    )
    for name, module in known.items():
        sub = subs.add_parser(
            name,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.configure(sub)
        if getattr(module, "JSON", True):
            add_json(sub)
        _add_common(sub, default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        sub.set_defaults(main=module.main, parser=sub)
    return top


def _add_common(parser: argparse.ArgumentParser, **hidden: Any) -> None:
    """Declare what may stand before and behind the name of a command."""
    words = {
        (TRACEBACK,): "where a crash came from, in full",
        QUIET: "no progress and no remarks, only results and errors",
        VERBOSE: "also versions, folders, and how long it took",
    }
    for names, text in words.items():
        parser.add_argument(*names, action="store_true", **({"help": text} | hidden))


def _overview(known: Mapping[str, ModuleType]) -> str:
    """Return what there are commands for."""
    lines = ["Benchmark recursive identification of a geared, flexible robot axis."]
    for group in GROUPS.values():
        lines += ["", f"{group}:"]
        lines += [f"  {n:<10} {m.HELP}" for n, m in known.items() if group == group_of(m)]
    return "\n".join(lines)


def group_of(command: ModuleType) -> str:
    """Return what a command is for."""
    return GROUPS[command.__name__.split(".")[-2]]


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    # Before NumPy is imported: small matrices are several times slower on many threads.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if os.environ.get("COLUMNS") == "0":  # how some shells say that they do not know
        del os.environ["COLUMNS"]
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:  # a queue of jobs ends a command by SIGTERM
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    top = parser(words[0] if words else "")
    args = top.parse_args(words)
    if odd := [word for word in words if not is_text(word)]:
        args.parser.error(
            f"{odd[0]!a} is no text in the encoding of this machine, {sys.getfilesystemencoding()}:"
            " rename the file, or set LC_ALL=C.UTF-8"
        )
    common = {TRACEBACK, *QUIET, *VERBOSE}
    args.remarks = []  # on users' code
    args.words = [word for word in words if word not in common]  # no part of what is repeated
    args.line = shlex.join(["flexaxis", *args.words])
    with forgiving() as out, told(quiet=args.quiet, verbose=args.verbose):
        status = _told(out, _guarded(args))
    return status


def _told(out: Stream, status: int) -> int:
    """Return the status: not that all is fine, where what was found could not be written."""
    out.flush()
    if not out.problem:
        return status
    say(f"stdout: cannot be written: {out.problem}. What was to be said there is lost")
    return status or WRONG_USE


def _guarded(args: argparse.Namespace) -> int:
    try:
        return _answered(args)
    except KeyboardInterrupt as error:
        words = ["interrupted", *map(str, error.args)]
        if hasattr(args, "resume"):
            from flexaxis.experiments.commands.options import RESUME, line

            words.append(f"what is stored is kept; go on with: {line(args, RESUME)}")
        return _ended(args, INTERRUPTED, "; ".join(words))


def _answered(args: argparse.Namespace) -> int:
    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.experiments.files import NotRun
    from flexaxis.experiments.running.user_code import EstimatorCrash, is_of_the_machine
    from flexaxis.sim.errors import FlexaxisError

    told, status = "", WRONG_USE
    try:
        check_words(args.parser, args)
        return int(args.main(args) or FINE)
    except (FlexaxisError, EstimatorError) as error:
        if isinstance(error, EstimatorCrash):
            return _crashed(args, error, str(error))
        unfinished = isinstance(error, NotRun) or is_of_the_machine(error)
        told, status = str(error), CRASH if unfinished else WRONG_USE
    except KeyboardInterrupt:
        raise
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            return _crashed(args, error, _unexpected(args, error))
        told = f"{error.filename}: {error.strerror}"  # what was given is no path at all
    except BaseException as error:  # SystemExit: of a user's code, for none is ours
        return _crashed(args, error, _unexpected(args, error))
    return _ended(args, status, told)


def _ended(args: argparse.Namespace, status: int, text: str) -> int:
    """Say why a command found nothing, on stderr and to who reads JSON."""
    say(text)
    no_answer(args, status, text)
    return status


def _unexpected(args: argparse.Namespace, error: BaseException) -> str:
    from flexaxis.experiments.running.user_code import describe, user_line

    whose = "code that was given" if user_line(error) else "flexaxis itself, which should not"
    return f"{args.command}: crashed in {whose}: {describe(error)}"


def _crashed(args: argparse.Namespace, error: BaseException, text: str) -> int:
    if args.traceback:
        import traceback

        traceback.print_exception(error)
        return _ended(args, CRASH, text)
    return _ended(args, CRASH, f"{text}; {TRACEBACK} shows more")


@contextmanager
def told(*, quiet: bool, verbose: bool) -> Iterator[None]:
    """Set what is said on stderr inside; `verbose` adds versions, the cache and the time taken."""
    token, start = progress.QUIET.set(quiet), time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show
            if quiet:
                warnings.simplefilter("ignore", UserWarning)
            yield
        if verbose:
            _about(time.perf_counter() - start)
    finally:
        progress.QUIET.reset(token)


def _show(  # noqa: PLR0917
    message: Warning | str, category: type[Warning], filename: str, lineno: int,
    file: TextIO | None = None, line: str | None = None,
) -> None:  # fmt: skip
    """Show a warning to users as words, and any other with its line."""
    text = warnings.formatwarning(message, category, filename, lineno, line)
    sys.stderr.write(f"flexaxis: {message}\n" if category is UserWarning else text)


def _about(seconds: float) -> None:
    import platform
    from importlib.metadata import version

    from flexaxis.experiments.running.cache import default_cache

    packages = ("flexaxis", "mujoco", "numpy", "scipy", "numba")
    parts = [f"{name} {version(name)}" for name in packages]
    print(f"with {', '.join(parts)}, Python {platform.python_version()}", file=sys.stderr)
    print(f"records are kept in {default_cache().folder}", file=sys.stderr)
    print(f"took {seconds:.2f} s", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
