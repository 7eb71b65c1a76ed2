"""Load user code, report its errors, limit its run time, and run programs through pipes.

User code runs without a sandbox. Run only code that you trust.
"""

import errno
import faulthandler
import importlib
import shlex
import struct
import subprocess
import sys
import traceback
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import StepError
from flexaxis.estimators.signals import SIGNALS
from flexaxis.sim.errors import did_you_mean

PIPE = "pipe:"
OURS = ("sim", "estimators", "experiments", "models_mjcf")
TIME_LIMIT = 600.0
"""Default time limit for one run of a user's estimator [s]."""


class EstimatorCrash(EstimatorError):
    """Exception in an estimator; the message names the estimator, the exception and the line."""


def names_code(text: str) -> bool:
    """Return whether a text contains a colon and therefore names a user's file, module or program.

    Examples
    --------
    >>> names_code("rpem-forgetting[forgetting=0.99]"), names_code("mine.py:Mine[gain=0.1]")
    (False, True)
    """
    return ":" in text.partition("[")[0]


def code_file(text: str) -> str:
    """Return the file path in a text such as path/file.py:Class, or "" if it contains no path."""
    file = text.partition("[")[0].rpartition(":")[0]
    return file if file.endswith(".py") else ""


def load_class(text: str) -> Callable[..., Any]:
    """Import and return the class ``path/file.py:Class`` or ``package.module:Class``.

    Raises
    ------
    EstimatorError
        If the module cannot be imported, or does not contain the class.
    """
    module, _, name = text.rpartition(":")
    with reported(text, "during import"):
        file = code_file(text)
        home = _module_of(Path(file).resolve()) if file else importlib.import_module(module)
    if not hasattr(home, name):
        raise EstimatorError(
            f"{text}: {module} defines no {name!r}.{did_you_mean(name, dir(home))}"
        )
    return getattr(home, name)  # type: ignore[no-any-return]


@cache
def _module_of(path: Path) -> Any:
    """Import a Python file, and append its folder to the module search path."""
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    name = f"_flexaxis_user_{path.stem}_{abs(hash(path))}"
    spec = spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None  # a .py file has both
    sys.modules[name] = module = module_from_spec(spec)  # dataclasses need the module there
    spec.loader.exec_module(module)
    return module


@contextmanager
def reported(
    text: str, where: str, *, first: int = 0, period: float = 0.0, refusing: bool = False
) -> Iterator[None]:
    """Convert an exception in an estimator to an error that names the estimator and the sample.

    Parameters
    ----------
    text : str
        Estimator, in the format of the option `--estimator`.
    where : str
        Location of the error in words, such as "in its constructor" or "on fm_step-v1, seed 1000".
    first : int
        Index of the first sample that the estimator processes in the ``with`` block.
    period : float
        Sampling period [s].
    refusing : bool
        Whether to pass on an `EstimatorError` without changes.

    Raises
    ------
    EstimatorError
        If `step` does not return one value per parameter name.
    EstimatorCrash
        If any other exception occurs, including `sys.exit` but not Ctrl-C.
    """
    try:
        with redirect_stdout(sys.stderr):  # stdout is for results
            yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        if refusing and isinstance(error, EstimatorError):
            raise
        if (k := getattr(error, "at_sample", None)) is not None:
            where += f", sample {first + k}" + f" ({period * (first + k):g} s)" * bool(period)
        if isinstance(error, StepError):
            raise EstimatorError(f"{text}, {where}: {error}") from error
        raise EstimatorCrash(f"{text} crashed {where}: {describe(error)}") from error


def describe(error: BaseException) -> str:
    """Return the type, the message and the source line of an exception as one line of text."""
    words, place = " ".join(str(error).split()), user_line(error)
    kind = type(error).__name__ + (f": {words}" if words else "")
    return f"{kind} ({place})" if place else kind


def user_line(error: BaseException) -> str:
    """Return the last line of user code in a traceback, as ``file.py:12``, or "" if none exists."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((f"{f.filename}:{f.lineno}" for f in frames[::-1] if _is_users(f.filename)), "")


def _is_users(filename: str) -> bool:
    ours = [str(Path(__file__).resolve().parents[2] / name) for name in OURS]
    path = filename if filename.startswith("<") else str(Path(filename).resolve())
    return not path.startswith(("<", sys.prefix, sys.base_prefix, *ours))


FULL = {errno.ENOSPC, errno.EDQUOT, errno.ENOMEM}


def is_of_the_machine(error: BaseException | None) -> bool:
    """Return whether an error is due to a lack of memory or disk space, or a missing package."""
    while error is not None:
        if isinstance(error, MemoryError | ModuleNotFoundError):
            return True
        if isinstance(error, OSError) and error.errno in FULL:
            return True
        error = error.__cause__
    return False


@contextmanager
def ended_after(seconds: float | None, log: str) -> Iterator[None]:
    """Terminate the current process if the code in the ``with`` block runs longer than `seconds`.

    Before the process is terminated, the tracebacks of all threads are written to the file `log`.
    The timer runs in C and therefore also stops code that never returns to Python.
    """
    with open(log, "w") as file:
        if seconds is not None:
            faulthandler.dump_traceback_later(seconds, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def why_it_ended(log: str, seconds: float) -> str:
    """Return the reason why a worker process died, based on the log file from `ended_after`."""
    if not (Path(log).exists() and Path(log).read_text(errors="replace")):
        return (
            "the worker process died: the estimator code exited, memory ran out, or the process "
            "was killed"
        )
    return (
        f"TimeoutError: the run has not finished within {seconds:g} s. If the run needs more time, "
        "increase --time-limit (in Python: time_limit=)"
    )


HEAD = b"FLEXAXIS\1\0\0\0\4\3\2\1"  # version 1, and a number that indicates the byte order


class PipeEstimator:
    """An estimator program that reads samples from stdin and writes estimates to stdout.

    The page docs/pipes.md describes the protocol.

    Parameters
    ----------
    command : str
        Command line of the program, which is run without a shell.
    nominal : mapping of str to float
        Nominal parameter values that the estimator receives.
    period : float
        Sampling period [s].
    identify : sequence of str
        Parameters that the scenario identifies. The program may also estimate other parameters.
    output : str
        Name of the measured signal y.

    Raises
    ------
    OSError
        If the program cannot be started.
    EstimatorError
        If the program ends early or violates the protocol.
    """

    def __init__(
        self, command: str, nominal: Mapping[str, float], period: float, *,
        identify: Sequence[str], output: str,
    ) -> None:  # fmt: skip
        words, signals = shlex.split(command), tuple(SIGNALS)
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        weakref.finalize(self, _end, self._process)
        head = struct.pack("<dIII", period, signals.index(output), len(nominal), len(identify))
        head += np.array([*nominal.items()], "S32,<f8").tobytes()
        head += np.array(identify, "S32").tobytes()
        start, p, place = struct.unpack("<16sII", self._ask(HEAD + head, 24))
        if start != HEAD:
            raise EstimatorError(
                f"the program answered {start!r} instead of the header that docs/pipes.md describes"
            )
        self.names = tuple(np.frombuffer(self._ask(b"", 32 * p), "S32").astype(str).tolist())
        self.output = signals[place]

    def step(self, u: float, y: float | None) -> NDArray[np.float64]:
        """Return the p estimates θ[k] for u[k] and y[k]; a missing y (None) is sent as NaN."""
        return self.run([u], np.array([y], float))[0]

    def run(self, u: ArrayLike, y: ArrayLike, valid: Any = True) -> NDArray[np.float64]:
        """Return the estimates after each of the N samples of u and y, as an array (N, p)."""
        samples, answer = np.column_stack([u, np.where(valid, y, np.nan)]), b""
        # Each part is smaller than the buffer of a pipe, so neither process blocks the other.
        for part in np.split(samples, range(2048, len(samples), 2048)):
            size = len(part) * len(self.names) * 8
            answer += self._ask(struct.pack("<Q", len(part)) + part.tobytes(), size)
        return np.frombuffer(answer, "<f8").reshape(len(samples), -1)

    def _ask(self, content: bytes, size: int) -> bytes:
        """Send bytes to the program, and return its answer of `size` bytes."""
        answer = b""
        with suppress(OSError):  # the program has ended
            self._process.stdin.write(content)  # type: ignore[union-attr]
            self._process.stdin.flush()  # type: ignore[union-attr]
            answer = self._process.stdout.read(size)  # type: ignore[union-attr]
        if len(answer) < size:
            raise EstimatorError(
                f"the program ended after sending {len(answer)} of {size} bytes (see docs/pipes.md)"
            )
        return answer


def _end(process: subprocess.Popen[bytes]) -> None:
    """Terminate a program, and close the pipes to it."""
    with suppress(OSError), process:
        process.kill()
