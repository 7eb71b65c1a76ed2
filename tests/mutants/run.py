"""
Plant errors one at a time, and see whether the test named beside each fails.

``python tests/mutants/run.py [FILE.toml …] [--only WORDS]``; without files, all of this folder.
Works on the checkout that it lies in, puts every file back, and ends with 1 if an error survived.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def main() -> int:
    """Run all mutants asked for; print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--only", default="", help="words that the name has to contain")
    options = parser.parse_args()
    files = options.files or sorted(HERE.glob("*.toml"))
    mutants = [m for file in files for m in tomllib.loads(file.read_text())["mutant"]]
    chosen = [m for m in mutants if options.only in m["name"]]
    survivors = [mutant["name"] for mutant in chosen if not killed(mutant)]
    print(f"{len(chosen) - len(survivors)} of {len(chosen)} killed")
    return 1 if survivors else 0


def killed(mutant: dict[str, str]) -> bool:
    """Plant one error, with nothing compiled before, and say whether its test fails."""
    path = ROOT / mutant["file"]
    right = path.read_text()
    if right.count(mutant["old"]) != 1:
        print(
            f"NOT PLANTED  {mutant['name']}: the text is there {right.count(mutant['old'])} times"
        )
        return False
    try:
        path.write_text(right.replace(mutant["old"], mutant["new"]))
        outcome = failing(mutant["killer"])
    finally:
        path.write_text(right)
        forget()
    word = {0: "SURVIVED", 1: "killed"}.get(outcome, f"ERROR {outcome}")
    print(f"{word:12} {mutant['name']}", flush=True)
    return outcome == 1


def failing(test: str) -> int:
    """Return pytest's exit status for one test, from cold caches."""
    forget()
    with tempfile.TemporaryDirectory() as cold:
        environment = os.environ | {"NUMBA_CACHE_DIR": cold, "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", test]
        return subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, check=False
        ).returncode


def forget() -> None:
    """Remove what Python has compiled of the estimators."""
    for folder in (ROOT / "estimators").rglob("__pycache__"):
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
