"""Messages between whoever checks and the process in which an entry's code runs.

A message is a kind, a length, and as many bytes: JSON, or numbers. Nothing is unpickled, and what
comes back is checked for its size before it is read.
"""

from __future__ import annotations

import json
import math
import os
import select
import struct
import time
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.board.errors import EntryError

Array = NDArray[np.float64]

_HEAD = struct.Struct("<cQ")
JSON, NUMBERS = b"J", b"N"
LARGEST = 64_000_000  # bytes of a message; of ten minutes with ten parameters it is a seventh


class Wire:
    """Two descriptors, one to read from and one to write to.

    Parameters
    ----------
    back, to : int
    patience : float, optional
        How long a message may be awaited, or wait to be taken [s]; for ever by default.
    in_all : float, optional
        How long it may take from now until the last message [s]; for ever by default.
    """

    def __init__(
        self, back: int, to: int, patience: float | None = None, in_all: float | None = None
    ) -> None:
        self._back, self._to, self._patience, self._in_all = back, to, patience, in_all
        self._last = math.inf if in_all is None else time.monotonic() + in_all

    def send(self, content: Any) -> None:
        """Send an array of numbers as it is, anything else as JSON.

        Raises
        ------
        EntryError
            If it is not taken in time.
        """
        if isinstance(content, np.ndarray):
            kind, text = NUMBERS, np.ascontiguousarray(content, "<f8").tobytes()
        else:
            kind, text = JSON, json.dumps(content).encode()
        left = memoryview(_HEAD.pack(kind, len(text)) + text)
        end = self._end()
        while left:
            # What is ready takes as many bytes at once; of more it might never take the rest.
            if not self._ready(min(end, self._last), to=True):
                self._late(end, "did not take a message")
            left = left[os.write(self._to, left[: select.PIPE_BUF]) :]

    def receive(self) -> Any:
        """Return a table, or numbers (n,).

        Raises
        ------
        EntryError
            If nothing comes, in time or at all, or something else.
        """
        kind, size = _HEAD.unpack(self._read(_HEAD.size))
        if size > LARGEST or kind not in {JSON, NUMBERS}:
            raise EntryError("the code sent something that is no answer")
        content = self._read(size)
        if kind == NUMBERS:
            if size % 8:
                raise EntryError("the code sent something that is no answer")
            return np.frombuffer(content, "<f8").astype(float)
        try:
            return json.loads(content)
        except (ValueError, RecursionError) as error:
            raise EntryError("the code sent something that is no answer") from error

    def _read(self, size: int) -> bytes:
        parts, left, end = [], size, self._end()
        while left:
            if not self._ready(min(end, self._last)):
                self._late(end, "gave no answer")
            part = os.read(self._back, min(left, 1 << 20))
            if not part:
                raise EntryError("the process that ran the code has ended")
            parts.append(part)
            left -= len(part)
        return b"".join(parts)

    def _end(self) -> float:
        return math.inf if self._patience is None else time.monotonic() + self._patience

    def _late(self, end: float, what: str) -> NoReturn:
        if end < self._last:
            raise EntryError(f"the code {what} within {self._patience:g} s")
        raise EntryError(f"the code took more than {self._in_all:g} s for a case")

    def _ready(self, end: float, *, to: bool = False) -> bool:
        left = None if math.isinf(end) else max(0.0, end - time.monotonic())
        back, there = ([], [self._to]) if to else ([self._back], [])
        return any(select.select(back, there, [], left))
