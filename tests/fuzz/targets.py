"""The commands that read files, and what may come of them: an answer, or an error in one line."""

import contextlib
import functools
import io
import re
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import documents

from flexaxis.experiments import cli
from flexaxis.experiments.cli import main

SECONDS = 10.0  # an answer to bad input takes no longer, waiting for a free processor aside
MEMORY = 1 << 30  # bytes, by which the process may grow
LINES, LENGTH = 60, 2000  # of an error and of each; more are read by nobody
STATUS = (0, 1, 2)  # of `flexaxis`: fine, a finding, wrong use
PARSER = functools.cache(cli.parser)  # a command builds it once; so do thousands of them here


class Over(BaseException):
    """Time is over; nobody takes it for an error of theirs, as an `except OSError` would."""


class Target(NamedTuple):
    """Good files of a kind, as tables or as they are; how tables are written; what reads one."""

    good: Callable[[Path], list[Any]]
    written: Callable[[Any], str] | None
    act: Callable[[Path], int]
    suffix: str = ".toml"
    seconds: float = SECONDS


def command(*words: str) -> Callable[[Path], int]:
    """Return a call of `flexaxis`; FILE is the path, DIR its folder, TEXT what stands in it."""

    def act(path: Path) -> int:
        places = {"FILE": str(path), "DIR": str(path.parent)}
        if "TEXT" in words:
            places["TEXT"] = path.read_text("utf-8", errors="replace")
        return main([re.sub("FILE|DIR|TEXT", lambda m: places[m[0]], word) for word in words])

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


def report_with(name: str) -> Callable[[Path], int]:
    """Return a call of `flexaxis report` on a run of which one file is another."""

    def act(path: Path) -> int:
        folder = path.parent / "changed"
        shutil.copytree(path.parent / "run", folder, dirs_exist_ok=True)
        shutil.copy(path, folder / name)
        return main(["report", str(folder), "-o", str(path.parent / "report.html")]) or main(
            ["export", str(folder), "--csv", str(path.parent / "rows.csv")]
        )

    return act


def merged_with(name: str) -> Callable[[Path], int]:
    """Return a call of `flexaxis merge` on a folder of version 0.1 with such rows."""

    def act(path: Path) -> int:
        old, new = path.parent / "old", path.parent / "merged"
        shutil.rmtree(new, ignore_errors=True)
        old.mkdir(exist_ok=True)
        shutil.copy(path.parent / "run" / "study.json", old)
        shutil.copy(path, old / name)
        return main(["merge", str(old), "-o", str(new)])

    return act


LOG = ("import", "DIR/log.csv", "-o", "DIR/log.nc")
TRACK = ("track", "DIR/log.csv", "-o", "DIR/tracked.nc", "--identify", "J_m")
OWN = ("import", "FILE", "-o", "DIR/log.nc", "--time", "t", "--torque", "u", "--angle", "phi")
ESTIMATE = ("estimate", "-o", "DIR/estimates.nc", "--estimator")
ANSWERS = f"{sys.executable} -S DIR/answers.py"  # a program that says what stands in a file
PIPE = ("--time-limit", "2", "DIR/record.nc")
TARGETS = {
    "scenario": Target(documents.scenarios, documents.toml, command("show", "FILE")),
    "study": Target(documents.studies, documents.toml, command("study", "FILE", "--dry-run")),
    "lesson": Target(documents.lessons, documents.toml, read_lesson),
    "axis": Target(
        documents.axes,
        documents.toml,
        command(*TRACK, "--time", "t", "--torque", "u", "--angle", "phi", "--model", "FILE"),
    ),
    "map": Target(documents.maps, documents.toml, command(*LOG, "--map", "FILE")),
    "estimator": Target(
        documents.estimators, None, command(*ESTIMATE, "TEXT", "DIR/record.nc"), seconds=120.0
    ),  # an option may need code that is not compiled yet
    "record": Target(documents.records, None, command(*ESTIMATE, "rpem-forgetting", "FILE")),
    "csv": Target(documents.tables, documents.separated, command(*OWN), ".csv"),
    "mat": Target(documents.mats, None, command(*OWN), ".mat"),
    "hdf5": Target(documents.hdf5s, None, command(*OWN), ".h5"),
    "pipe": Target(
        documents.blocks, None, command(*ESTIMATE, f"pipe:{ANSWERS} blocks FILE", *PIPE)
    ),
    "rows": Target(documents.rows, documents.lines, merged_with("scores.jsonl")),
    "told": Target(documents.told, documents.lines, report_with("study.json")),
    "summary": Target(documents.summaries, documents.lines, report_with("summary.json")),
}


def prepare(folder: Path) -> None:
    """Make what commands want beside the file in question: a log, a record, a finished run."""
    rows = [(0.001 * k, (k * 7919 % 13) / 6 - 1, k % 50 / 50) for k in range(400)]
    lines = ["t,u,phi", *(",".join(map(str, row)) for row in rows)]
    (folder / "log.csv").write_text("\n".join(lines))
    (folder / "short.toml").write_text(documents.SHORT)
    (folder / "answers.py").write_text(documents.ANSWERS)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(["simulate", str(folder / "short.toml"), "-o", str(folder / "record.nc")])
        words = ["--estimator", "rpem-forgetting", "--seeds", "2", "--jobs", "1"]
        main(["run", str(folder / "short.toml"), *words, "-o", str(folder / "run")])


def fault(act: Callable[[Path], int], path: Path, seconds: float = SECONDS) -> str:
    """Let a command read a file; return what is wrong with how it answers, or nothing."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with (
            limited(seconds),
            mock.patch.object(cli, "parser", PARSER),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            status = act(path)
    except SystemExit as error:  # argparse
        status = error.code
    except Over:
        return f"no answer in {seconds:g} s"
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # what panics in Rust is no Exception
        return f"{type(error).__name__}: {error}"[:600]
    said = err.getvalue()
    if status not in STATUS or "Traceback (most" in said:
        return f"status {status}: {said[-600:]}"
    if status == 2 and not said.strip():
        return "status 2 without a word"
    lines = [line for line in said.splitlines() if line.startswith("flexaxis:")]
    if len(lines) > LINES or max(map(len, lines), default=0) > LENGTH:
        return f"{len(lines)} lines of error, {sum(map(len, lines))} characters: {said[:300]}"
    return ""


def queued() -> float:
    """Return how long this process has waited for a processor [s]; 0 where that is not told."""
    try:
        return int(Path("/proc/self/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError, ValueError):
        return 0.0


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Let it take so long, and so much memory."""

    began, line = time.monotonic(), queued()

    def over(*_: object) -> None:
        left = seconds - (time.monotonic() - began) + (queued() - line)
        # again in a second, should whoever is called just now drop what it does not expect
        signal.setitimer(signal.ITIMER_REAL, max(left, 0.01) if left > 0 else 1.0)
        if left <= 0:
            raise Over

    usual = signal.signal(signal.SIGALRM, over)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if sys.platform == "linux" else 0
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, usual)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
