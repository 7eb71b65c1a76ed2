"""The commands that read files, and what may come of them: an answer, or an error in one line."""

import contextlib
import io
import re
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import documents

from flexaxis.experiments.cli import main

SECONDS = 10.0  # an answer to bad input takes no longer
MEMORY = 1 << 30  # bytes, by which the process may grow
LINES, LENGTH = 60, 2000  # of an error and of each; more are read by nobody
STATUS = (0, 1, 2)  # of `flexaxis`: fine, a finding, wrong use


class Target(NamedTuple):
    """Good files of a kind, and what reads one: a command, and what it gives as its status."""

    good: Callable[[], list[dict[str, Any]]]
    act: Callable[[Path], int]


def command(*words: str) -> Callable[[Path], int]:
    """Return a call of `flexaxis`; FILE is the path, DIR its folder."""

    def act(path: Path) -> int:
        places = {"FILE": str(path), "DIR": str(path.parent)}
        return main([re.sub("FILE|DIR", lambda found: places[found[0]], word) for word in words])

    return act


def read_lesson(path: Path) -> int:
    """Read a lesson; to draw it takes too long."""
    from flexaxis.experiments.demo.lesson import LessonError, load_lesson

    try:
        load_lesson(path)
    except LessonError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


LOG = ("import", "DIR/log.csv", "-o", "DIR/log.nc")
TARGETS = {
    "scenario": Target(documents.scenarios, command("show", "FILE")),
    "study": Target(documents.studies, command("study", "FILE", "--dry-run")),
    "lesson": Target(documents.lessons, read_lesson),
    "axis": Target(
        documents.axes,
        command(*LOG, "--time", "t", "--torque", "u", "--angle", "phi", "--model", "FILE"),
    ),
    "map": Target(documents.maps, command(*LOG, "--map", "FILE")),
}


def fault(act: Callable[[Path], int], path: Path) -> str:
    """Let a command read a file; return what is wrong with how it answers, or nothing."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with limited(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = act(path)
    except SystemExit as error:  # argparse
        status = error.code
    except TimeoutError:
        return f"no answer in {SECONDS:g} s"
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:600]
    said = err.getvalue()
    if status not in STATUS or "Traceback" in said:
        return f"status {status}: {said[-600:]}"
    if status == 2 and not said.strip():
        return "status 2 without a word"
    lines = said.splitlines()
    if len(lines) > LINES or max(map(len, lines), default=0) > LENGTH:
        return f"{len(lines)} lines of error, {len(said)} characters: {said[:300]}"
    return ""


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Let it take so long, and so much memory."""

    def over(*_: object) -> None:
        raise TimeoutError

    usual = signal.signal(signal.SIGALRM, over)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if sys.platform == "linux" else 0
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, usual)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
