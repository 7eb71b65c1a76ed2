"""Make an entry: run the frozen suite, and put all into a folder that others can check."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Callable
from contextlib import chdir
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flexaxis.experiments.board.about import About
from flexaxis.experiments.board.entry import RUN, SUMMARY, Entry, is_entry, read, seal
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.source import bring
from flexaxis.experiments.board.stored import own_of
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.building.code import digest
from flexaxis.experiments.building.misfits import readable
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.files import dumps, make_folder, write_json, write_text
from flexaxis.experiments.running.names import COLUMNS, LOCK, SCORES
from flexaxis.experiments.running.rows import read as read_rows
from flexaxis.experiments.running.work import made_with
from flexaxis.experiments.scoring.ranking import CONTROLS
from flexaxis.experiments.studies.sweep import FACTORS, reference, settings, sweep


def submit(
    estimator: str,
    folder: Path,
    about: About,
    board: Board,
    means: Means | None = None,
    *,
    quick: bool = False,
    resume: bool = False,
    command: str = "",
    say: Callable[[str], object] = lambda text: None,
) -> Entry:
    """Run an estimator on the frozen suite and write an entry.

    Parameters
    ----------
    estimator : str
        As for `--estimator`; its code is copied into the entry and run from there.
    folder : Path
        Of the entry; made if it is missing.
    about : About
    board : Board
    means : Means, optional
    quick, resume : bool
        Whether the board is one for trying; whether to go on with what was run before.
    command : str
        The line that was typed.
    say : callable, optional
        Called with what is left out.

    Raises
    ------
    EntryError
        If the folder holds an entry already, or something else.
    EstimatorError, StudyError
        If the estimator cannot be made, or fails on a record.
    """
    _check_may(estimator, folder, resume)
    make_folder(folder)
    text = bring(estimator, folder)
    with chdir(folder):
        scenarios, left_out = readable(board.scenarios, [text])
        for name, reason in left_out.items():
            say(f"{name} is left out, and counts as doing nothing: {reason}")
        mine = Board(board.name, tuple(scenarios), board.seeds)
        turned = _run(text, mine, means or Means(), resume=resume)
        code = digest(text)
    token = os.urandom(6).hex()  # in the place of the computer's name, and for this entry only
    found = own_of(_masked(folder / RUN / SCORES, token), about.label, text, turned, mine)
    write_json(folder / SUMMARY, asdict(found))
    _tidy(folder)
    content: dict[str, Any] = {
        "about": asdict(about),
        "estimator": text,
        "suite": _described(board),
        "quick": quick,
        "left_out": left_out,
        "settings": turned,
        "environment": environment(token) | ({"code": code} if code else {}),
        "command": command,
    }
    seal(folder, content)
    return read(folder)


def _tidy(folder: Path) -> None:
    """Remove what is of this machine: locks, and what Python has compiled of the code."""
    for name in (LOCK, COLUMNS):
        (folder / RUN / name).unlink(missing_ok=True)
    for path in list(folder.rglob("__pycache__")):
        shutil.rmtree(path)


def _check_may(estimator: str, folder: Path, resume: bool) -> None:
    if estimator.partition("[")[0].strip() in CONTROLS:
        raise EntryError(
            f"{estimator} is a control: it knows more than an estimator may, or does nothing, and "
            "enters no board"
        )
    if is_entry(folder):
        raise EntryError(
            f"{folder} holds a finished entry: choose another folder with -o, or remove it"
        )
    if folder.is_dir() and not resume and any(folder.iterdir()):
        raise EntryError(
            f"{folder} is not empty: add --resume to go on with what was run there, or choose "
            "another folder with -o"
        )


def _run(text: str, board: Board, means: Means, *, resume: bool) -> dict[str, dict[str, float]]:
    """Run all that is asked, and return the settings by scenario, with the turns of the knob."""
    turned: dict[str, dict[str, float]] = {}
    with Bench(board.scenarios, Path(RUN), means, resume=resume) as bench:
        if board.nuisances:
            bench.runs(board.nuisances, [text], board.seeds)
            turned |= {s.name: {text: 1.0} for s in board.nuisances}
        if board.faults:
            found = sweep(board.faults, [text], board.seeds, bench)
            turned |= {s.name: {} for s in board.faults}
            for point in found.points:
                turned[point["scenario"]][point["setting"]] = float(point["factor"])
    return turned


def cases(text: str, board: Board) -> int:
    """Return how many cases an entry takes at least; knobs may be turned further."""
    each = len(dict.fromkeys([reference(), *settings([text], factors=FACTORS)[text]]))
    return (len(board.faults) * each + len(board.nuisances)) * len(board.seeds)


def _described(board: Board) -> dict[str, Any]:
    return {
        "name": board.name,
        "hash": board.hash,
        "scenarios": board.hashes,
        "seeds": list(board.seeds),
    }


def environment(token: str) -> dict[str, str]:
    """Return on what rows are made: versions, Python, system, processor."""
    packages = ("flexaxis", "mujoco", "numpy", "scipy", "numba")
    return {name: version(name) for name in packages} | {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "processor": _processor(),
        "cores": str(os.cpu_count() or 1),
        "made_with": made_with(),
        "host": token,
        "byte_order": sys.byteorder,
    }


def _processor() -> str:
    """Return the name of the processor, as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())


def _masked(path: Path, token: str) -> list[dict[str, Any]]:
    """Return the rows of a file, the name of the computer taken from them and from the file."""
    rows = list(read_rows(path))
    for row in rows:
        row["cost"]["host"] = token
    write_text(path, "".join(dumps(row) + "\n" for row in rows))
    return rows
