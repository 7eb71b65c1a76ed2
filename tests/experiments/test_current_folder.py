"""The current folder may be one of somebody else's data: no module is looked for there."""

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from flexaxis.experiments.building.processes import spread
from flexaxis.experiments.cli import main
from flexaxis.sim.storage.current_folder import SAFE_PATH, safe_path

sys.path.insert(0, str(Path(__file__).parents[1]))
from test_architecture import FILES, ROOT, imported

# What a new Python imports of its own and of ours, before and after it is told where to look.
NAMES = {*sys.stdlib_module_names} - {"__future__", "this", "antigravity"}
NAMES |= {"flexaxis", "h5py", "mujoco", "numba", "numpy", "scipy"}
TRAP = "open({mark!r}, 'a').write(__name__ + ' ')\nraise SystemExit('trapped')\n"


@pytest.fixture
def trap(tmp_path, monkeypatch):
    """Stand in a folder of traps; give the file that is there once one of them was run."""
    folder, mark = tmp_path / "download", tmp_path / "mark"
    folder.mkdir()
    for name in NAMES:
        (folder / f"{name}.py").write_text(TRAP.format(mark=str(mark)))
    monkeypatch.chdir(folder)
    assert str(folder) not in sys.path and "" not in sys.path
    return mark


def test_workers_do_not_look_there(trap):
    assert sorted(spread([-1, -2], abs, jobs=2)) == [1, 2]
    assert not trap.exists()


def hdf5(path, signals):
    with h5py.File(path, "w") as file:
        for name, values in signals.items():
            file[name] = values


@pytest.mark.parametrize(("name", "write"), [("log.mat", savemat), ("log.h5", hdf5)])
def test_nor_does_the_one_that_reads_a_log(name, write, trap, tmp_path, capsys):
    t = np.arange(4000) / 200
    signals = {"time": t, "torque": np.sin(9 * t), "speed": np.cos(9 * t)}
    write(tmp_path / name, signals)
    words = ["--torque", "torque", "--speed", "speed", "-o", str(tmp_path / "rec.nc")]
    status = main(["import", str(tmp_path / name), *words])
    assert status == 0, capsys.readouterr().err
    assert not trap.exists() and (tmp_path / "rec.nc").exists()


@pytest.mark.slow
def test_nor_does_what_a_library_of_the_engine_starts(trap, tmp_path):
    """MuJoCo imports glfw, which asks a Python for a version; in a process that has not yet."""
    words = ["simulate", "fm_step-v1", "-o", str(tmp_path / "rec.nc")]
    command = [sys.executable, "-P", "-m", "flexaxis.experiments.cli", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not trap.exists()


STYLE = "import sys; from flexaxis.experiments.cli import main; main(['list', 'suites']); "
STYLE += "import os, matplotlib; print(matplotlib.rcParams['text.usetex'], os.getcwd())"


def test_nor_is_the_style_of_its_pictures_from_there(tmp_path):
    """A matplotlibrc can have LaTeX set the texts of a figure, which reads and writes files."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    line = [sys.executable, "-P", "-c", STYLE]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == f"False {tmp_path}"


def test_a_style_that_the_user_has_chosen_is_hers(tmp_path):
    (tmp_path / "matplotlibrc").write_text("font.size: 7\n")
    (tmp_path / "mine").write_text("text.usetex: True\n")
    line = [sys.executable, "-P", "-c", STYLE]
    chosen = {**os.environ, "MATPLOTLIBRC": "mine"}
    done = subprocess.run(
        line, cwd=tmp_path, env=chosen, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == f"True {tmp_path}"


@pytest.mark.parametrize("given", [None, "1"])
def test_programs_of_a_user_find_their_neighbours(monkeypatch, given):
    """A program inherits the variables of a worker, and its modules lie beside it."""
    if given:
        monkeypatch.setenv(SAFE_PATH, given)
    else:
        monkeypatch.delenv(SAFE_PATH, raising=False)
    assert list(spread([SAFE_PATH], os.getenv, jobs=2)) == [given]
    with safe_path():
        assert os.environ[SAFE_PATH]
    assert os.environ.get(SAFE_PATH) == given


@pytest.mark.parametrize("given", [None, "1"])
def test_threads_that_overlap_leave_nothing_set(monkeypatch, given):
    """The first one in leaves first: the variable stays for the other, and goes with it."""
    if given:
        monkeypatch.setenv(SAFE_PATH, given)
    else:
        monkeypatch.delenv(SAFE_PATH, raising=False)
    inside, left, seen = threading.Event(), threading.Event(), []

    def other():
        with safe_path():
            inside.set()
            assert left.wait(60)
            seen.append(os.environ.get(SAFE_PATH))

    thread = threading.Thread(target=other)
    with safe_path():
        thread.start()
        assert inside.wait(60)
    left.set()
    thread.join(60)
    assert seen == [given or "flexaxis"]
    assert os.environ.get(SAFE_PATH) == given


STARTERS = {
    "experiments/board/protocol.py": "starts none: a pipe to the process of a case",
    "experiments/board/sandbox.py": "the process of a case isolated, -I",
    "experiments/building/guest.py": "starts none: asks whether it might",
    "experiments/building/pipe.py": "programs of a user, with their own variables",
    "experiments/logs/reading/mat_file.py": "reads MAT files, -P",
    "experiments/building/processes.py": "workers, in safe_path",
    "experiments/building/worker.py": "starts none: is one",
    "sim/storage/hdf5_apart.py": "reads HDF5 files, -P",
}
"""Modules that start processes, and how those leave the current folder out."""
START = {"subprocess", "multiprocessing", "concurrent.futures.ProcessPoolExecutor", "pty"}
START |= {"concurrent.futures.process", "asyncio.subprocess"}
CALLS = re.compile(
    r"\bos\.(fork|forkpty|system|popen|startfile|(posix_)?spawn\w*|exec[lv]\w*)\("
    r"|\b(create_subprocess_\w+|subprocess_exec|subprocess_shell|ProcessPoolExecutor)\("
)


def starts(path):
    """Whether a module can start processes, by what it imports and calls."""
    names = [
        *imported(path),
        *(n.partition(".")[0] for n in imported(path)),
        *(n.rpartition(".")[0] for n in imported(path)),
    ]
    return not START.isdisjoint(names) or bool(CALLS.search(path.read_text(encoding="utf-8")))


def test_whoever_starts_processes_has_thought_of_it():
    """A new module that does is to be added to `STARTERS`, with how it leaves the folder out."""
    found = {f.relative_to(ROOT).as_posix() for f in FILES if starts(f)}
    assert found == STARTERS.keys()


@pytest.mark.parametrize(
    "text",
    [
        "import subprocess",
        "def f():\n    from subprocess import run",
        "from multiprocessing.pool import Pool",
        "from concurrent.futures import ProcessPoolExecutor",
        "import concurrent.futures as c\nc.ProcessPoolExecutor(1)",
        "import os\nos.execvp('a', [])",
    ],
)
def test_a_new_one_is_seen(tmp_path, text):
    path = tmp_path / "new.py"
    path.write_text(f"{text}\n")
    assert starts(path)
    path.write_text("from concurrent.futures import ThreadPoolExecutor\nimport os\n")
    assert not starts(path)


def test_every_python_that_we_start_leaves_it_out():
    """Isolated or with a safe path; `multiprocessing` takes the variable, as above."""
    for path in FILES:
        for line in path.read_text(encoding="utf-8").splitlines():
            if "[sys.executable," in line:
                assert '[sys.executable, "-P",' in line or '[sys.executable, "-I",' in line, path
