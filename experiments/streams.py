"""stdin, stdout and stderr as they may be: closed, full, left by their reader, short of letters."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any


def is_text(word: str) -> bool:
    """Whether a word of the command line is text in the encoding of this machine.

    Other bytes, as in names of files from another machine, cannot stand in a result.
    """
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


class Stream:
    """Text to a reader who may go, as with `| head`, and to a place that may be full.

    What is still said is dropped then: so a verdict keeps its exit status, and what is being done
    is done.

    Parameters
    ----------
    stream : text stream

    Attributes
    ----------
    problem : str
        Why not all of it was written, if somebody would still have read it.
    """

    def __init__(self, stream: Any) -> None:
        self._stream, self.problem = stream, ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text as far as it goes."""
        with self._dropping():
            self._stream.write(text)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts, one behind the other."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Pass on what was kept for later."""
        with self._dropping():
            self._stream.flush()

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError) as error:  # ValueError: code of a user has closed it
            if not isinstance(error, BrokenPipeError):
                self.problem = self.problem or getattr(error, "strerror", None) or str(error)
            with suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())  # also what was kept for later


@contextmanager
def forgiving() -> Iterator[Stream]:
    r"""Let stdout and stderr be written to inside, whatever they are; give stdout.

    What an encoding lacks is written as its number, `\u03b8`.
    """
    _open_closed()
    usual = sys.stdout, sys.stderr
    there: list[Any] = [stream or _nowhere() for stream in usual]
    errors = [_show_all(stream) for stream in there]
    ours = [Stream(stream) for stream in there]
    sys.stdout, sys.stderr = ours  # type: ignore[assignment]
    try:
        yield ours[0]
    finally:
        for stream in ours:
            stream.flush()
        sys.stdout, sys.stderr = usual
        for stream, before, kept in zip(there, usual, errors, strict=True):
            if before is None:
                stream.close()
            elif kept is not None:
                stream.reconfigure(errors=kept)


def _nowhere() -> Any:
    return open(os.devnull, "w", encoding="utf-8")


def _open_closed() -> None:
    """Open what was closed, as with `2>&-`: the next file to be opened would take its place.

    Then what a library or a process of ours says on stderr would stand in a result.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            found = os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
            os.set_inheritable(found, True)


def _show_all(stream: Any) -> str | None:
    """Write what the encoding lacks as its number; return how it was, where that can be set."""
    if not hasattr(stream, "reconfigure"):
        return None
    before = str(stream.errors)
    stream.reconfigure(errors="backslashreplace")
    return before
