"""Kill commands at random moments, again and again, and look at what they leave.

    python tests/experiments/kills.py [COMMAND …] [--kills 60] [--seed 1]

A command runs in a fork of this process, in which everything is imported: so the moments fall on
its work, and not on the seconds that Python takes to start. The fork is killed at a random moment
of the time that the whole takes; then it is looked at what is there, and the command goes on with
--resume, and is killed again, until it gets to its end. Then it begins again over what is there.
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
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Words = Sequence[str]
RESULT = ("summary.json", "compare.json")  # without one of them a result is not complete


@dataclass(frozen=True)
class Task:
    """A command that is killed.

    Attributes
    ----------
    first, again : sequences of words
        What is run, one after the other: from the beginning, and to go on.
    folder : Path
        What it writes to.
    anew : bool
        Whether `first` may be run over a result that is there, which it replaces.
    """

    first: Sequence[Words]
    again: Sequence[Words]
    folder: Path
    anew: bool = True


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
    "cut short",  # files of rows whose last one was: it is removed when the command goes on
    "torn",
    "doubled",
    "lost",
    "old result lost",
    "differs at the end",
    "leftovers",
)
TIMES = ("cost", "us_per_sample", "seconds_per_sample", "seal")  # in no two results the same


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
    tasks = {
        name: Task([[*each, "--jobs", "1"]], [[*each, "--jobs", "1", "--resume"]], out / name,
                   name != "study")
        for name, each in words.items()
    }  # fmt: skip
    if not {"merge", "export"} & {*names}:
        return tasks
    for number, share in enumerate(shares, 1):
        parts = ["run", short, "--seeds", "24", "--shard", f"{number}/3", "-o", str(share)]
        assert run([[*parts, "--jobs", "1"]]) == 0
    merge = ["merge", *map(str, shares), "-o", str(out / "merge")]
    tasks["merge"] = Task([merge], [merge], out / "merge", anew=False)
    forms = {"csv": "csv", "netcdf": "nc", "parquet": "parquet"}
    assert run([["merge", *map(str, shares), "-o", str(place / "whole")]]) == 0
    exports = [
        ["export", str(place / "whole"), f"--{form}", str(out / "export" / f"table.{suffix}")]
        for form, suffix in forms.items()
    ]
    tasks["export"] = Task(exports, exports, out / "export")
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
    return [path for path in found if not hidden(path, folder)]


def hidden(path: Path, folder: Path) -> bool:
    """Whether a file, or a folder that it is in, is hidden."""
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def leftovers(folder: Path) -> list[Path]:
    """Return the hidden files and folders that nobody needs."""
    from flexaxis.experiments.running.names import COLUMNS

    found = (path for path in folder.rglob("*") if hidden(path, folder))
    return [path for path in found if not path.name.endswith((".lock", COLUMNS))]


def whole(path: Path) -> bool:
    """Whether a file is complete, whatever it holds."""
    import h5py
    import numpy as np

    from flexaxis.experiments.running.sealed import read_sealed

    readers: dict[str, Callable[[Path], Any]] = {
        ".json": lambda path: read_sealed(path, ValueError),
        ".toml": lambda path: tomllib.loads(path.read_text()),
        ".npz": lambda path: [np.load(path)[name] for name in np.load(path).files],
        ".nc": lambda path: h5py.File(path).visititems(lambda _, each: each and None),
        ".parquet": _parquet,
        ".html": lambda path: path.read_text().rstrip().endswith("</html>") or 1 / 0,
        ".md": lambda path: path.read_text().endswith("\n") or 1 / 0,
        ".csv": lambda path: path.read_text().endswith("\n") or 1 / 0,
        # The last row may be cut short: it is removed when the command goes on.
        ".jsonl": lambda path: [json.loads(line) for line in lines(path) if line.endswith(b"\n")],
    }
    try:
        readers[path.suffix](path)
    except Exception:
        return False
    return True


def lines(path: Path) -> list[bytes]:
    """Return the lines of a file, each with its end if it has one."""
    return path.read_bytes().splitlines(keepends=True)


def cut(folder: Path) -> list[str]:
    """Return the files of rows whose last one is cut short."""
    return [
        str(p)
        for p in folder.rglob("scores*.jsonl")
        if p.stat().st_size and not lines(p)[-1].endswith(b"\n")
    ]


def _parquet(path: Path) -> Any:
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path)


def cases(folder: Path) -> dict[str, list[str]]:
    """Return the rows of each case in the files of a folder, without what they cost."""
    found: dict[str, list[str]] = {}
    for path in folder.glob("scores*.jsonl"):
        for line in lines(path):
            with contextlib.suppress(ValueError):
                row = json.loads(line)
                row.pop("cost")
                found.setdefault(row["case"], []).append(json.dumps(row))
    return found


def doubled(found: dict[str, list[str]]) -> list[str]:
    """Return the cases that are there more than once."""
    return [case for case, rows in found.items() if len(rows) > json.loads(rows[0])["rows"]]


def readable(folder: Path, expected: dict[str, list[str]]) -> bool:
    """Whether a folder holds a complete result with these rows at least."""
    there = any((folder / name).exists() and whole(folder / name) for name in RESULT)
    found = cases(folder)
    return (
        there
        and (folder / "study.json").exists()
        and (folder / "report.html").exists()
        and all(found.get(case) == rows for case, rows in expected.items())
    )


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
        # A unit that was cut short is run in two, and so are its trajectories.
        names = {str(p.relative_to(place)) for p in files(place) if p.parent.name != "traces"}
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
    task.folder.mkdir(parents=True, exist_ok=True)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        good = here(task.first)  # all that it imports and compiles is there now
    if not task.anew:
        shutil.rmtree(task.folder)
    began = time.monotonic()
    assert run(task.first) == good < 2, name  # a verdict may be a finding
    lasts = time.monotonic() - began
    tally, expected = Tally(name), Expected.of(task, good)
    while tally.kills < kills:
        if not task.anew:
            shutil.rmtree(task.folder)
        status = _round(task, tally, kills, lambda: chance.uniform(0.0, lasts), expected.rows)
        differ = expected.differences(Expected.of(task, status))
        tally.note("differs at the end", differ + cut(task.folder))
    tally.seen["leftovers"] = len(leftovers(task.folder.parent))
    return tally


def _round(
    task: Task, tally: Tally, kills: int, moment: Callable[[], float], rows: dict[str, list[str]]
) -> int:
    """Begin, and go on, until the command gets to its end; return its status then."""
    tally.rounds += 1
    words, before = task.first, set[str]()
    while True:
        status = run(words) if tally.kills == kills else killed(words, moment())
        if status is not None:
            return status
        tally.kills += 1
        found = cases(task.folder)
        tally.seen["cut short"] += len(cut(task.folder))
        tally.note("torn", [str(path) for path in files(task.folder.parent) if not whole(path)])
        tally.note("doubled", doubled(found))
        tally.note("lost", sorted(before - found.keys()) if words is task.again else [])
        if task.anew and tally.name in ("run", "compare"):
            places = (task.folder, task.folder / "previous")
            kept = any(readable(place, rows) for place in places)
            tally.note("old result lost", ["neither here nor in previous"] * (not kept))
        words, before = task.again, set(found)


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
