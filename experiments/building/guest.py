"""A user's code as a guest: what it prints goes to stderr, it ends in time, and cannot end us.

What it raises, `sys.exit` and a timeout included, is an `EstimatorCrash` that says where. Code of
the registry is left alone.
"""

from __future__ import annotations

import io
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from numbers import Real
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import StepError
from flexaxis.experiments.building.consent import names_code
from flexaxis.experiments.building.crashes import crash
from flexaxis.experiments.building.given import is_given
from flexaxis.experiments.building.neighbours import code_file, move_to
from flexaxis.experiments.building.put_back import put_back

LIMIT = 600.0
"""s for one run of a user's estimator, or for making one: far more than a benchmark is for."""
SHOWN = 3  # lines that a run may print; the rest is counted
CHARACTERS = 1000  # that a run may print, however few lines they are

_limit: ContextVar[float] = ContextVar("limit", default=LIMIT)


class Remark(NamedTuple):
    """What is to be known of a run besides its scores: of whom, what, how often, where first."""

    estimator: str
    what: str
    times: int
    where: str


PRINTED, NOT_FINITE = "printed", "not finite"
_remarks: ContextVar[list[Remark] | None] = ContextVar("remarks", default=None)


class _TimeUp(BaseException):
    """Not an `Exception`, so that no `except Exception` of the guest holds it up."""


def time_limit() -> float:
    """Return how long a guest may take [s]."""
    return _limit.get()


@contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """Set how long guests may take inside [s]; None leaves it as it is.

    Raises
    ------
    EstimatorError
        If that is no time.
    """
    limit = _limit.get() if seconds is None else seconds
    if not isinstance(limit, Real) or not 0 < limit < float("inf"):
        raise EstimatorError(
            f"a time limit of {seconds!r} s is none: give a finite number of "
            f"seconds above 0, or leave it out for {LIMIT:g}"
        )
    token = _limit.set(float(limit))
    try:
        yield
    finally:
        _limit.reset(token)


@contextmanager
def noted() -> Iterator[list[Remark]]:
    """Give the list to which remarks on guests are added inside."""
    found: list[Remark] = []
    token = _remarks.set(found)
    try:
        yield found
    finally:
        _remarks.reset(token)


def note(estimator: str, what: str, times: int, where: str) -> None:
    """Add a remark, if somebody listens."""
    heard = _remarks.get()
    if heard is not None:
        heard.append(Remark(estimator, what, times, where))


def is_guest(text: str) -> bool:
    """Whether an estimator's text names code of a user."""
    return names_code(text) or is_given(text)


@contextmanager
def hosted(
    text: str,
    doing: str,
    *,
    first: int = 0,
    period: float | None = None,
    refusing: bool = False,
    guest: bool | None = None,
) -> Iterator[None]:
    """Run a user's code inside, and say what goes wrong in it.

    Parameters
    ----------
    text : str
        As for `--estimator`.
    doing : str
        When it is: "when it was made", "on fm_step-v1, seed 1000".
    first : int
        Number of the first sample that it is given.
    period : float, optional
        Sampling period [s], to say when a sample is.
    refusing : bool
        Whether an `EstimatorError` is passed on as what it says; else it is a crash as well.
    guest : bool, optional
        Whether it is code of a user; as `text` says by default.

    Raises
    ------
    EstimatorError
        If its step returns another number of values than it has names.
    EstimatorCrash
        For whatever it raises, and where it takes longer than `time_limit`.
    """
    ours = not (is_guest(text) if guest is None else guest)
    if file := code_file(text):
        move_to(Path(file).resolve().parent)
    try:
        if ours:
            yield
        else:
            with put_back(), _heard(text, doing), _timed(time_limit()):
                yield
    except _TimeUp as error:
        limit = TimeoutError(
            f"no end within {time_limit():g} s; if it needs longer, give --time-limit "
            "(in Python time_limit=)"
        )
        raise crash(text, doing, limit.with_traceback(error.__traceback__)) from None
    except StepError as error:  # which says itself where
        raise EstimatorError(f"{text}, {doing}{_sample(error, first, period)}: {error}") from error
    except BaseException as error:
        if not _its_own(error) or (refusing and isinstance(error, EstimatorError)):
            raise
        raise crash(text, doing + _sample(error, first, period), error) from error


def _its_own(error: BaseException) -> bool:
    """Whether an error comes from the guest; what ends us from outside does not."""
    if isinstance(error, KeyboardInterrupt):  # a worker leaves Ctrl-C to its parent
        return signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    if isinstance(error, GeneratorExit):  # whoever drew from a generator around this has left
        return hasattr(error, "at_sample")
    if isinstance(error, Exception | SystemExit):
        return True
    return not type(error).__module__.startswith("flexaxis.")  # such as what stops work


def _sample(error: BaseException, first: int, period: float | None) -> str:
    """Return at which sample an error was raised, where that is known."""
    k = getattr(error, "at_sample", None)
    if k is None:
        return ""
    when = f" ({period * (first + k):g} s)" if period else ""
    return f", sample {first + k}{when}"


@contextmanager
def _heard(text: str, doing: str) -> Iterator[None]:
    """Pass some lines on to stderr, for stdout is for results; count the others."""
    to = _Few(sys.stderr)
    try:
        with redirect_stdout(to):
            yield
    finally:
        to.finish()
    if to.lines:
        note(text, PRINTED, to.lines, doing)


class _Few(io.TextIOBase):
    """Passes on the first lines of a text, and no more than some characters; counts its lines."""

    def __init__(self, target: Any) -> None:
        self._target, self._ended, self._room = target, 0, CHARACTERS
        self._open = self._hanging = False

    @property
    def lines(self) -> int:
        """Lines so far, with the one that has not ended."""
        return self._ended + self._open

    def write(self, text: str) -> int:
        if not text:
            return 0
        lines = text.split("\n", SHOWN - self._ended) if self._ended < SHOWN else []
        rest = lines[SHOWN - self._ended :]
        shown = text[: len(text) - len(rest[0]) if rest else len(text)] if lines else ""
        shown = shown[: self._room]
        if shown:
            self._target.write(shown)
            self._room -= len(shown)
            self._hanging = not shown.endswith("\n")
        self._ended += text.count("\n")
        self._open = not text.endswith("\n")
        return len(text)

    def finish(self) -> None:
        """End the line that was begun, so that what others say begins one."""
        if self._hanging:
            self._target.write("\n")


@contextmanager
def _timed(seconds: float) -> Iterator[None]:
    """Raise _TimeUp after some time; only in a main thread, and where there are such signals."""
    able = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
    if not able or signal.getitimer(signal.ITIMER_REAL)[0]:  # a run inside a run is timed by it
        yield
        return
    before = signal.signal(signal.SIGALRM, _up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _up(number: int, frame: FrameType | None) -> None:
    del number, frame
    raise _TimeUp


def in_words(remarks: Sequence[Remark]) -> list[str]:
    """Return a sentence for all remarks on the same of an estimator."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.estimator, remark.what), []).append(remark)
    return [_sentence(*key, found) for key, found in groups.items()]


def _sentence(estimator: str, what: str, found: Sequence[Remark]) -> str:
    times = sum(remark.times for remark in found)
    if what == PRINTED:
        lines = "1 line" if times == 1 else f"{times} lines"
        return (
            f"{estimator} printed {lines}: to stderr, for results go to stdout, and of each "
            f"run the first {SHOWN} only"
        )
    runs = "once" if times == 1 else f"{times} times"
    return (
        f"{estimator} returned an estimate that is not finite {runs}, first {found[0].where}: "
        "such a run counts as diverged"
    )
