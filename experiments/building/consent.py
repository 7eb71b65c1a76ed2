"""Text of a file is never executed unasked: what names code, and who has to be asked for it.

An estimator that is typed on the command line runs whatever it names. One that a study, a stored
run or a lesson names is somebody else's text: a name of the registry or of an installed entry
point is as good as typed, but `path/file.py:Class`, `package.module:Class` and `pipe:COMMAND` need
`--run-code`, after they were shown.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from flexaxis.experiments.streams import visible
from flexaxis.sim.errors import FlexaxisError

OPTION = "--run-code"
PIPE = "pipe:"
"""How the command of a program begins."""


class CodeRefused(FlexaxisError):
    """Text of a file names code, and nobody has said that it may run."""


def names_code(text: str) -> bool:
    """Whether an estimator's text names code: own files, modules and programs have a colon.

    Examples
    --------
    >>> names_code("rpem-forgetting[forgetting=0.99]"), names_code("mine.py:Mine[gain=0.1]")
    (False, True)
    >>> names_code("pipe:octave-cli -q my.m"), names_code("subprocess:Popen")
    (True, True)
    """
    return ":" in text.partition("[")[0]


def piped(text: str) -> str | None:
    """Return the command of an estimator that is a program; None for any other text.

    Examples
    --------
    >>> piped("pipe:./mine -v")
    './mine -v'
    """
    return text.removeprefix(PIPE) if text.startswith(PIPE) else None


def code_named(texts: Iterable[str]) -> list[str]:
    """Return those of some texts that name code, each once."""
    return [text for text in dict.fromkeys(texts) if names_code(text)]


def require(given: bool, texts: Iterable[str], *, source: str, command: str | None = None) -> None:
    """Refuse texts that name code, unless consent was given.

    Parameters
    ----------
    given : bool
        Whether the user has said `--run-code`.
    texts : iterable of str
        Estimators, as `source` names them.
    source : str
        Where they stand, for the message.
    command : str, optional
        The line that was typed; without one the caller is a program, and is told of `run_code`.

    Raises
    ------
    CodeRefused
        With a line for each text, and what to type.
    """
    found = [] if given else code_named(texts)
    if not found:
        return
    go_on = "pass run_code=True" if command is None else f"type: {command} {OPTION}"
    raise CodeRefused(
        "\n".join(
            [
                f"{source} names code, and text of a file is not run unasked:",
                *(f"  {visible(text)}" for text in found),
                f"if you trust it, {go_on}",
            ]
        )
    )


def add_run_code(parser: argparse.ArgumentParser, whose: str) -> None:
    """Declare `--run-code`."""
    parser.add_argument(
        OPTION,
        action="store_true",
        help=f"run code that {whose} name: path.py:Class, module:Class, pipe:COMMAND",
    )
