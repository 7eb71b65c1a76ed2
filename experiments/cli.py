"""The command `flexaxis`: results on stdout, progress and errors on stderr.

Exit status: 0 fine, 1 a finding, 2 wrong use or bad input, 130 Ctrl-C. Each command is a module in
`flexaxis.experiments.commands` with `HELP`, `configure(parser)` and `main(args)`; the heavy
imports lie inside `main`, so that `--help` is quick.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from keyword import iskeyword

COMMANDS = (
    "list",
    "show",
    "simulate",
    "estimate",
    "run",
    "compare",
    "check",
    "new",
    "report",
    "view",
    "demo",
    "cache",
    "speed",
    "tradeoff",
    "tune",
    "paper",
    "import",
    "identify",
    "track",
    "study",
    "merge",
    "export",
    "verify",
)

EPILOG = """\
first steps:
  flexaxis run smoke                       the three step faults, about a minute
  flexaxis list                            scenarios, suites and estimators
  flexaxis simulate fm_step-v1 -o rec.nc   ground truth of one run
  flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc

`flexaxis COMMAND --help` explains a command, with an example.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, with all commands."""
    top = argparse.ArgumentParser(
        prog="flexaxis",
        description="Benchmark recursive identification of a geared, flexible robot axis.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"flexaxis {version('flexaxis')}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        suffix = "_" if iskeyword(name) else ""
        module = import_module(f"flexaxis.experiments.commands.{name}{suffix}")
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.configure(sub)
        sub.set_defaults(main=module.main)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    # Before NumPy is imported: small matrices are several times slower on many threads.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if argv is None else argv)
    args = parser().parse_args(words)
    args.words = words
    return _guarded(args)


def _guarded(args: argparse.Namespace) -> int:
    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.sim.errors import FlexaxisError

    try:
        return int(args.main(args) or 0)
    except (FlexaxisError, EstimatorError) as error:
        for line in str(error).splitlines():
            print(f"flexaxis: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("flexaxis: interrupted; what was computed so far is kept", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
