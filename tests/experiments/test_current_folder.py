"""The current folder may be one of somebody else's data: no module is looked for there."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from flexaxis.experiments.cli import main
from flexaxis.experiments.running.dispatch import spread
from flexaxis.experiments.speed.memory import memory
from flexaxis.sim.current_folder import SAFE_PATH, safe_path

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
def test_nor_does_the_one_in_which_memory_is_measured(trap):
    (found,) = memory(0.25, ["frozen"])
    assert found["estimator"] == "frozen" and not trap.exists()


def test_nor_does_what_a_library_of_the_engine_starts(trap, tmp_path):
    """MuJoCo imports glfw, which asks a Python for a version; in a process that has not yet."""
    words = ["simulate", "fm_step-v1", "-o", str(tmp_path / "rec.nc")]
    command = [sys.executable, "-P", "-m", "flexaxis.experiments.cli", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not trap.exists()


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


def test_every_python_that_we_start_leaves_it_out():
    """Isolated or with a safe path; `multiprocessing` takes the variable, as above."""
    ours = Path(main.__code__.co_filename).parent
    for path in ours.rglob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines():
            if "[sys.executable," in line:
                assert '[sys.executable, "-P",' in line or '[sys.executable, "-I",' in line, path
