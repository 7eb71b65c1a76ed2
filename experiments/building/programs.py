"""Programs of a user as processes: started, given some time for every answer, ended with us."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO

from flexaxis.estimators.errors import EstimatorError

PATIENCE = 30.0  # s that a program may take for an answer, its start included


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


class Program:
    """A process that is asked and answers, and is stopped if it does not.

    It is started at once, and ends when this object does.

    Parameters
    ----------
    command : str
        As one would type it; it is not given to a shell.
    patience : float
        Longest time that an answer may take [s].
    example : str
        Such a command, for messages.

    Attributes
    ----------
    to, back : int
        Descriptors of its stdin and stdout.

    Raises
    ------
    EstimatorError
        If it cannot be started.
    """

    def __init__(self, command: str, patience: float, example: str) -> None:
        self.patience = patience
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115, closed by _end
        try:
            with held_back():
                self.process = subprocess.Popen(
                    shlex.split(command, posix=os.name != "nt"),
                    bufsize=0,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=self._errors,
                )
        except (OSError, ValueError, IndexError) as error:
            self._errors.close()
            raise EstimatorError(
                f"the program cannot be started: {error}. Write the command as you "
                f"would type it, such as {example!r}"
            ) from error
        assert self.process.stdin is not None and self.process.stdout is not None
        self.to, self.back = self.process.stdin.fileno(), self.process.stdout.fileno()
        self._watch = _Watch(self.process)
        weakref.finalize(self, _end, self.process, self._watch, self._errors)

    @contextmanager
    def in_time(self) -> Iterator[None]:
        """Give the program its time for what is done inside; it is killed after that."""
        self._watch.allow(self.patience)
        try:
            yield
        finally:
            self._watch.rest()

    def send(self, content: bytes | memoryview) -> bool:
        """Send bytes; return whether the program was still there to take them."""
        left = memoryview(content)
        try:
            while left:
                left = left[os.write(self.to, left) :]
        except OSError:
            return False
        return True

    def what_happened(self, instead: str, how: str) -> str:
        """Return why there is no answer.

        Parameters
        ----------
        instead : str
            Of what it has ended.
        how : str
            An answer is to be given.
        """
        if self._watch.fired:
            return f"did not answer within {self.patience:g} s and was stopped: {how}"
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            return f"closed its stdout instead of {instead}"
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        last = f"; on stderr it said: {' | '.join(said[-3:])}" if said else ""
        return f"ended with status {self.process.returncode} instead of {instead}{last}"


class _Watch:
    """Kills a process that is over its time; one thread, and nothing to do for each sample."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process, self.fired = process, False
        self._left: float | None = None
        self._stop = threading.Event()
        threading.Thread(target=self._look, daemon=True).start()

    def allow(self, seconds: float) -> None:
        self._left = seconds

    def rest(self) -> None:
        self._left = None

    def stop(self) -> None:
        self._stop.set()

    def _look(self, every: float = 0.2) -> None:
        while not self._stop.wait(every):
            if self._left is None:
                continue
            self._left -= every
            if self._left <= 0:
                self.fired = True
                self._process.kill()
                return


def _end(process: subprocess.Popen[bytes], watch: _Watch, errors: IO[bytes]) -> None:
    """Close its input, which asks it to end; a program that does not is killed.

    Nothing is raised, for this is called where objects go, from which nothing can be.
    """
    watch.stop()
    for stream in (process.stdin, process.stdout):
        try:
            if stream is not None:
                stream.close()
        except OSError:  # it has gone already
            pass
    try:
        process.wait(1)
    except BaseException as error:  # or Ctrl-C, which comes again
        process.kill()
        process.wait()
        if isinstance(error, KeyboardInterrupt):
            again = threading.Timer(0.01, signal.raise_signal, [signal.SIGINT])
            again.daemon = True
            again.start()
    errors.close()
