"""Bad input of every kind, for as long as one likes.

    python tests/fuzz/run.py [KIND …] --minutes 60

What is found is printed with the file that did it, smallest first, and kept in the folder FOUND;
put it into tests/fuzz/found/KIND/ when it is mended, so that it stays so.
"""

import argparse
import contextlib
import random
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import mutations
from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Flaky
from targets import TARGETS, fault, prepare

SHARE = 10.0  # s of a batch: what is read in no time is tried more often
FEWEST, MOST = 20, 500  # files of a batch
MEMORY = "/dev/shm"  # a disk that is none, where there is one


class Found(Exception):
    """A fault; hypothesis looks for a smaller file that has one too."""


def contents(kind: str, folder: Path) -> st.SearchStrategy[bytes]:
    """Return a strategy for files of a kind."""
    target = TARGETS[kind]
    good, write = target.good(folder), target.written
    if write is None:
        return mutations.damaged(good)
    tables = mutations.mutated(good).map(lambda content: write(content).encode())
    return st.one_of(tables, tables, tables, mutations.damaged([write(g).encode() for g in good]))


def place(kind: str, folder: Path) -> Path:
    """Return where a command finds a file of a kind, by its usual ending."""
    return folder / f"{kind}{TARGETS[kind].suffix}"


def placed(kind: str, good: Any, folder: Path) -> Path:
    """Write a good file of a kind; return its path."""
    write, path = TARGETS[kind].written, place(kind, folder)
    path.write_bytes(good if write is None else write(good).encode())
    return path


def attempt(kind: str, data: bytes, folder: Path) -> str:
    """Give a command such a file; return what is wrong with how it answers, or nothing."""
    path = place(kind, folder)
    path.write_bytes(data)
    return fault(TARGETS[kind].act, path, TARGETS[kind].seconds)


@dataclass
class Tally:
    """What was seen of a kind: files, faults of each sort, and the most computing for one [s]."""

    files: int = 0
    tracebacks: int = 0
    hangs: int = 0
    memory: int = 0
    longest: float = 0.0
    seconds: float = 0.0

    def note(self, text: str) -> None:
        """Count a fault."""
        self.hangs += text.startswith("no answer")
        self.memory += text.startswith("MemoryError")
        self.tracebacks += not text.startswith(("no answer", "MemoryError"))

    def next(self) -> int:
        """Return how many files the next batch has."""
        each = self.seconds / self.files if self.files else SHARE / FEWEST
        return int(min(MOST, max(FEWEST, SHARE / each)))


def batch(
    kind: str, number: int, examples: int, folder: Path, tally: Tally | None = None
) -> tuple[int, str, bytes]:
    """Try examples; return how many, and the smallest that has a fault, with the fault."""
    tally, last, before = tally or Tally(), ["", b""], time.monotonic()
    already = tally.files

    @seed(number)
    @settings(
        max_examples=examples, deadline=None, database=None,
        suppress_health_check=list(HealthCheck), phases=[Phase.generate, Phase.shrink],
        report_multiple_bugs=False, verbosity=Verbosity.quiet,
    )  # fmt: skip
    @given(contents(kind, folder))
    def search(data: bytes) -> None:
        tally.files += 1
        began = time.process_time()
        text = attempt(kind, data, folder)
        tally.longest = max(tally.longest, time.process_time() - began)
        if text:
            last[:] = [text, data]
            raise Found(text)

    with contextlib.suppress(Found, Flaky):  # what is not so twice was the hour, not the file
        search()
    tally.seconds += time.monotonic() - before
    return tally.files - already, str(last[0]), bytes(last[1])


def main() -> int:
    """Search until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--found", type=Path, default=Path("results/fuzz"))
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    kinds = args.kinds or list(TARGETS)
    tallies = {kind: Tally() for kind in kinds}
    with tempfile.TemporaryDirectory(dir=MEMORY if Path(MEMORY).is_dir() else None) as name:
        warm(kinds, Path(name))
        end = time.monotonic() + 60 * args.minutes
        while time.monotonic() < end:
            each_once(tallies, Path(name), args.found)
            print(table(tallies), flush=True)
    return int(any(t.tracebacks or t.hangs or t.memory for t in tallies.values()))


def warm(kinds: Sequence[str], folder: Path) -> None:
    """Read the good files once, so that nobody waits for compilers later."""
    prepare(folder)
    for kind in kinds:
        for good in TARGETS[kind].good(folder):
            fault(TARGETS[kind].act, placed(kind, good, folder), seconds=600)


def each_once(tallies: dict[str, Tally], folder: Path, found: Path) -> None:
    """Try a batch of every kind; keep and print what is found."""
    for kind, tally in tallies.items():
        number = random.SystemRandom().getrandbits(64)
        _, text, data = batch(kind, number, tally.next(), folder, tally)
        if text:
            tally.note(text)
            found.mkdir(parents=True, exist_ok=True)
            path = found / f"{kind}-{number:x}{TARGETS[kind].suffix}"
            path.write_bytes(data)
            print(f"{path}: {text}\n{data[-300:].decode(errors='replace')}\n", flush=True)


def table(tallies: dict[str, Tally]) -> str:
    """Return what was seen, a line a kind, and this process's largest memory."""
    head = ["kind", "files", "tracebacks", "hangs", "memory", "longest s", "files/s"]
    rows = [
        [kind, t.files, t.tracebacks, t.hangs, t.memory, f"{t.longest:.1f}",
         f"{t.files / max(t.seconds, 1e-9):.0f}"]
        for kind, t in tallies.items()
    ]  # fmt: skip
    sums = [sum(int(row[i]) for row in rows) for i in range(1, 5)]
    seconds = sum(t.seconds for t in tallies.values())
    longest = max(t.longest for t in tallies.values())
    rows.append(["all", *sums, f"{longest:.1f}", f"{sums[0] / max(seconds, 1e-9):.0f}"])
    lines = (" ".join(f"{cell:>11}" for cell in row) for row in [head, *rows])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return "\n".join(lines) + f"\nlargest memory of the process {peak:.2f} GB\n"


if __name__ == "__main__":
    sys.exit(main())
