"""Bad input of every kind, for as long as one likes.

    python tests/fuzz/run.py [KIND …] --minutes 60

What is found is printed with the file that did it, smallest first, and kept in the folder FOUND;
put it into tests/fuzz/found/KIND/ when it is mended, so that it stays so.
"""

import argparse
import contextlib
import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import mutations
from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Flaky
from targets import TARGETS, fault, prepare


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
    return fault(TARGETS[kind].act, path)


def batch(kind: str, number: int, examples: int, folder: Path) -> tuple[int, str, bytes]:
    """Try examples; return how many, and the smallest that has a fault, with the fault."""
    tried, last = Counter[str](), ["", b""]

    @seed(number)
    @settings(
        max_examples=examples, deadline=None, database=None,
        suppress_health_check=list(HealthCheck), phases=[Phase.generate, Phase.shrink],
        report_multiple_bugs=False, verbosity=Verbosity.quiet,
    )  # fmt: skip
    @given(contents(kind, folder))
    def search(data: bytes) -> None:
        tried[kind] += 1
        text = attempt(kind, data, folder)
        if text:
            last[:] = [text, data]
            raise Found(text)

    with contextlib.suppress(Found, Flaky):  # what is not so twice was the hour, not the file
        search()
    return tried[kind], str(last[0]), bytes(last[1])


def main() -> int:
    """Search until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--examples", type=int, default=200, help="of a batch")
    parser.add_argument("--found", type=Path, default=Path("results/fuzz"))
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    kinds, tried, faults = args.kinds or list(TARGETS), Counter[str](), 0
    end = time.monotonic() + 60 * args.minutes
    with tempfile.TemporaryDirectory() as name:
        prepare(Path(name))
        for kind in kinds:  # nobody waits for compilers then
            for good in TARGETS[kind].good(Path(name)):
                fault(TARGETS[kind].act, placed(kind, good, Path(name)), seconds=600)
        while time.monotonic() < end:
            for kind in kinds:
                number = random.SystemRandom().getrandbits(64)
                count, text, data = batch(kind, number, args.examples, Path(name))
                tried[kind] += count
                if text:
                    faults += 1
                    args.found.mkdir(parents=True, exist_ok=True)
                    path = args.found / f"{kind}-{number:x}{TARGETS[kind].suffix}"
                    path.write_bytes(data)
                    print(f"{path}: {text}\n{data[-300:].decode(errors='replace')}\n", flush=True)
            print(f"{sum(tried.values())} files, {faults} faults: {dict(tried)}", flush=True)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
