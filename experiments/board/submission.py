"""Make an entry: run the frozen suite, and put rows and code into a folder for others to check."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.compiler import gathers
from flexaxis.experiments.board.entry import (
    CODE,
    ENTRY,
    ROWS,
    About,
    BoardEntry,
    EntryError,
    formed,
    read,
    seal,
)
from flexaxis.experiments.board.ranking import Board
from flexaxis.experiments.building.code import (
    PIPE,
    code_file,
    digest,
    imported_neighbours,
    piped,
)
from flexaxis.experiments.building.estimator_text import parse
from flexaxis.experiments.building.ready import readable, ready
from flexaxis.experiments.comparison.ranking import CONTROLS
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.scoring.windows import windows
from flexaxis.experiments.storage.files import dumps, make_folder, write_text, writing
from flexaxis.experiments.studies.knobs import knob_of
from flexaxis.experiments.studies.sweep import FACTORS, reference, settings, sweep
from flexaxis.sim.scenario import Scenario

LARGEST = 2_000_000  # bytes of a file of code: many times what anyone writes by hand
RUN = "run"
"""Where rows are kept while the suite runs; the entry that is made of them does without it."""


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
) -> BoardEntry:
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
        left_out |= _blind(text, Board(board.name, tuple(scenarios), board.seeds).faults)
        for name, reason in left_out.items():
            say(f"{name} is left out, and counts as doing nothing: {reason}")
        rest = tuple(scenario for scenario in scenarios if scenario.name not in left_out)
        mine = Board(board.name, rest, board.seeds)
        turns, rows = _run(text, mine, means or Means())
        knob, code = knob_of(text), digest(text)
    every = {turn for line in turns.values() for turn in line}
    content: dict[str, Any] = {
        "about": asdict(about),
        "estimator": text,
        "suite": board.hash,
        "quick": quick,
        "knob": {str(turn): knob.turned(turn) for turn in sorted(every)} if knob else {},
        "turns": turns,
        "left_out": left_out,
        "environment": environment() | ({"code": code} if code else {}),
        "command": command,
    }
    formed(folder, content | {"digest": ""})  # while there is something to go on with
    write_text(folder / ROWS, "".join(dumps(row) + "\n" for row in rows))
    shutil.rmtree(folder / RUN)
    for path in list(folder.rglob("__pycache__")):
        shutil.rmtree(path)
    seal(folder, content)
    return read(folder)


def _check_may(estimator: str, folder: Path, resume: bool) -> None:
    if estimator.partition("[")[0].strip() in CONTROLS:
        raise EntryError(
            f"{estimator} is a control: it knows more than an estimator may, or does nothing, and "
            "enters no board"
        )
    if (folder / ENTRY).is_file():
        raise EntryError(
            f"{folder} holds a finished entry: choose another folder with -o, or remove it"
        )
    if folder.is_dir() and not resume and any(folder.iterdir()):
        raise EntryError(
            f"{folder} is not empty: add --resume to go on with what was run there, or choose "
            "another folder with -o"
        )


def _blind(text: str, faults: Sequence[Scenario]) -> dict[str, str]:
    """Return why there is no lag to take on some faults, by name: nothing estimated changes."""
    found = {}
    for scenario in faults:
        with gathers(), suppress(EstimatorError):  # told where it is to be run
            names = ready(parse(text), scenario).names
            if not any(window.D > 0 for window in windows(scenario, names)):
                what = f"{text} estimates {', '.join(names)}, of which nothing changes in"
                found[scenario.name] = f"{what} {scenario.name}"
    return found


def _run(
    text: str, board: Board, means: Means
) -> tuple[dict[str, list[float]], list[dict[str, Any]]]:
    """Run all that is asked; return the turns of the knob by scenario, and the estimator's rows."""
    calm = [scenario for scenario in board.scenarios if scenario not in board.faults]
    lines = {scenario.name: {text: 1.0} for scenario in calm}
    with Bench(board.scenarios, Path(RUN), means) as bench:
        if board.faults:
            found = sweep(board.faults, [text], board.seeds, bench)
            lines |= {scenario.name: {} for scenario in board.faults}
            for point in found.points:
                lines[point["scenario"]][point["setting"]] = float(point["factor"])
        rows = []
        for scenario in board.scenarios:
            for setting in lines[scenario.name]:
                runs = bench.runs([scenario], [setting], board.seeds)[scenario.hash, setting]
                rows += [row for run in runs for row in run]
    own = [{key: value for key, value in row.items() if key != "cost"} for row in rows]
    return {name: list(line.values()) for name, line in lines.items()}, own


def cases(text: str, board: Board) -> int:
    """Return how many cases an entry takes at least; knobs may be turned further."""
    each = len(dict.fromkeys([reference(), *settings([text], factors=FACTORS)[text]]))
    calm = len(board.scenarios) - len(board.faults)
    return (len(board.faults) * each + calm) * len(board.seeds)


def environment() -> dict[str, str]:
    """Return on what rows are made: versions, Python, system, processor; no name of a computer."""
    packages = ("flexaxis", "mujoco", "numpy", "scipy", "numba")
    return {name: version(name) for name in packages} | {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "cores": str(os.cpu_count() or 1),
    }


def bring(estimator: str, entry: Path) -> str:
    """Copy what an estimator names into an entry, and return its text as seen from there.

    A file comes with what it imports from its folder; of a program, every word of its command that
    is a file below the present folder. What a registered name or an installed module means is
    installed by whoever checks.

    Raises
    ------
    EntryError
        If a file is too large, or lies where it cannot be copied to.
    """
    if command := piped(estimator):
        return PIPE + shlex.join(_brought(command, entry))
    if not (name := code_file(estimator)):
        return estimator
    file = Path(name).resolve()
    if not file.is_file():
        return estimator  # said where it is to be built
    for each in [file, *imported_neighbours(file)]:
        if not each.is_relative_to(file.parent):
            raise EntryError(
                f"{each}: lies outside {file.parent}, and an entry holds one folder of code: put "
                "what the estimator imports beside it, or make it a package that `install` installs"
            )
        _copy(each, entry / CODE / each.relative_to(file.parent))
    return f"{CODE}/{file.name}{estimator.removeprefix(name)}"


def _brought(command: str, entry: Path) -> Iterator[str]:
    """Yield the words of a command, those copied that are files here."""
    for word in shlex.split(command):
        path = Path(word)
        mine = not path.is_absolute() and ".." not in path.parts and path.is_file()
        if mine:
            _copy(path, entry / CODE / path)
        yield f"{CODE}/{path.as_posix()}" if mine else word


def _copy(source: Path, target: Path) -> None:
    content = source.read_bytes()
    if len(content) > LARGEST:
        raise EntryError(f"{source}: {len(content)} bytes; an entry takes files up to {LARGEST}")
    make_folder(target.parent)
    with writing(target):
        target.write_bytes(content)
