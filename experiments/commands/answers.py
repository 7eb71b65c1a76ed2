"""Where a command writes to, what numbers it takes, what it says on stderr, and its exit status.

`--json` prints one object on stdout, and docs/json.md has its keys. It begins with the version of
flexaxis, the name of the command, its exit status and the line that was typed; what the command
found follows. Where a command cannot, `error` says why.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from flexaxis.experiments.seeds import END

FINE, FINDING, WRONG_USE, UNDECIDED, CRASH, INTERRUPTED = 0, 1, 2, 3, 70, 130
"""Exit status. A finding is what a command looks for: worse, a broken rule, a change, a case that
failed. Wrong use is bad input or options; undecided is for `compare` alone. A crash is code that
raised what it should not, ours or the user's, or a worker process that died: none of the others."""
LONGEST = 1000  # characters of a line of error; what somebody gave may be longer


def say(text: str) -> None:
    """Print on stderr, each line after our name; what nobody reads of a long one is left out."""
    for line in text.splitlines():
        print(f"flexaxis: {_readable(line)}", file=sys.stderr)


def _readable(line: str) -> str:
    left_out, half = len(line) - LONGEST, LONGEST // 2
    return f"{line[:half]} … {left_out} more … {line[-half:]}" if left_out > 0 else line


def add_json(parser: Any) -> None:
    """Declare --json."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object, and nothing else, on stdout"
    )


def add_output(
    parser: Any, metavar: str, words: str = "", *, default: Path | None = None,
    required: bool = False,
) -> None:  # fmt: skip
    """Declare --output; `words` say what it is where it is not given."""
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar=metavar,
        default=default,
        required=required,
        help=words or (f"default: {default}" if default else None),
    )


def answer(
    args: argparse.Namespace,
    content: Mapping[str, Any],
    status: int = 0,
    *lines: object,
    show: Callable[[], object] = lambda: None,
) -> int:
    """Print what a command found, as JSON or in words, and return its status.

    Parameters
    ----------
    args : argparse.Namespace
        With the name of the command and the words that were typed.
    content : mapping
        What was found. Numbers that are not finite become null, arrays lists, paths text; a
        `command` in it, the line that does the same again, becomes `line`.
    status : int
        Exit status.
    *lines : object
        What is printed where no JSON is asked for, such as the path of what was written.
    show : callable
        Called before that.
    """
    if not args.json:
        show()
        for line in lines:
            print(line)
        return status
    known = dict(content)
    line = known.pop("command", None) or args.line
    known.pop("status", None)
    print(_text(args.command, status, {"line": line} | known), flush=True)
    args.answered = True
    return status


def no_answer(args: argparse.Namespace, status: int, error: str) -> None:
    """Print as JSON why a command found nothing, if JSON was asked for and none was printed."""
    if getattr(args, "json", False) and not getattr(args, "answered", False):
        answer(args, {"error": error}, status)


def refusal(command: str | None, words: list[str], status: int, error: str) -> str:
    """Return the JSON for words that are no command."""
    line = shlex.join(["flexaxis", *words])
    return _text(command, status, {"line": line, "error": error})


def _text(command: str | None, status: int, content: Mapping[str, Any]) -> str:
    from importlib.metadata import version

    head = {"flexaxis": version("flexaxis"), "command": command, "status": int(status)}
    letters = "utf" in (getattr(sys.stdout, "encoding", None) or "utf-8").lower()
    return json.dumps(plain(head | dict(content)), allow_nan=False, ensure_ascii=not letters)


def plain(content: Any) -> Any:
    """Return content as what JSON has; what is not finite is null.

    Examples
    --------
    >>> plain({"lag": float("nan"), "at": (1, 2.5), "report": Path("a/b")})
    {'lag': None, 'at': [1, 2.5], 'report': 'a/b'}
    """
    if isinstance(content, Mapping):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple | set | frozenset):
        return [plain(value) for value in content]
    if hasattr(content, "tolist"):  # of NumPy, without importing it
        return plain(content.tolist())
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return str(content) if isinstance(content, Path) else content


SEED = END - 1


def at_most(most: float, kind: type[int] | type[float] = int) -> Callable[[str], float]:
    """Return what reads the number of an option, for its `type`, up to some size.

    Examples
    --------
    >>> at_most(3660)("60")
    60
    """

    def read(text: str) -> float:
        value = kind(text)
        if not abs(value) <= most:  # not finite, or too large
            raise argparse.ArgumentTypeError(f"{text[:40]!r}: give at most {most:,}")
        return value

    read.__name__ = kind.__name__  # by which argparse calls what is no number
    return read


def too_large(parser: argparse.ArgumentParser, args: argparse.Namespace) -> Iterator[str]:
    """Yield what is wrong with the numbers that have no limit of their own."""
    for action in parser._actions:
        given = getattr(args, action.dest, None)
        for value in given if isinstance(given, list) else [given]:
            if isinstance(value, int | float) and action.type in (int, float):
                from flexaxis.sim.tables.config import LARGEST  # takes a tenth of a second

                option = action.option_strings[-1] if action.option_strings else action.metavar
                if not math.isfinite(value):
                    yield f"{option} {value}: give a finite number"
                elif abs(value) > LARGEST:
                    yield f"{option} {str(value)[:40]}: give at most {LARGEST:g}"
