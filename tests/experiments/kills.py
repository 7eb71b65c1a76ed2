"""Kill commands at random moments, again and again, and look at what they leave.

    python tests/experiments/kills.py [COMMAND …] [--kills 60] [--seed 1]

A command runs in a fork of this process, in which everything is imported: so the moments fall on
its work, and not on the seconds that Python takes to start. The fork is killed at a random moment
of the time that the whole takes; then it is looked at what is there, and the same command goes on,
and is killed again, until it gets to its end. Then it begins anew in an empty folder.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import random
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))  # where it is run as a program
from tests.experiments.kept_rows import lines_of

Words = Sequence[str]
RESULT = ("summary.json", "compare.json")  # without one of them a result is not complete


@dataclass(frozen=True)
class Task:
    """A command that is killed.

    Attributes
    ----------
    words : sequence of words
        What is run, one after the other.
    folder : Path
        What it writes to.
    """

    words: Sequence[Words]
    folder: Path


@dataclass
class Tally:
    """What was seen of a command."""

    name: str
    kills: int = 0
    rounds: int = 0
    seen: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def note(self, kind: str, found: Sequence[str]) -> None:
        """Count faults of a kind."""
        self.seen[kind] += len(found)
        self.faults += [f"{self.name}, kill {self.kills}: {kind}: {text}" for text in found]


KINDS = (
    "torn",
    "doubled",
    "lost",
    "differs at the end",
    "leftovers",
)
TIMES = ("cost", "us_per_sample", "seconds_per_sample")  # in no two results the same


def prepare(place: Path, scenario: Path, names: Sequence[str]) -> dict[str, Task]:
    """Return the commands; what those named read is made."""
    short, out, shares = str(scenario), place / "out", [place / f"share{i}" for i in (1, 2, 3)]
    study = place / "study.toml"
    study.write_text(
        f"scenario = '{short}'\nestimators = ['frozen', 'rpem-forgetting']\nseeds = 12\n"
        "[sweep]\n'fault[0].factor' = [1.2, 2.0]\n"
    )
    words = {
        "run": ["run", short, "--seeds", "24", "-o", str(out / "run")],
        "compare": ["compare", short, "--base", "rpem-forgetting", "--candidate", "ekf",
                    "--seeds", "16", "-o", str(out / "compare")],
        "tune": ["tune", "ekf", "--seeds", "0:2", "-o", str(out / "tune"),
                 "--save", str(out / "tuned.toml")],
        "study": ["study", str(study), "-o", str(out / "study")],
    }  # fmt: skip
    tasks = {name: Task([[*each, "--jobs", "1"]], out / name) for name, each in words.items()}
    if not {"merge", "export"} & {*names}:
        return tasks
    for number, share in enumerate(shares, 1):
        parts = ["run", short, "--seeds", "24", "--shard", f"{number}/3", "-o", str(share)]
        assert run([[*parts, "--jobs", "1"]]) == 0
    merge = ["merge", *map(str, shares), "-o", str(out / "merge")]
    tasks["merge"] = Task([merge], out / "merge")
    forms = {"csv": "csv", "netcdf": "nc", "parquet": "parquet"}
    assert run([["merge", *map(str, shares), "-o", str(place / "whole")]]) == 0
    exports = [
        ["export", str(place / "whole"), f"--{form}", str(out / "export" / f"table.{suffix}")]
        for form, suffix in forms.items()
    ]
    tasks["export"] = Task(exports, out / "export")
    return tasks


def own_suite() -> None:
    """Let `run` sweep a scenario over the knobs, too, as it does for a suite of the catalogue."""
    from flexaxis.experiments.catalogue import find

    usual = find.select

    def select(names: Sequence[str]) -> Any:
        chosen = usual(names)
        return chosen._replace(
            estimators=["frozen", "rpem-forgetting"],
            swept_scenarios=chosen.scenarios,
            swept_estimators=["rpem-forgetting"],
        )

    find.select = select


def begin(lines: Sequence[Words]) -> int:
    """Run commands in a fork and return its number."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    status = 99
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with open(os.environ.get("KILLS_LOG", os.devnull), "a", encoding="utf-8") as log:
            os.dup2(log.fileno(), 1), os.dup2(log.fileno(), 2)
        status = here(lines)
        sys.stdout.flush()
    finally:
        os._exit(status)


def here(lines: Sequence[Words]) -> int:
    """Run commands in this process; return the exit status of the first that is not 0."""
    from flexaxis.experiments.cli import main

    return next((status for line in lines if (status := main(list(line)))), 0)


def run(lines: Sequence[Words]) -> int:
    """Run commands in a fork to their end; return the exit status of the first that is not 0."""
    return os.waitstatus_to_exitcode(os.waitpid(begin(lines), 0)[1])


def killed(lines: Sequence[Words], moment: float) -> int | None:
    """Kill commands after so many seconds; return their exit status if they ended before."""
    child = begin(lines)
    end = time.monotonic() + moment
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return None if status == -signal.SIGKILL else status


# ------------------------------------------------------- what is looked at


def files(folder: Path) -> list[Path]:
    """Return all files in a folder that anyone is to read."""
    found = [path for path in folder.rglob("*") if path.is_file()]
    return [p for p in found if not (hidden(p, folder) or p.name.endswith("-journal"))]


def hidden(path: Path, folder: Path) -> bool:
    """Whether a file, or a folder that it is in, is hidden."""
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def leftovers(folder: Path) -> list[Path]:
    """Return the hidden files and folders that nobody needs."""
    return [path for path in folder.rglob("*") if hidden(path, folder)]


def whole(path: Path) -> bool:
    """Whether a file is complete, whatever it holds."""
    import h5py
    import numpy as np

    readers: dict[str, Callable[[Path], Any]] = {
        ".json": lambda path: json.loads(path.read_bytes()),
        ".sqlite": _sqlite,
        ".toml": lambda path: tomllib.loads(path.read_text()),
        ".npz": lambda path: [np.load(path)[name] for name in np.load(path).files],
        ".nc": lambda path: h5py.File(path).visititems(lambda _, each: each and None),
        ".parquet": _parquet,
        ".html": lambda path: path.read_text().rstrip().endswith("</html>") or 1 / 0,
        ".md": lambda path: path.read_text().endswith("\n") or 1 / 0,
        ".csv": lambda path: path.read_text().endswith("\n") or 1 / 0,
    }
    try:
        readers[path.suffix](path)
    except Exception:
        return False
    return True


def _sqlite(path: Path) -> None:
    """Look at a file with its journal, as the next who opens it does, in a copy."""
    with tempfile.TemporaryDirectory() as place:
        for each in path.parent.glob(f"{path.name}*"):
            shutil.copy(each, place)
        with closing(sqlite3.connect(Path(place) / path.name)) as db:
            assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def _parquet(path: Path) -> Any:
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path)


def cases(folder: Path) -> dict[str, list[str]]:
    """Return the rows of each case in the files of a folder, without what they cost."""
    found: dict[str, list[str]] = {}
    with contextlib.suppress(sqlite3.OperationalError):  # killed before it had its tables
        for line in lines_of(folder):
            row = {name: value for name, value in line.items() if not name.startswith("cost.")}
            found.setdefault(row["case"], []).append(json.dumps(row))
    return found


def torn(found: dict[str, list[str]]) -> list[str]:
    """Return the cases that have not as many rows as they say."""
    return [case for case, rows in found.items() if len(rows) < json.loads(rows[0])["rows"]]


def doubled(found: dict[str, list[str]]) -> list[str]:
    """Return the cases that are there more than once."""
    return [case for case, rows in found.items() if len(rows) > json.loads(rows[0])["rows"]]


# ----------------------------------------------------------------- the kills


@dataclass(frozen=True)
class Expected:
    """What a command leaves that nobody kills: status, rows, files, and what they say."""

    status: int
    rows: dict[str, list[str]]
    names: set[str]
    said: dict[str, Any]

    @classmethod
    def of(cls, task: Task, status: int) -> Expected:
        """Look at what there is."""
        place = task.folder
        names = {str(p.relative_to(place)) for p in files(place)}
        return cls(status, cases(place), names, said(place))

    def differences(self, other: Expected) -> list[str]:
        """Return what is not the same."""
        found = [f"status {other.status}"] * (self.status != other.status)
        found += [f"{name}: here or there" for name in sorted(self.names ^ other.names)]
        for mine, its in ((self.rows, other.rows), (self.said, other.said)):
            found += [
                f"{k} differs" for k in sorted(mine.keys() | its) if mine.get(k) != its.get(k)
            ]
        return found


def said(folder: Path) -> dict[str, Any]:
    """Return what the results say, but for the time that it took."""

    def timeless(content: Any) -> Any:
        if isinstance(content, dict):
            return {k: timeless(v) for k, v in content.items() if k not in TIMES}
        return list(map(timeless, content)) if isinstance(content, list) else content

    found = {}
    for path in [*files(folder), *folder.parent.glob("tuned.toml")]:
        if path.name in RESULT:
            found[str(path.name)] = timeless(json.loads(path.read_bytes()))
        if path.suffix in (".csv", ".parquet", ".toml") or path.name == "table.nc":
            found[path.name] = path.read_bytes()
    return found


def torment(name: str, task: Task, kills: int, chance: random.Random) -> Tally:
    """Kill a command so often at work, and return what was seen."""
    _emptied(task.folder)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        good = here(task.words)  # all that it imports and compiles is there now
    _emptied(task.folder)
    began = time.monotonic()
    assert run(task.words) == good < 2, name  # a verdict may be a finding
    lasts = time.monotonic() - began
    tally, expected = Tally(name), Expected.of(task, good)
    while tally.kills < kills:
        _emptied(task.folder)
        status = _round(task, tally, kills, lambda: chance.uniform(0.0, lasts))
        tally.note("differs at the end", expected.differences(Expected.of(task, status)))
    tally.seen["leftovers"] = len(leftovers(task.folder.parent))
    return tally


def _emptied(folder: Path) -> None:
    """Leave a folder with nothing in it, which an export writes into and does not make."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)


def _round(task: Task, tally: Tally, kills: int, moment: Callable[[], float]) -> int:
    """Begin, and go on, until the command gets to its end; return its status then."""
    tally.rounds += 1
    before = set[str]()
    while True:
        status = run(task.words) if tally.kills == kills else killed(task.words, moment())
        if status is not None:
            return status
        tally.kills += 1
        found = cases(task.folder)
        tally.note("torn", [str(path) for path in files(task.folder.parent) if not whole(path)])
        tally.note("torn", torn(found))
        tally.note("doubled", doubled(found))
        tally.note("lost", sorted(before - found.keys()))
        before = set(found)


def table(tallies: Sequence[Tally]) -> str:
    """Return what was seen, a line a command."""
    heads = ["command", "kills", "to the end", *KINDS]
    lines = [heads] + [
        [t.name, str(t.kills), str(t.rounds), *(str(t.seen[kind]) for kind in KINDS)]
        for t in tallies
    ]
    widths = [max(len(line[i]) for line in lines) for i in range(len(heads))]
    return "\n".join(
        "  ".join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in lines
    )


ALL = ("run", "compare", "tune", "study", "merge", "export")


def main() -> int:
    """Kill, and print what was seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=ALL)
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    from conftest import SHORT

    from flexaxis.experiments.catalogue.find import find_scenario

    with tempfile.TemporaryDirectory() as place:
        os.environ.setdefault("FLEXAXIS_CACHE", str(Path(place) / "cache"))
        scenario = Path(place) / "short.toml"
        scenario.write_text(find_scenario("fm_step-v1").override(SHORT).to_toml())
        own_suite()
        tasks = prepare(Path(place), scenario, args.names)
        tallies = []
        for name in args.names:
            began = time.monotonic()
            chance = random.Random(f"{name} {args.seed}")
            tallies.append(torment(name, tasks[name], args.kills, chance))
            print(f"{name}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
            print("\n".join(tallies[-1].faults[:20]), flush=True)
        print(table(tallies))
    return int(any(tally.faults for tally in tallies))


if __name__ == "__main__":
    sys.exit(main())
