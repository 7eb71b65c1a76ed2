"""Estimators in another process and any language: JSON lines on its stdin and stdout.

docs/gate.md has the protocol, docs/examples/ a program in Python and one in GNU Octave.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError

PROTOCOL = 1
PATIENCE = 30.0  # s that a program may take for an answer, its start included


class PipeEstimator:
    """An estimator that is a program: one line of JSON a sample there, one back.

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
        self._program = _Program(command, patience)
        answer = self._program.ask(
            {
                "flexaxis": PROTOCOL,
                "names": list(identify),
                "nominal": dict(nominal),
                "period": period,
                "output": output,
            }
        )
        self.names = tuple(_field(answer, "names"))
        self.output = answer.get("output", output)

    def step(self, u: float, y: float | None) -> NDArray[np.float64]:
        """Send u[k] and y[k] (null in a gap), return θ[k] (p,) of the answer."""
        answer = self._program.ask({"u": u, "y": y})
        # Octave's jsonencode writes NaN as null and a single number without brackets.
        theta = np.array(_field(answer, "theta"), float, ndmin=1)
        if theta.shape != (len(self.names),):
            raise EstimatorError(
                f"the program answered theta of the shape {theta.shape}; one number for each "
                f"of {', '.join(self.names)} is needed"
            )
        return theta


class _Program:
    """A process that is asked one line at a time, and stopped if it does not answer."""

    def __init__(self, command: str, patience: float) -> None:
        self._patience = patience
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115, closed by _end
        try:
            self._process = subprocess.Popen(
                shlex.split(command, posix=os.name != "nt"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
            )
        except (OSError, ValueError, IndexError) as error:
            self._errors.close()
            raise EstimatorError(
                f"the program cannot be started: {error}. Write the command as you "
                "would type it, such as 'pipe:octave-cli -q my.m'"
            ) from error
        self._watch = _Watch(self._process)
        weakref.finalize(self, _end, self._process, self._watch, self._errors)

    def ask(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Send a line and return the answer."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        self._watch.allow(self._patience)
        try:
            stdin.write(json.dumps(content).encode() + b"\n")
            stdin.flush()
            line = stdout.readline()
        except OSError:  # it has gone
            line = b""
        finally:
            self._watch.rest()
        if not line:
            raise EstimatorError(f"the program {self._what_happened()}")
        return _parsed(line)

    def _what_happened(self) -> str:
        if self._watch.fired:
            return (
                f"did not answer within {self._patience:g} s and was stopped: answer every line "
                "with one line, and flush it"
            )
        self._process.wait(5)
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        last = f"; on stderr it said: {' | '.join(said[-3:])}" if said else ""
        return f"ended with status {self._process.returncode} instead of an answer{last}"


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
    """Close its input, which asks it to end; a program that does not is killed."""
    watch.stop()
    for stream in (process.stdin, process.stdout):
        try:
            if stream is not None:
                stream.close()
        except OSError:  # it has gone already
            pass
    try:
        process.wait(1)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    errors.close()


def _parsed(line: bytes) -> dict[str, Any]:
    try:
        answer = json.loads(line)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise EstimatorError(
            f"the program answered {line[:80].decode(errors='replace').strip()!r}; one JSON "
            'object on a line is needed, such as {"theta": [1.0, 1.25, 0.05]}. Print nothing else '
            "to stdout"
        )
    return answer


def _field(answer: Mapping[str, Any], key: str) -> Any:
    if key not in answer:
        raise EstimatorError(
            f"the program answered {json.dumps(answer)[:80]}, which has no {key!r}"
        )
    value = answer[key]
    return value if isinstance(value, list) else [value]
