"""Compiled code is kept in the user's cache folder, is never stale, and goes wrong nowhere."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from inspect import getsourcefile
from pathlib import Path

import numpy as np
import pytest
from numba import float64
from numba.core import bytecode

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.methods.rpem import rpem_loop
from flexaxis.estimators.recursion.beside import measure
from flexaxis.estimators.recursion.beside_loop import beside_loop
from flexaxis.estimators.sampling import compiler, kept, symbols
from flexaxis.estimators.sampling.beside import entries
from flexaxis.estimators.sampling.compiler import Compiled, compiled, inlined
from flexaxis.estimators.sampling.fields import Fields
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.runs import Runs

FORKS = hasattr(os, "fork")
PROGRAM = """
import json, sys
import numpy as np
from flexaxis.estimators import Rpem, three_mass
nominal = json.loads(sys.argv[1])
filter_ = Rpem(three_mass(nominal), identify=("f_m",), P0=[1e-5], period=0.005)
print(filter_.run(np.ones(50), np.ones(50))[-1].tolist())
"""


def start(nominal, cache, code=PROGRAM, **more):
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
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


def test_a_broken_cache_stops_nobody(nominal, tmp_path, monkeypatch, capsys):
    def first_call() -> list[float]:
        rpem_loop.cache_clear()
        made = Rpem(three_mass(nominal), identify=("f_g",), P0=[1.0], period=0.005)
        return made.run([1.0, 0.0], [1.0, 2.0])[-1].tolist()

    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    expected = first_call()
    assert "compiling" in capsys.readouterr().err
    (file,) = tmp_path.iterdir()
    file.write_bytes(b"torn")
    assert first_call() == expected
    assert "compiling" in capsys.readouterr().err
    assert first_call() == expected
    assert capsys.readouterr().err == ""
    rpem_loop.cache_clear()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")
def test_code_of_another_user_is_not_run(nominal, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    for owner, told in ((os.getuid(), True), (os.getuid(), False), (4711, True)):
        if owner == 4711:
            stat = Path.stat

            def owned(self, stat=stat, **options):
                values = list(stat(self, **options))
                values[4] = 4711 if self.suffix == ".nbc" else values[4]
                return os.stat_result(values)

            monkeypatch.setattr(Path, "stat", owned)
        rpem_loop.cache_clear()
        Rpem(three_mass(nominal), identify=("d_g",), P0=[1.0], period=0.005).run([1.0], [1.0])
        assert ("compiling" in capsys.readouterr().err) is told
    rpem_loop.cache_clear()


def test_a_full_disk_stops_nobody_and_leaves_nothing(nominal, tmp_path, monkeypatch):
    def full(self, content):
        self.open("wb").close()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(Path, "write_bytes", full)
    rpem_loop.cache_clear()
    Rpem(three_mass(nominal), identify=("d_a",), P0=[1.0], period=0.005).run([1.0], [1.0])
    assert not list(tmp_path.iterdir())
    rpem_loop.cache_clear()


HOLDS = """
import fcntl, sys, time
claim = open(sys.argv[1], "ab")
fcntl.flock(claim, fcntl.LOCK_EX)
print("held", flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files are not locked there")
def test_a_stopped_process_holds_up_nobody_for_ever(tmp_path, monkeypatch, capsys):
    made = Compiled(lambda x: 2.0 * x, label="a double")
    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(kept, "TOLD", 0.05)
    monkeypatch.setattr(kept, "PATIENCE", 0.2)
    store, kinds = made.dispatcher._cache, (float64,)
    claim = store.path(kinds, made.dispatcher.targetctx.codegen()).with_suffix(".claim")
    command = [sys.executable, "-c", HOLDS, str(claim)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout.readline() == "held\n"
            began = time.monotonic()
            assert made(3.0) == 6.0
            assert time.monotonic() - began > kept.PATIENCE
        finally:
            holder.kill()
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2  # once each
    assert "waiting for another process to compile a double" in told[0]
    assert "compiling a double" in told[1]
    assert list(tmp_path.glob("*.nbc"))  # kept for others all the same


FACTOR = 2.0
TABLE = np.array([1.0, 2.0])


@inlined
def inner(x):
    return FACTOR * x


@compiled
def outer(x):
    return inner(x) + TABLE[0]


def source(code, *, name="f", **globals_):
    scope = {"inner": inner, "FACTOR": FACTOR, "TABLE": TABLE} | globals_
    exec(code, scope)
    return Compiled(scope[name])


def test_the_digest_sees_everything_that_is_reached():
    same = "def f(x):\n    return inner(x) + FACTOR"
    plain = source(same).digest
    assert source(same).digest == plain
    other = Compiled(source("def g(x):\n    return 3.0 * x", name="g").function, inline=True)
    assert source("def f(x):\n    return inner(x) - FACTOR").digest != plain  # the code
    assert source(same, FACTOR=3.0).digest != plain  # a constant
    assert source(same, inner=other).digest != plain  # what it calls
    table = "def f(x):\n    return TABLE[0]"
    assert source(table).digest != source(table, TABLE=np.array([1.0, 3.0])).digest


def test_the_digest_sees_what_an_intrinsic_emits():
    reached = b"".join(compiler._content(beside_loop(Pattern(1, 1, (), (), ()), (), 4), set()))
    for module in (beside_loop.__wrapped__, measure, entries, Fields, Runs):
        assert Path(getsourcefile(module)).read_bytes() in reached


def test_two_plugs_are_two_functions():
    def loop(plug):
        @compiled
        def run(x):
            return plug(x)

        return run

    one, other = loop(inner), loop(Compiled(lambda x: x, inline=True))
    assert (one(3.0), other(3.0), outer(1.0)) == (6.0, 3.0, 3.0)
    assert one.digest != other.digest


ALIKE = """
import os, sys
import numpy as np
from flexaxis.estimators.sampling.compiler import compiled, inlined

# so long that it stays a function of its own
LINES = ["        x = np.sin(x + n * {i}.0) + np.cos(n * x)".format(i=i) for i in range(60)]
BODY = chr(10).join(LINES)
exec(f'''
def made(n, first=False):
    def inner(x):
{BODY}
        return x
    inner = compiled(inner)
    def small(x):
        return inner(x) + inner(inner(x + 1.0))
    small = inlined(small)
    if first:
        small(0.5)
    def outer(x):
        return small(x)
    return compiled(outer)
''')
if "fork" in sys.argv[1]:
    compiled(lambda x: x)(0.5)  # numba is there before
for numbers in sys.argv[1].split(":"):
    if numbers.startswith("fork"):
        if (child := os.fork()) == 0:
            print(made(float(numbers[4:]))(0.5), flush=True)
            os._exit(0)
        os.waitpid(child, 0)
    else:
        print(made(float(numbers[-1]), numbers.startswith("first"))(0.5), flush=True)
"""


@pytest.mark.parametrize(
    "compiling",
    [
        ["2", "3"],
        ["first2", "first3"],  # what is kept by nobody is called before
        pytest.param(["fork2:fork3"], marks=pytest.mark.skipif(not FORKS, reason="no fork here")),
    ],
)
def test_functions_of_two_processes_do_not_stand_in_for_each_other(compiling, tmp_path):
    """Two of one factory that count alike; a third process takes both from the folder."""

    def run(words, folder):
        command = [sys.executable, "-c", ALIKE, words]
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / folder)}
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True, timeout=120
        )
        return done.stdout.split()

    alone = [line for words in compiling for line in run(words, "shared")]
    assert len(set(alone)) == 2
    assert run("2:3", "shared") == alone


def test_a_numba_that_names_otherwise_keeps_nothing(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compiler, "distinct", lambda: False)
    assert Compiled(lambda x: 2.0 * x, label="a double")(3.0) == 6.0
    assert not list(tmp_path.iterdir())
    assert "a double each time, as this numba" in capsys.readouterr().err
    monkeypatch.setattr(bytecode, "FunctionIdentity", object)
    assert not symbols.distinct.__wrapped__()


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
    file = home / "estimators" / "recursion" / "measurement.py"
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
