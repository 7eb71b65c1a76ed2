"""What to say when code fails that should not: whose it was, what it raised, and where."""

from __future__ import annotations

import errno
import os
import re
import sysconfig
import traceback
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from flexaxis.estimators.errors import EstimatorError

_OWN = ("estimators", "experiments", "models_mjcf", "sim")
_FRAME = re.compile(r'^ *File "([^"]+)", line (\d+)', re.MULTILINE)


class EstimatorCrash(EstimatorError):
    """The code of an estimator raised something; the message says which, what and where."""


def crash(text: str, doing: str, error: BaseException) -> EstimatorCrash:
    """Return the error for an estimator whose code has raised something.

    Parameters
    ----------
    text : str
        As in `--estimator`.
    doing : str
        When it happened, such as "when it was made".
    error : BaseException
        What it raised.
    """
    return EstimatorCrash(f"{text} crashed {doing}: {described(error)}")


_NO_ROOM = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.ENOMEM, errno.EMFILE, errno.ENFILE
}  # fmt: skip


def no_room(error: BaseException) -> bool:
    """Whether a disk, memory or the number of open files has come to its end."""
    return any(
        isinstance(cause, MemoryError) or (isinstance(cause, OSError) and cause.errno in _NO_ROOM)
        for cause in _causes(error)
    )


def is_its_own(error: BaseException) -> bool:
    """Whether an error is the estimator's, and not of memory, a disk, or a missing package."""
    missing = (isinstance(cause, ModuleNotFoundError) for cause in _causes(error))
    outside = (getattr(cause, "outside", False) for cause in _causes(error))
    return not (no_room(error) or any(missing) or any(outside))


def _causes(error: BaseException) -> Iterator[BaseException]:
    cause: BaseException | None = error
    while cause is not None:
        yield cause
        cause = cause.__cause__


def described(error: BaseException) -> str:
    """Return what was raised, and where: in the user's code, if some took part, or in ours."""
    words = _text(error)
    kind = type(error).__name__
    what = f"{kind}: {words}" if words else kind
    places = _places(error)[::-1]
    ours = (place for place in places if place.startswith(_flexaxis()))
    place = user_code(error) or next(ours, next(iter(places), None))
    return f"{what} ({place})" if place else what


def _text(error: BaseException) -> str:
    """Return what an error says in one line: nothing, where its own code cannot say it."""
    try:
        return " ".join(str(error).split())
    except Exception:
        return ""


def user_code(error: BaseException) -> str | None:
    """Return the last place, as ``file.py:12``, in neither flexaxis nor an installed package."""
    paths = sysconfig.get_paths()
    installed = (paths[key] + os.sep for key in ("stdlib", "purelib", "platlib"))
    others = ("<", *_flexaxis(), *installed)
    return next((p for p in reversed(_places(error)) if not p.startswith(others)), None)


def _places(error: BaseException) -> list[str]:
    """Return where an error came through, outermost first; also in the worker it came from."""
    here = [
        f"{frame.filename}:{frame.lineno}" for frame in traceback.extract_tb(error.__traceback__)
    ]
    remote = type(error.__cause__).__name__ == "_RemoteTraceback"  # how a pool sends it: as text
    there = _FRAME.findall(str(error.__cause__)) if remote else []
    return here + [f"{file}:{line}" for file, line in there]


def _flexaxis() -> tuple[str, ...]:
    """Return the folders of flexaxis, as given and with links followed."""
    folders = [import_module(f"flexaxis.{name}").__path__[0] for name in _OWN]
    return tuple(f + os.sep for g in folders for f in (g, str(Path(g).resolve())))
