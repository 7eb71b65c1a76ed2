"""Let every command that writes run on a disk that is full, and look at what it says and leaves.

    sudo python tests/experiments/full_disks.py [COMMAND …] [--sizes 1,4,16]

The disk is a tmpfs of so many MB, for which one has to be root on Linux; results go there, the
cache lies elsewhere. A command may do it all, or end with status 2 or 70 and a line that says that
the disk is full; nothing half written may lie under a final name, and no leftover beside it.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py

Words = Sequence[str]
FEW = ("--seeds", "3", "--jobs", "1")
FREE = ("--model", "three_mass", "--free", "f_m", "--friction", "none")
LEFTOVERS = (".part", ".tmp", "~")
FULL = "no space left"  # as every system says it

COMMANDS: dict[str, Words] = {
    "simulate": ("simulate", "fm_step-v1", "-o", "DISK/rec.nc"),
    "simulate --as-log csv": ("simulate", "fm_step-v1", "--as-log", "csv", "-o", "DISK/log.csv"),
    "estimate": ("estimate", "HERE/rec.nc", "--estimator", "rpem-forgetting", "-o", "DISK/e.nc"),
    "run": ("run", "fm_step-v1", "--estimator", "rpem-forgetting", *FEW, "-o", "DISK/run"),
    "study": ("study", "HERE/study.toml", "--jobs", "1", "-o", "DISK/study"),
    "report": ("report", "HERE/run", "-o", "DISK/report.html"),
    "export --csv": ("export", "HERE/run", "--csv", "DISK/rows.csv"),
    "export --parquet": ("export", "HERE/run", "--parquet", "DISK/rows.parquet"),
    "export --netcdf": ("export", "HERE/run", "--netcdf", "DISK/rows.nc"),
    "merge": ("merge", "HERE/shares/1", "HERE/shares/2", "-o", "DISK/merged"),
    "compare": (
        "compare", "--base", "rpem-forgetting", "--candidate", "rpem-forgetting[forgetting=0.99]",
        "fm_step-v1", "--seeds", "4", "--jobs", "1", "-o", "DISK/compare",
    ),
    "tradeoff": (
        "tradeoff", "fm_step-v1", "--estimator", "rpem-forgetting", *FEW, "-o", "DISK/tradeoff",
    ),
    "new": ("new", "DISK/mine.py"),
    "import": ("import", "HERE/log.csv", "--torque-is", "held", "-o", "DISK/imported.nc"),
    "identify": ("identify", "HERE/rec.nc", *FREE, "-o", "DISK/axis.toml"),
    "track": (
        "track", "HERE/rec.nc", "--model", "HERE/axis.toml", "--identify", "f_m", "-o", "DISK/t.nc",
    ),
    "days": ("days", "--days", "3", "-o", "DISK/days"),
    "demo --record": (
        "demo", "--record", "DISK/lesson.gif", "--script", "HERE/lesson.toml",
    ),
    "view": ("view", "HERE/rec.nc", "--at", "5", "-o", "DISK/axis.png"),
    "paper": ("paper", "--jobs", "2", "-o", "DISK/paper"),
}  # fmt: skip


@dataclass(frozen=True)
class Seen:
    """What a command did on a disk: status, its last line, and what is wrong with it."""

    status: int
    said: str
    faults: tuple[str, ...]


def flexaxis(words: Words) -> subprocess.CompletedProcess[str]:
    """Run a command as a user does."""
    call = [sys.executable, "-m", "flexaxis.experiments", *words]
    return subprocess.run(call, capture_output=True, text=True, check=False, timeout=600)


@contextlib.contextmanager
def disk(place: Path, megabytes: int) -> Iterator[Path]:
    """Mount a small disk."""
    place.mkdir(exist_ok=True)
    size = f"size={megabytes}m"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "none", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def prepared(here: Path) -> None:
    """Make what the commands read."""
    (here / "study.toml").write_text(
        'scenario = "fm_step-v1"\nestimators = ["rpem-forgetting"]\nseeds = 3\n'
        '[sweep]\n"fault[0].factor" = [1.1, 1.5]\n'
    )
    lesson = flexaxis(("demo", "--print-script")).stdout
    (here / "lesson.toml").write_text(lesson)
    run = ("run", "fm_step-v1", "--estimator", "rpem-forgetting", *FEW)
    for words in (
        ("simulate", "fm_step-v1", "-o", f"{here}/rec.nc"),
        ("simulate", "fm_step-v1", "--as-log", "csv", "-o", f"{here}/log.csv"),
        ("identify", f"{here}/rec.nc", *FREE, "-o", f"{here}/axis.toml"),
        (*run, "-o", f"{here}/run"),
        (*run, "-o", f"{here}/shares/1", "--shard", "1/2"),
        (*run, "-o", f"{here}/shares/2", "--shard", "2/2"),
    ):
        done = flexaxis(words)
        if done.returncode not in {0, 1}:
            raise SystemExit(f"{' '.join(words)}: {done.stderr}")


def tried(name: str, here: Path, megabytes: int) -> Seen:
    """Run a command on a disk of a size that has a little less room than that."""
    with disk(here / "disk", megabytes) as place:
        filled = place / "others"
        filled.write_bytes(b"\0" * int(megabytes * 1e6 * 0.95))  # somebody else's files
        words = [w.replace("DISK", str(place)).replace("HERE", str(here)) for w in COMMANDS[name]]
        done = flexaxis(words)
        filled.unlink()
        faults = [*_wrong_answer(done), *_wrong_files(place)]
    lines = done.stderr.strip().splitlines() or [""]
    return Seen(done.returncode, lines[-1], tuple(faults))


def _wrong_answer(done: subprocess.CompletedProcess[str]) -> Iterator[str]:
    if "Traceback" in done.stderr:
        yield "a traceback"
    if done.returncode not in {0, 1, 2, 70}:
        yield f"status {done.returncode}"
    if done.returncode in {2, 70} and FULL not in done.stderr.lower():
        yield f"does not say that the disk is full: {done.stderr[-200:]!r}"


def _wrong_files(place: Path) -> Iterator[str]:
    for path in sorted(path for path in place.rglob("*") if path.is_file()):
        if path.name.endswith(LEFTOVERS):
            yield f"left {path.relative_to(place)}"
        elif problem := _broken(path):
            yield f"{path.relative_to(place)}: {problem}"


def _broken(path: Path) -> str:
    """Return what is wrong with a file under a final name, or nothing."""
    if path.stat().st_size == 0 and path.suffix not in {".lock", ""}:
        return "empty"
    try:
        match path.suffix:
            case ".nc" | ".h5":
                h5py.File(path).close()
            case ".json":
                json.loads(path.read_text("utf-8"))
            case ".html":
                if "</html>" not in path.read_text("utf-8"):
                    return "torn"
    except (OSError, ValueError) as error:
        return str(error)
    return ""


def main() -> int:
    """Print the table; status 1 where something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=", ".join(COMMANDS))
    parser.add_argument("--sizes", default="1,4,16", help="MB")
    args = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        prepared(here)
        for name in args.commands or COMMANDS:
            for megabytes in map(int, args.sizes.split(",")):
                seen = tried(name, here, megabytes)
                wrong += len(seen.faults)
                said = "; ".join(seen.faults) or seen.said[:100]
                print(f"{name:<22} {megabytes:>3} MB  {seen.status}  {said}", flush=True)
    print(f"{wrong} faults")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
