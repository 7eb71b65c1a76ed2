"""Estimators in another process and any language: JSON lines on its stdin and stdout.

docs/pipes.md has the protocol, docs/examples/ a program in Python and one in GNU Octave.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.programs import PATIENCE, Program

PROTOCOL = 1
HOW = "answer every line with one line, and flush it"
BINARY = "a program that reads and writes blocks of numbers is pipe-binary:, not pipe:"


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
        self._lines = _Lines(command, patience)
        answer = self._lines.ask(
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
        answer = self._lines.ask({"u": u, "y": y})
        # Octave's jsonencode writes NaN as null and a single number without brackets.
        theta = np.array(_field(answer, "theta"), float, ndmin=1)
        if theta.shape != (len(self.names),):
            raise EstimatorError(
                f"the program answered theta of the shape {theta.shape}; one number for each "
                f"of {', '.join(self.names)} is needed"
            )
        return theta


class _Lines:
    """A program that is asked one line at a time."""

    def __init__(self, command: str, patience: float) -> None:
        self.program = Program(command, patience, "pipe:octave-cli -q my.m")
        self._rest = b""

    def ask(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Send a line and return the answer."""
        with self.program.in_time():
            there = self.program.send(json.dumps(content).encode() + b"\n")
            line = self._line() if there else b""
        if not line:
            why = self.program.what_happened("an answer", HOW)
            raise EstimatorError(f"the program {why}; {BINARY}")
        return _parsed(line)

    def _line(self) -> bytes:
        """Return the next line; what there is at the end; nothing after it."""
        parts = [self._rest]
        while b"\n" not in parts[-1]:
            part = os.read(self.program.back, 65536)
            if not part:
                break
            parts.append(part)
        line, end, self._rest = b"".join(parts).partition(b"\n")
        return line + end


def _parsed(line: bytes) -> dict[str, Any]:
    try:
        answer = json.loads(line)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise EstimatorError(
            f"the program answered {line[:80].decode(errors='replace').strip()!r}; one JSON "
            'object on a line is needed, such as {"theta": [1.0, 1.25, 0.05]}. Print nothing else '
            f"to stdout; {BINARY}"
        )
    return answer


def _field(answer: Mapping[str, Any], key: str) -> Any:
    if key not in answer:
        raise EstimatorError(
            f"the program answered {json.dumps(answer)[:80]}, which has no {key!r}"
        )
    value = answer[key]
    return value if isinstance(value, list) else [value]
