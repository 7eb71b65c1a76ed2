"""Files of strangers, read in a process of their own: broken ones can take it along."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Array

PATIENCE = 300.0  # s
MEMORY = 8 << 30  # bytes that the process may have: a small file may say that it unpacks to more
TEXT = 4096  # characters of a text that are wanted: one may unpack to gigabytes, too

Answers = Mapping[str, Callable[..., Any]]
"""What a module answers about a file, by its name: path and words in, what JSON can hold out."""


def asked(module: str, path: Path, what: str, *words: Any) -> Any:
    """Return what a process of its own answers about a file.

    Parameters
    ----------
    module : str
        Ends in a call of `serve`.
    path : Path
    what : str
        One of its answers.
    *words
        Given to it besides the path; JSON can hold them.

    Raises
    ------
    LogError
        If the process says that the file is no good, or comes to an end otherwise.
    """
    # -P: what lies where the user stands is data, and no module of this process
    command = [sys.executable, "-P", "-m", module, what, os.path.abspath(path)]
    told = json.dumps(words).encode()  # names of columns may be too many for a command line
    try:
        done = subprocess.run(
            command, input=told, capture_output=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise LogError(f"{path}: not read within {PATIENCE:g} s; is it broken?") from error
    except OSError as error:
        raise LogError(f"{path}: no process to read it ({error})") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        said = done.returncode > 0 and lines
        raise LogError(f"{path}: {lines[-1] if said else _ended(done.returncode)}")
    return json.loads(done.stdout)


def columns(module: str, path: Path, what: str, *words: Any) -> dict[str, Array]:
    """Return the columns of a file, where an answer is `kept`: given its path, FILE and words.

    Raises
    ------
    LogError
        As `asked`, and if they are too large for this process.
    """
    try:
        with TemporaryDirectory() as folder:
            kept_in = Path(folder) / "columns.npy"
            names = asked(module, path, what, str(kept_in), *words)
            with kept_in.open("rb") as file:
                return {name: np.load(file) for name in names}
    except LogError:
        raise
    except MemoryError as error:
        raise LogError(f"{path}: is too large for the memory of this machine") from error
    except (OSError, EOFError, ValueError) as error:
        raise LogError(f"{path}: lost in the folder for temporary files ({error})") from error


def kept(file: str, found: Iterable[tuple[str, Array]]) -> list[str]:
    """Write columns one behind the other, as they come; return their names."""
    names = []
    with Path(file).open("wb", buffering=0) as out:
        for name, column in found:
            try:
                np.save(out, column)
            except OSError as error:  # what cannot be written is no fault of the file
                raise LogError(
                    f"no room for its columns in {Path(file).parent} ({error})"
                ) from error
            names.append(name)
    return names


def serve(answers: Answers) -> None:
    """Answer what this process was started for, within its limits."""
    _limit()
    what, path = sys.argv[1:]
    print(answer(answers, what, path, json.load(sys.stdin)))


def answer(answers: Answers, what: str, path: str, words: Sequence[Any]) -> str:
    """Return an answer as JSON; what is wrong with the file ends the process, with one line."""
    try:
        return json.dumps(answers[what](path, *words))
    except MemoryError as error:
        why = f"to read it takes more than the {MEMORY >> 30} GB of memory that it may ({error})"
    except LogError as error:
        why = str(error)
    raise SystemExit(" ".join(why.splitlines()))


def _ended(status: int) -> str:
    """Return how the process that read a file came to an end without a word."""
    if status > 0:
        return f"reading it ended with status {status}; is it broken?"
    with suppress(ValueError):
        return f"reading it was ended by {signal.Signals(-status).name}; is it broken?"
    return f"reading it was ended by signal {-status}; is it broken?"


def _limit() -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (MEMORY, MEMORY))  # as columns are kept in one
