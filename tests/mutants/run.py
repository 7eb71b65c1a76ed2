"""
Plant errors one at a time, each in a copy with cold caches, and see whether a test dies of it.

A copy lies in an environment of its own, since what a sandbox runs sees no PYTHONPATH. Compiled
code is shared, since it is named after its content, but for errors in what names it so; it begins
with nothing in each run.

``python tests/mutants/run.py [NAME …] [--jobs N]`` runs those of all tables beside this file, or
those whose names contain one of the words; a table is a list of

    [[mutant]]
    name = "what is wrong"
    file = "estimators/…"
    old = "text that stands in that file once"
    new = "what is planted there"
    killer = "tests/…, as pytest takes it; of the fast tier, but for one in ten at most"

Status 1 where one survives. A killer must pass where nothing is planted, and that is tried first.
"""

import argparse
import ast
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from venv import EnvBuilder

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
FOLDERS = ("models_mjcf", "sim", "estimators", "experiments")
FRONT = "experiments/front"  # is what `import flexaxis` gives
NAMING = ("estimators/models/compiler.py", "estimators/models/source.py")  # what is compiled
NO_VERDICT = "NO VERDICT OF"  # no end, or an error beside the test: not counted
LONGEST = 600  # s, for one killer with everything to compile


@dataclass(frozen=True)
class Mutant:
    """A planted error, and the test that is to see it."""

    name: str
    file: str
    old: str
    new: str
    killer: str

    def problem(self) -> str | None:
        """Say why it cannot be planted, if so."""
        path = ROOT / self.file
        if not path.is_file():
            return f"there is no {self.file}"
        if (count := path.read_text(encoding="utf-8").count(self.old)) != 1:
            return f"{self.file} has {count} times, and not once: {self.old!r}"
        file, _, name = self.killer.partition("::")
        if not (ROOT / file).is_file():
            return f"there is no {self.killer}"
        if name and marks_of(self.killer) is None:
            return f"there is no test {name} in {file}"
        return None


def is_slow(killer: str) -> bool:
    """Whether a test is of the slow tier as a whole, not with some parameters alone."""
    return "pytest.mark.slow" in (marks_of(killer) or ())


def marks_of(killer: str) -> list[str] | None:
    """The decorators of a test, whatever its parameters; None where there is none of that name."""
    path, _, name = killer.partition("::")
    return _marks(path).get(name.partition("[")[0].rpartition("::")[2])


@cache
def _marks(path: str) -> dict[str, list[str]]:
    tree = ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
    found = (each for each in tree if isinstance(each, ast.FunctionDef))
    return {each.name: [ast.unparse(mark) for mark in each.decorator_list] for each in found}


def mutants() -> list[Mutant]:
    """All of the tables beside this file."""
    tables = [tomllib.loads(p.read_text(encoding="utf-8")) for p in sorted(HERE.glob("*.toml"))]
    return [Mutant(**entry) for table in tables for entry in table["mutant"]]


def dies(killers: Sequence[str], compiled: Path, mutant: Mutant | None = None) -> str | None:
    """Run tests of one tier on a copy, with or without an error in it; return what failed first."""
    failed = failures(killers, compiled, mutant)
    return failed[0] if failed else None


def failures(
    killers: Sequence[str], compiled: Path, mutant: Mutant | None = None, jobs: int = 0
) -> list[str]:
    """Run tests of one tier on a copy; return what failed, with an error in it only the first.

    An error in what names compiled code compiles for itself; else code from `compiled` does.
    """
    with tempfile.TemporaryDirectory(prefix="mutant") as folder:
        place = Path(folder)
        python, home = installed(place)
        if mutant is not None:
            path = home / mutant.file
            text = path.read_text(encoding="utf-8")
            path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        if mutant is not None and mutant.file in NAMING:
            compiled = place / "numba"
        shutil.copytree(home / FRONT, home, dirs_exist_ok=True)
        words = [str(python), "-m", "pytest", "-q", "-p", "no:cacheprovider", *killers]
        words += ["-m", "slow"] * any(map(is_slow, killers)) + ["-x"] * (mutant is not None)
        words += ["-n", str(jobs), "--dist=loadfile"]
        try:
            done = subprocess.run(
                words, cwd=ROOT, env=environment(place, home, compiled), capture_output=True,
                text=True, check=False, timeout=LONGEST * len(killers),
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return [f"{NO_VERDICT} {killers[0]} in {LONGEST} s"]
        finally:
            shutil.rmtree(f"{compiled}/pycache{place.resolve()}", ignore_errors=True)
    _, _, summary = done.stdout.rpartition("short test summary info")  # a log says ERROR, too
    lines = [line for line in summary.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if done.returncode and not lines:
        raise SystemExit(f"{mutant and mutant.name}: no test failed, but\n{done.stdout[-2000:]}")
    if mutant is not None and lines and lines[0].startswith("ERROR"):
        return [f"{NO_VERDICT} {killers[0]}, but an error beside it"]
    return [line.partition(" ")[2].partition(" - ")[0] for line in lines]


def fails(killers: Sequence[str], compiled: Path, jobs: int) -> set[str]:
    """Return which tests fail where nothing is planted, beside others and then alone.

    Alone once more, for what ends by the clock may do so on a busy machine.
    """
    failed: list[str] = []
    for slow in (False, True):
        if tier := [killer for killer in killers if is_slow(killer) == slow]:
            failed += failures(tier, compiled, jobs=jobs)
    tried = {k for k in killers if any(f == k or f.startswith((f"{k}[", f"{k}::")) for f in failed)}
    return {killer for killer in tried if dies([killer], compiled)}


def timed(mutant: Mutant, compiled: Path) -> tuple[str | None, float]:
    """Plant an error; return what died of it, and how long that took [s]."""
    began = time.monotonic()
    killer = dies([mutant.killer], compiled, mutant)
    if killer and killer.startswith(NO_VERDICT):  # once more: a port may have been taken meanwhile
        killer = dies([mutant.killer], compiled, mutant)
    return killer, time.monotonic() - began


def installed(place: Path) -> tuple[Path, Path]:
    """Copy the code into an environment in a folder; return its Python, and where `flexaxis` lies.

    It sees all packages of ours, but not the hook that makes `flexaxis` be this repository.
    """
    scheme = {name: str(place) for name in ("base", "platbase", "installed_base")}
    packages = Path(sysconfig.get_path("purelib", "venv", scheme))
    binaries = Path(sysconfig.get_path("scripts", "venv", scheme))
    EnvBuilder(symlinks=os.name != "nt").create(place)
    (packages / "others.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    for command in Path(sys.executable).parent.iterdir():  # flexaxis, and what tests call beside it
        if not (binaries / command.name).exists():
            shutil.copy2(command, binaries)
    for name in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, packages / "flexaxis" / name, ignore=ignored)
    return binaries / Path(sys.executable).name, packages / "flexaxis"


def environment(place: Path, home: Path, compiled: Path) -> dict[str, str]:
    """The environment in which `flexaxis` is the copy; what is compiled is kept in a folder."""
    own = {
        "PYTHONPATH": str(home.parent),
        "PYTHONPYCACHEPREFIX": str(compiled / "pycache"),  # by path: no copy has that of another
        "NUMBA_CACHE_DIR": str(compiled),
        "XDG_CACHE_HOME": str(place / "home"),
        "FLEXAXIS_CACHE": str(place / "records"),
    }
    return os.environ | own | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def main(arguments: Sequence[str]) -> int:
    """Run what is asked for, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("names", nargs="*", help="words that the names contain")
    parser.add_argument("--jobs", type=int, default=1, help="copies at a time (1)")
    given = parser.parse_args(arguments)
    chosen = [m for m in mutants() if not given.names or any(w in m.name for w in given.names)]
    if wrong := [f"{m.name}: {m.problem()}" for m in chosen if m.problem()]:
        sys.exit("\n".join(["these fit no more:", *wrong]))
    dead = 0
    with (
        tempfile.TemporaryDirectory(prefix="compiled") as folder,
        ThreadPoolExecutor(given.jobs) as pool,
    ):
        compiled = Path(folder)
        killers = list(dict.fromkeys(m.killer for m in chosen))
        print(f"{len(killers)} tests, on which nothing is planted …", flush=True)
        broken = fails(killers, compiled, given.jobs)
        for killer in sorted(broken):
            print(f"{killer} FAILS where nothing is planted", flush=True)
        chosen = [m for m in chosen if m.killer not in broken]
        ends = pool.map(lambda mutant: timed(mutant, compiled), chosen)
        for mutant, (killer, seconds) in zip(chosen, ends, strict=True):
            dead += killer is not None and not killer.startswith(NO_VERDICT)
            print(f"{mutant.name:60} {seconds:5.1f} s  {killer or 'SURVIVES'}", flush=True)
    print(f"{dead} of {len(chosen)}")
    return int(dead < len(chosen) or bool(broken))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
