"""A user's code as a guest: what it prints goes to stderr, it ends in time, and cannot end us.

What it raises, `sys.exit` and a timeout included, is an `EstimatorCrash` that says where. The
folder, NumPy's handling of errors and the depth of calls are put back after it: else results with a
relative path would go elsewhere, and what it asks of NumPy or of the stack would hold for our own
sums. Code of the registry is left alone.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from contextvars import ContextVar
from numbers import Real
from pathlib import Path
from types import FrameType
from typing import NamedTuple, NoReturn

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import StepError
from flexaxis.experiments.building.code import is_given, names_code
from flexaxis.experiments.building.crashes import crash
from flexaxis.experiments.building.neighbours import code_file, move_to

LIMIT = 600.0
"""s for one run of a user's estimator, or for making one: far more than a benchmark is for."""

_limit: ContextVar[float] = ContextVar("limit", default=LIMIT)


class Remark(NamedTuple):
    """A run in which an estimator returned what is not finite: of whom, and where first."""

    estimator: str
    where: str


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


def note(estimator: str, where: str) -> None:
    """Add a remark, if somebody listens."""
    heard = _remarks.get()
    if heard is not None:
        heard.append(Remark(estimator, where))


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
            with put_back(), redirect_stdout(sys.stderr), _timed(time_limit()):
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
    """Return a sentence for all remarks on an estimator."""
    places: dict[str, list[str]] = {}
    for remark in remarks:
        places.setdefault(remark.estimator, []).append(remark.where)
    return [
        f"{estimator} returned an estimate that is not finite "
        f"{'once' if len(where) == 1 else f'{len(where)} times'}, first {where[0]}: such a run "
        "counts as diverged"
        for estimator, where in places.items()
    ]


@contextmanager
def put_back() -> Iterator[None]:
    """Put back the folder, NumPy's handling of errors and the depth of calls at the end.

    Raises
    ------
    SystemExit
        Inside, in the place of `os._exit`, which would end a command with a status of its choice
        and without a word.
    """
    folder, depth = _folder(), sys.getrecursionlimit()
    try:
        with np.errstate(), _no_sudden_end():
            yield
    finally:
        if sys.getrecursionlimit() != depth:
            with suppress(RecursionError):  # we are deeper than that: it was lowered inside as well
                sys.setrecursionlimit(depth)
        if folder is not None and _folder() != folder:
            with suppress(OSError):
                os.chdir(folder)


def _folder() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return None


_inside: list[tuple[int, int]] = []  # thread and process of each `_no_sudden_end` that is open
_usual = [os._exit]  # as it was before the first of them
_one_at_a_time = threading.Lock()


@contextmanager
def _no_sudden_end() -> Iterator[None]:
    """Make `os._exit` an error in this thread and process; others may have their reasons for it.

    Where threads overlap, the last one to leave puts it back.
    """
    here = threading.get_ident(), os.getpid()
    with _one_at_a_time:
        if not _inside:
            _usual[0] = os._exit
        _inside.append(here)
        os._exit = _refused
    try:
        yield
    finally:
        with _one_at_a_time:
            _inside.remove(here)  # not always by the thread that came in: generators move
            if not _inside:
                os._exit = _usual[0]


def _refused(status: int) -> NoReturn:
    if (threading.get_ident(), os.getpid()) in _inside:
        raise SystemExit(f"os._exit({status})")
    _usual[0](status)
