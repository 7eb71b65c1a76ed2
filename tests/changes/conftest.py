"""Apply the patches in this folder to a copy of the package, and run `flexaxis` from the copy.

The patches are unified diffs (`git diff -U2`), as a contributor would make them. Line numbers are
ignored: the old lines of each hunk must occur exactly once in the file.
"""

import json
import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
FOLDERS = {"models_mjcf", "sim", "estimators", "experiments"}
CHANGES = sorted(path.stem for path in HERE.glob("*.patch"))


@pytest.fixture(autouse=True, scope="session")
def flexaxis_of_this_folder():
    """Skip the tests if another installation is imported, such as a wheel without the patches."""
    import flexaxis

    if not Path(flexaxis.__file__).resolve().is_relative_to(ROOT):
        pytest.skip(f"flexaxis is imported from {Path(flexaxis.__file__).parent}, not from here")


# One process runs all commands of a copy, because starting takes longer than most commands.
SERVED = """
import contextlib, io, json, sys
from flexaxis.experiments.cli import main
for line in sys.stdin:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(json.loads(line))
        except SystemExit as stop:  # --help
            status = stop.code
    print(json.dumps([status, out.getvalue(), err.getvalue()]), flush=True)
"""


@dataclass
class Hunk:
    """Old lines of a file and the new lines that replace them; a new file has no old lines."""

    change: str
    path: str
    old: list[str] = field(default_factory=list)
    new: list[str] = field(default_factory=list)


def read_patch(name):
    """Return the hunks of a patch."""
    found, path = [], None
    for line in (HERE / f"{name}.patch").read_text(encoding="utf-8").splitlines():
        if line.startswith("+++ "):
            path = line.removeprefix("+++ b/")
        elif line.startswith("@@"):
            found.append(Hunk(name, path))
        elif not line.startswith("--- "):
            found[-1].old += [line[1:]] * (line[:1] != "+")
            found[-1].new += [line[1:]] * (line[:1] != "-")
    return found


def apply(hunk, home):
    """Apply a hunk to its file in the folder `home`."""
    path = home / hunk.path
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    places = [k for k in range(len(lines) + 1) if lines[k : k + len(hunk.old)] == hunk.old]
    shown = "\n".join(hunk.old)
    assert len(places) == 1, (
        f"{hunk.change}.patch no longer fits: these lines occur {len(places)} times, not once, in "
        f"{hunk.path}:\n{shown}"
    )
    lines[places[0] : places[0] + len(hunk.old)] = hunk.new
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def patched(place, hunks):
    """Copy the folders that the hunks touch to `place`, and apply the hunks."""
    package, skipped = place / "flexaxis", shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "experiments" / "front", package, ignore=skipped)  # `import flexaxis`
    # Folders that are not copied are imported from the installation, with their compiled code.
    for folder in FOLDERS & {Path(hunk.path).parts[0] for hunk in hunks}:
        shutil.copytree(ROOT / folder, package / folder, ignore=skipped)
    for hunk in hunks:
        apply(hunk, package)


def environment(place):
    """Return the environment variables with which Python imports the copy in `place`."""
    own = {"PYTHONPATH": str(place), "FLEXAXIS_CACHE": str(place / "cache"), "COLUMNS": "200"}
    return os.environ | own | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass
class Flexaxis:
    """The command line of a copy, which runs in the folder `place`."""

    place: Path
    process: subprocess.Popen

    def __call__(self, *words, status=0):
        """Run a command, check its exit status, and return what it printed."""
        self.process.stdin.write(json.dumps([str(word) for word in words]) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, (self.place / "stderr").read_text(encoding="utf-8")
        found, out, err = json.loads(line)
        assert found == status, f"flexaxis {' '.join(map(str, words))}: {err}"
        return out


@contextmanager
def serving(place, names):
    """Yield the command line of a copy with some changes."""
    patched(place, [hunk for name in names for hunk in read_patch(name)])
    with (
        (place / "stderr").open("w") as errors,
        subprocess.Popen(
            [sys.executable, "-c", SERVED], cwd=place, env=environment(place), text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors,
        ) as process,
    ):  # fmt: skip
        yield Flexaxis(place, process)
        process.stdin.close()


@pytest.fixture(scope="session")
def together(tmp_path_factory):
    """A copy with all changes except the law, which would recompile all loops with friction."""
    names = [name for name in CHANGES if name != "law"]
    with serving(tmp_path_factory.mktemp("together"), names) as flexaxis:
        yield flexaxis


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.slow) for name in ("together", "alone")]
)
def flexaxis(request, tmp_path):
    """The command line with all changes, and with only the change named by the test."""
    name = request.node.originalname.removeprefix("test_")
    if request.param == "together" and name != "law":
        yield request.getfixturevalue("together")
    else:
        with serving(tmp_path, CHANGES if request.param == "together" else [name]) as own:
            yield own
