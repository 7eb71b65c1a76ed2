"""A user's code as a guest: what it prints goes to stderr, and it ends in time.

What it raises, `sys.exit` and a timeout included, is an `EstimatorCrash` that says where. Code in
files and modules has a process of its own (`flexaxis.experiments.building.away`), and what it does
there to its folder, to NumPy or to the process is nobody else's. An object or a class of a session
lives in the process of whoever hands it over, and is trusted with it. Code of the registry is left
alone.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from numbers import Real
from types import FrameType
from typing import NamedTuple

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import StepError
from flexaxis.experiments.building.code import given, is_given, names_code, piped
from flexaxis.experiments.building.crashes import crash

LIMIT = 600.0
"""s for one run of a user's estimator, or for making one: far more than a benchmark is for."""

_limit: ContextVar[float] = ContextVar("limit", default=LIMIT)


class Remark(NamedTuple):
    """A run in which an estimator returned what is not finite: of whom, and where first."""

    estimator: str
    where: str


class Told(NamedTuple):
    """What a user's code is doing, as `hosted` takes it."""

    text: str
    doing: str
    first: int = 0
    period: float | None = None
    refusing: bool = False


_now: ContextVar[tuple[Told, float] | None] = ContextVar("now", default=None)
_at_home: list[bool] = []  # whether this process is that of a user's code


def stay() -> None:
    """Have all code run in this process, which is that of a user's code."""
    _at_home.append(True)


def is_away(text: str) -> bool:
    """Whether an estimator's text names code that has a process of its own."""
    handed = given(text.partition("[")[0].strip())
    if not names_code(text) or _at_home or piped(text) or handed:
        return False
    from multiprocessing import current_process

    return not current_process().daemon  # which may start no other, such as one of Dask


def asked(text: str, doing: str) -> tuple[Told, float]:
    """Return what is going on and the time that is left to it [s]; else what is about to."""
    told, until = _now.get() or (Told(text, doing, refusing=True), _until())
    return told, max(until - time.monotonic(), 0.0)


def _until() -> float:
    """Return when code that begins now is to end: with what it is a part of."""
    outer = _now.get()
    return outer[1] if outer else time.monotonic() + time_limit()


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
        Whether it is code of a user in this process; as `text` says by default.

    Raises
    ------
    EstimatorError
        If its step returns another number of values than it has names.
    EstimatorCrash
        For whatever it raises, and where it takes longer than `time_limit`.
    """
    here = is_guest(text) and not is_away(text) if guest is None else guest
    token = _now.set((Told(text, doing, first, period, refusing), _until()))
    try:
        if here:
            with redirect_stdout(sys.stderr), _timed(time_limit()):
                yield
        else:
            yield
    except _TimeUp as error:
        limit = TimeoutError(no_end())
        raise crash(text, doing, limit.with_traceback(error.__traceback__)) from None
    except StepError as error:  # which says itself where
        raise EstimatorError(f"{text}, {doing}{_sample(error, first, period)}: {error}") from error
    except BaseException as error:
        refused = refusing and isinstance(error, EstimatorError)
        if refused or hasattr(error, "outside") or not _its_own(error):
            raise
        raise crash(text, doing + _sample(error, first, period), error) from error
    finally:
        _now.reset(token)


def complete(error: EstimatorError, *, outside: bool = False) -> EstimatorError:
    """Return an error that says it all already; `outside` where it is not the estimator's own."""
    error.__dict__["outside"] = outside
    return error


def no_end() -> str:
    """Return what is said of code that takes longer than it may."""
    return (
        f"no end within {time_limit():g} s; if it needs longer, give --time-limit "
        "(in Python time_limit=)"
    )


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
