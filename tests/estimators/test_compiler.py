"""Compiled code is kept in the user's cache folder, is never stale, and goes wrong nowhere."""

import json
import math
import os
import pickle
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.models import compiler
from flexaxis.estimators.models.compiler import compiled, inlined, remembered

PROGRAM = """
import json, sys
import numpy as np
from flexaxis.estimators import Rpem, three_mass
nominal = json.loads(sys.argv[1])
filter_ = Rpem(three_mass(nominal), identify=("f_m",), P0=[1e-5], period=0.005)
print(filter_.run(np.ones(50), np.ones(50))[-1].tolist())
"""


def start(nominal, cache, code=PROGRAM, **more):
    environment = {k: v for k, v in os.environ.items() if "NUMBA" not in k}
    environment |= {"XDG_CACHE_HOME": str(cache), "LOCALAPPDATA": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-c", code, json.dumps(dict(nominal))],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **more,
    )


@pytest.mark.slow
def test_parallel_first_calls_and_a_folder_that_cannot_be(nominal, tmp_path):
    cache, nowhere = tmp_path / "cache", tmp_path / "file"
    nowhere.touch()
    package = Path(compiler.__file__).parents[1]
    before = set(package.rglob("*.nb?"))
    first = [start(nominal, folder) for folder in (cache, cache, nowhere)]
    outputs = [process.communicate(timeout=120) for process in first]
    assert [process.returncode for process in first] == [0, 0, 0], outputs
    told = [
        re.search("compiling .* for 5 states and 1 param", stderr) is not None
        for _, stderr in outputs
    ]
    assert sum(told[:2]) == 1  # the other one waits for it
    assert told[2]
    assert "no cache folder can be written" in outputs[2][1]
    later = start(nominal, cache)
    stdout, stderr = later.communicate(timeout=120)
    assert stderr == ""  # nothing left to compile
    assert {stdout for stdout, _ in outputs} == {stdout}
    assert set(package.rglob("*.nb?")) == before  # the package may be read-only
    assert list(cache.rglob("*.nbc"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache folder that is empty."""
    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    return tmp_path


def doubled():
    """Return a function that has not been called."""

    def double(x):
        return 2.0 * x

    return compiled(double)


def machine_code(made):
    """Return the files in which numba keeps it."""
    place = Path(made.dispatcher.stats.cache_path)
    return place.glob(f"*{made.rendered.name}*.nb?")


def forgotten(folder):
    """Let this process know of no module in a folder, as another does not."""
    for path in folder.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_what_is_to_be_compiled_is_gathered_until_somebody_has(folder):
    made = doubled()
    with compiler.gathers() as names:
        made.prepare(lambda: pytest.fail("called"))
    assert names == {made.rendered.name}
    made.prepare(lambda: made(2.0))
    calls = []
    for known in (made, doubled()):  # in this process, and by its file
        with compiler.gathers() as names:
            known.prepare(lambda: calls.append(1))
        assert not names
    assert len(calls) == 2


def test_a_broken_cache_stops_nobody(folder, capsys):
    made = doubled()
    assert made(3.0) == 6.0
    assert "compiling" in capsys.readouterr().err
    for broken in (*machine_code(made), *folder.glob("*.py")):
        broken.write_bytes(b"torn")
        forgotten(folder)
        assert doubled()(3.0) == 6.0
    capsys.readouterr()
    forgotten(folder)
    assert doubled()(3.0) == 6.0
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")
def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    found = compiler.cache_folder.__wrapped__
    assert found() == tmp_path
    monkeypatch.setattr(os, "getuid", lambda: 4711)
    if tmp_path.stat().st_uid != 0:
        assert found() is None


def test_a_full_disk_stops_nobody_and_leaves_nothing(folder, monkeypatch, capsys):
    def full(self, *_, **__):
        self.open("wb").close()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    assert doubled()(3.0) == 6.0
    assert not list(folder.iterdir())
    assert "no cache folder can be written" in capsys.readouterr().err


HOLDS = """
import fcntl, sys, time
claim = open(sys.argv[1], "ab")
fcntl.flock(claim, fcntl.LOCK_EX)
print("held", flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files are not locked there")
def test_a_stopped_process_holds_up_nobody_for_ever(folder, monkeypatch, capsys):
    made = doubled()
    monkeypatch.setattr(compiler, "TOLD", 0.05)
    monkeypatch.setattr(compiler, "PATIENCE", 0.2)
    assert made.dispatcher.py_func(3.0) == 6.0
    (path,) = folder.glob("*.py")
    command = [sys.executable, "-c", HOLDS, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout.readline() == "held\n"
            began = time.monotonic()
            assert made(3.0) == 6.0
            assert time.monotonic() - began > compiler.PATIENCE
        finally:
            holder.kill()
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2  # once each
    assert "waiting for another process to compile" in told[0]
    assert "compiling" in told[1]
    assert list(machine_code(made))  # kept for others all the same


FACTOR = 2.0
ENDLESS = -np.inf
TABLE = np.array([[1.0, 2.0], [3.0, 4.0]])


@inlined
def inner(x: float) -> float:
    """Return twice as much."""
    return FACTOR * x


def test_what_is_written_is_what_was_marked():
    places = (1, 0)

    @compiled
    def outer(x, FACTOR):
        y = inner(x) + TABLE[places] + math.floor(FACTOR)
        return max(y, ENDLESS)

    assert outer(1.0, 7.5) == 2.0 + 3.0 + 7.0
    assert inner(1.0) == 2.0


real = 7.0


def test_a_name_of_its_own_is_no_constant_of_the_module():
    """Python tells of a module's names that a function has as an attribute as well."""

    @compiled
    def own(x):
        real = 2.0
        return x.real * real

    assert own(3.0) == 6.0


def plugged(plug, number):
    @compiled
    def run(x):
        return plug(x) + number

    return run


def test_every_function_has_a_name_of_its_own():
    def changed(x):
        return FACTOR + x

    def same(x):  # a comment changes nothing
        return FACTOR * x

    same.__name__ = "inner"
    plain = plugged(inner, 1.0).rendered.name
    assert plugged(inner, 1.0).rendered.name == plain
    assert plugged(inner, 2.0).rendered.name != plain  # a constant
    assert plugged(inlined(changed), 1.0).rendered.name != plain  # what it calls
    one, other = plugged(inner, 1.0), plugged(inlined(changed), 1.0)
    assert (one(3.0), other(3.0)) == (7.0, 6.0)


@remembered
def remembered_loop(number):
    return plugged(inner, number)


def test_what_was_made_by_a_factory_is_made_anew_elsewhere():
    made = remembered_loop(4.0)
    assert pickle.loads(pickle.dumps(made)) is made
    assert pickle.loads(pickle.dumps(inner)) is inner


EDITED = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
import flexaxis.estimators as e
nominal = __import__("json").loads(sys.argv[2])
from flexaxis.estimators import Rpem, three_mass
assert e.__file__.startswith(sys.argv[1]), e.__file__
made = Rpem(three_mass(nominal), identify=("f_m",), P0=[1e-5], period=0.005)
print(made.run(np.ones(50), np.ones(50))[-1, 0])
"""


@pytest.mark.slow  # it compiles twice, whatever is kept
def test_an_edit_of_what_a_loop_calls_is_not_hidden(nominal, tmp_path):
    """Also where the file of the loop itself stays as it is, to the second and the byte."""
    home = tmp_path / "flexaxis"
    shutil.copytree(
        Path(compiler.__file__).parents[1],
        home / "estimators",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    (home / "__init__.py").touch()  # else one that is installed goes before it

    def run():
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"
        arguments = [sys.executable, "-S", "-c", EDITED, str(tmp_path), json.dumps(dict(nominal))]
        found = [p for p in sys.path if p.endswith("site-packages")]
        environment["PYTHONPATH"] = os.pathsep.join(found)
        done = subprocess.run(
            arguments, env=environment, capture_output=True, text=True, check=False, timeout=120
        )
        assert done.returncode == 0, done.stderr
        return float(done.stdout), done.stderr

    first, words = run()
    assert "compiling" in words
    assert run() == (first, "")
    file = home / "estimators" / "filters" / "prediction_error.py"
    text = file.read_text(encoding="utf-8")
    before = file.stat()
    edited = text.replace("theta[i] += gain[i] * (surprise", "theta[i] -= gain[i] * (surprise")
    assert edited != text
    file.write_text(edited, encoding="utf-8")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    second, words = run()
    assert second != first and "compiling" in words


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_the_folder_is_the_user_s(monkeypatch, platform):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    assert compiler.user_cache().is_relative_to(Path.home())
