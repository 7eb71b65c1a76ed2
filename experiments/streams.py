"""stdin, stdout and stderr as they may be: closed, full, left by their reader, short of letters."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any


def visible(text: str) -> str:
    r"""Return a text as a terminal may have it: what would drive it is written as its number.

    Examples
    --------
    >>> print(visible("f_m \x1b[31m θ"))
    f_m \x1b[31m θ
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def is_text(word: str) -> bool:
    """Whether a word of the command line is text in the encoding of this machine.

    Other bytes, as in names of files from another machine, cannot stand in a result.
    """
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


# What a terminal obeys, and what sets the direction of what is written.
_DRIVES = r"\x00-\x1f\x7f-\x9f" + r"\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
# What tables and bars need: colours, a line up, a line cleared, the cursor hidden or shown.
_OURS = re.compile(
    r"(\x1b\[(?:(?!8m)[\d;]*m|\d{0,2}A|[012]?K|\?25[hl])|[\n\r\t]|[^" + _DRIVES + r"]+)"
)


def tamed(text: str) -> str:
    r"""Return a text of which a terminal obeys no more than what this program lets it do.

    Names come from everywhere, and some would read the clipboard or answer in the user's place.

    Examples
    --------
    >>> print(tamed("a name \x1b]52;c;cm0gLXJm\x07"))
    a name \x1b]52;c;cm0gLXJm\x07
    """
    if text.isprintable():
        return text
    return "".join(part if i % 2 else visible(part) for i, part in enumerate(_OURS.split(text)))


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
        self._stream, self.problem, self._terminal = stream, "", False
        with suppress(ValueError):  # else it is closed
            self._terminal = bool(stream.isatty())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text as far as it goes."""
        with self._dropping():
            self._stream.write(tamed(text) if self._terminal else text)
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
