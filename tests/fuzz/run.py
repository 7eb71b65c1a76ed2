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

sys.path.insert(0, str(Path(__file__).parent))

import documents
import mutations
from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings
from hypothesis import strategies as st
from targets import TARGETS, fault


class Found(Exception):
    """A fault; hypothesis looks for a smaller file that has one too."""


def contents(kind: str) -> st.SearchStrategy[bytes]:
    """Return a strategy for files of a kind."""
    good = TARGETS[kind].good()
    texts = [documents.toml(tables).encode() for tables in good]
    tables = mutations.mutated(good).map(lambda content: documents.toml(content).encode())
    return st.one_of(tables, tables, tables, mutations.damaged(texts))


def attempt(kind: str, data: bytes, folder: Path) -> str:
    """Give a command such a file; return what is wrong with how it answers, or nothing."""
    path = folder / f"{kind}.toml"
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
    @given(contents(kind))
    def search(data: bytes) -> None:
        tried[kind] += 1
        text = attempt(kind, data, folder)
        if text:
            last[:] = [text, data]
            raise Found(text)

    with contextlib.suppress(Found):
        search()
    return tried[kind], str(last[0]), bytes(last[1])


def log(folder: Path) -> None:
    """Write a short good log, for commands that want one beside the file in question."""
    rows = [(0.001 * k, (k * 7919 % 13) / 6 - 1, k % 50 / 50) for k in range(400)]
    lines = ["t,u,phi", *(",".join(map(str, row)) for row in rows)]
    (folder / "log.csv").write_text("\n".join(lines))


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
        log(Path(name))
        while time.monotonic() < end:
            for kind in kinds:
                number = random.SystemRandom().getrandbits(64)
                count, text, data = batch(kind, number, args.examples, Path(name))
                tried[kind] += count
                if text:
                    faults += 1
                    args.found.mkdir(parents=True, exist_ok=True)
                    path = args.found / f"{kind}-{number:x}.toml"
                    path.write_bytes(data)
                    print(f"{path}: {text}\n{data[-300:].decode(errors='replace')}\n", flush=True)
            print(f"{sum(tried.values())} files, {faults} faults: {dict(tried)}", flush=True)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
