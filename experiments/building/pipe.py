"""Estimators in another process and any language: binary blocks on its stdin and stdout.

docs/pipes.md has the protocol to the byte; `flexaxis new my_estimator.c` writes a program with all
of it.
"""

from __future__ import annotations

import os
import select
import shlex
import signal
import struct
import subprocess
import tempfile
import time
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import SIGNALS

PATIENCE = 30.0  # s that a program may take for an answer, its start included
VERSION = 1
MAGIC, MARK = b"FLEXAXIS", 0x01020304
NAME = 32  # bytes of a name, with at least one NUL behind it
HEAD = struct.Struct("<8sII")  # of both sides: magic, version, mark of the byte order
ASKED = struct.Struct("<dIII")  # period [s], output, number of nominal values, of names
ANSWERED = struct.Struct("<II")  # number of names, output
OUTPUTS = tuple(SIGNALS)
COUNT = struct.Struct("<Q")  # samples that follow; 0: the run has ended
SAMPLE = struct.Struct("<Qdd")  # one sample, its count before it
ROOM = 32768  # bytes in flight each way: half of what a pipe holds, so that neither side waits
MOST_NAMES = 64  # of estimates: more is a mistake, or no number at all
HOW = "answer n samples by n times p numbers of 8 bytes, and flush them: docs/pipes.md"


class PipeEstimator:
    """An estimator that is a program: blocks of samples there, blocks of estimates back.

    The program is started at once, and ends when this object does.

    Parameters
    ----------
    command : str
        As one would type it; it is not given to a shell.
    nominal : mapping of str to float
        Physical parameters (SI).
    period : float
        [s]
    identify : sequence of str
        What the scenario asks for; the program says what it estimates of it.
    output : {"speed", "increment"}
        What y will be.
    patience : float
        Longest time that an answer may take [s].

    Raises
    ------
    EstimatorError
        If the program cannot be started, ends, is silent, or answers what is not understood.
    """

    def __init__(
        self,
        command: str,
        nominal: Mapping[str, float],
        period: float,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        output: str = "speed",
        patience: float = PATIENCE,
    ) -> None:
        if os.name == "nt":
            raise EstimatorError(
                "Windows cannot wait for the pipes of a program; use WSL, Linux or macOS"
            )
        self._patience, self._said = patience, tempfile.TemporaryFile()  # noqa: SIM115, for _end
        try:
            with held_back():
                self._process = subprocess.Popen(
                    shlex.split(command), bufsize=0, stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE, stderr=self._said,
                )  # fmt: skip
        except (OSError, ValueError, IndexError) as error:
            self._said.close()
            raise EstimatorError(
                f"the program cannot be started: {error}. Write the command as you would type it, "
                "such as 'pipe:./my_estimator'"
            ) from error
        weakref.finalize(self, _end, self._process, self._said)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._to, self._back = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._to, False)  # who does not read is not waited for either
        self._until = time.monotonic() + patience
        self._send(_header(nominal, period, identify, output), "the header")
        self.names, self.output = self._answer()
        self._theta = np.empty((1, len(self.names)))

    def step(self, u: float, y: float | None) -> NDArray[np.float64]:
        """Send u[k] and y[k] (NaN in a gap), return θ[k] (p,) of the answer."""
        self._ask(SAMPLE.pack(1, u, np.nan if y is None else y), self._theta)
        return self._theta[0].copy()

    def run(
        self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Send u and y (N,), return θ (N, p); the same numbers as step by step, in blocks."""
        u, y = np.asarray(u, float), np.asarray(y, float)
        if valid is not None:
            y = np.where(valid, y, np.nan)
        samples = np.stack([u, y], axis=1).astype("<f8")
        theta = np.empty((len(u), len(self.names)))
        block = max(1, ROOM // (8 * max(2, len(self.names))))
        for start in range(0, len(u), block):
            some = samples[start : start + block]
            try:
                self._ask(COUNT.pack(len(some)) + some.tobytes(), theta[start : start + block])
            except EstimatorError as error:
                error.at_sample = start  # type: ignore[attr-defined]  # for who says where it was
                raise
        return theta

    def _ask(self, content: bytes, theta: NDArray[np.float64]) -> None:
        """Send samples and wait for their estimates (n, p)."""
        if select.select([self._back], [], [], 0)[0]:
            self._unasked(theta.shape[1])
        self._until = time.monotonic() + self._patience
        self._send(content, "estimates")
        self._receive(theta.data.cast("B"), "estimates")
        if not _LITTLE:
            theta.byteswap(inplace=True)

    def _unasked(self, p: int) -> None:
        """Refuse what was said before it was asked for; the end of the program says itself."""
        more = len(os.read(self._back, 1 << 16))
        if not more:
            raise self._silent("estimates")
        raise EstimatorError(
            f"the program wrote {more} bytes more than were asked for: n samples are answered by "
            f"n times {p} numbers of 8 bytes. Print nothing else to stdout"
        )

    def _answer(self) -> tuple[tuple[str, ...], str]:
        """Return the names that the program estimates, and the output that it reads."""
        head = bytearray(HEAD.size)
        self._receive(memoryview(head), "its header")
        _check_head(*HEAD.unpack(head))
        rest = bytearray(ANSWERED.size)
        self._receive(memoryview(rest), "its header")
        p, output = ANSWERED.unpack(rest)
        if not 0 < p <= MOST_NAMES or output >= len(OUTPUTS):
            raise EstimatorError(
                f"the program's header has {p} names and output {output}: 1 to {MOST_NAMES} names "
                "and output 0 (speed) or 1 (increment) are needed, as 32-bit integers"
            )
        names = bytearray(NAME * p)
        self._receive(memoryview(names), f"{p} names of {NAME} bytes")
        fields = (bytes(names[i : i + NAME]) for i in range(0, len(names), NAME))
        return tuple(_text(field) for field in fields), OUTPUTS[output]

    def _wait(self, read: list[int], write: list[int]) -> None:
        """Wait until the program takes or gives something; one that is over its time is killed."""
        if not any(select.select(read, write, [], max(0.0, self._until - time.monotonic()))):
            self._process.kill()
            raise EstimatorError(
                f"the program did not answer within {self._patience:g} s and was stopped: {HOW}"
            )

    def _send(self, content: bytes, instead: str) -> None:
        left = memoryview(content)
        while left:
            self._wait([], [self._to])
            try:
                left = left[os.write(self._to, left) :]
            except OSError as error:  # it is not there any more
                raise self._silent(instead) from error

    def _receive(self, view: memoryview, what: str) -> None:
        got = 0
        while got < len(view):
            self._wait([self._back], [])
            part = os.read(self._back, len(view) - got)
            if not part:
                said = f", {bytes(view[:got])[:32]!r}" if got else ""
                raise self._silent(f"{what} (it wrote {got} of {len(view)} bytes{said})")
            view[got : got + len(part)] = part
            got += len(part)

    def _silent(self, instead: str) -> EstimatorError:
        """Return why there is no answer, where the program has ended instead."""
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            return EstimatorError(f"the program closed its stdout instead of {instead}")
        self._said.seek(0)
        said = self._said.read().decode(errors="replace").strip().splitlines()
        last = f"; on stderr it said: {' | '.join(said[-3:])}" if said else ""
        status = self._process.returncode
        return EstimatorError(f"the program ended with status {status} instead of {instead}{last}")


def _end(process: subprocess.Popen[bytes], said: IO[bytes]) -> None:
    """Close its input, which asks a program to end; one that does not is killed."""
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):  # it has gone already
            if stream is not None:
                stream.close()
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(1)
    finally:
        process.kill()
        process.wait()
        said.close()


@contextmanager
def held_back() -> Iterator[None]:
    """Hold Ctrl-C back while a process may be started, which inherits that.

    A terminal sends it to all, and it is for us alone: else a program or a worker would end in the
    middle of its work, and that would look like a fault.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_LITTLE = struct.pack("=I", 1) == struct.pack("<I", 1)


def _check_head(magic: bytes, version: int, mark: int) -> None:
    """Refuse an answer that is none, or none of this kind."""
    if magic != MAGIC:
        raise EstimatorError(
            f"the program answered {magic!r}, and an answer begins with {MAGIC!r}: print nothing "
            "else to stdout (docs/pipes.md)"
        )
    if mark == int.from_bytes(MARK.to_bytes(4, "little"), "big"):
        raise EstimatorError(
            "the program writes the bytes of a number in the wrong order: the smallest goes first "
            "(little-endian), in what it reads as well"
        )
    if version != VERSION or mark != MARK:
        raise EstimatorError(
            f"the program speaks version {version} (mark {mark:#010x}), flexaxis version "
            f"{VERSION} (mark {MARK:#010x}): docs/pipes.md has the header to the byte"
        )


def _header(
    nominal: Mapping[str, float], period: float, identify: Sequence[str], output: str
) -> bytes:
    """Return what a program is told before the first sample."""
    values = {name: x for name, x in nominal.items() if isinstance(x, int | float)}
    parts = [
        HEAD.pack(MAGIC, VERSION, MARK),
        ASKED.pack(period, OUTPUTS.index(output), len(values), len(identify)),
        *(_field(name) + struct.pack("<d", x) for name, x in values.items()),
        *map(_field, identify),
    ]
    return b"".join(parts)


def _field(name: str) -> bytes:
    return name.encode()[: NAME - 1].ljust(NAME, b"\0")


def _text(field: bytes) -> str:
    return field.partition(b"\0")[0].decode(errors="replace").strip()
