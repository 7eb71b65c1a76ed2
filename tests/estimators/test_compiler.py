"""Compiled code is kept in the user's cache folder, is never stale, and goes wrong nowhere."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.models import compiler, memory
from flexaxis.estimators.registry import REGISTRY

PART = """
from flexaxis.estimators.models.compiler import inlined

@inlined
def scaled(x):
    return 2.0 * x
"""
WHOLE = """
from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.part import scaled

@compiled
def doubled(x):
    return scaled(x)
"""
PROGRAM = "from flexaxis.estimators.whole import doubled; print(doubled(3.0))"


@pytest.fixture
def copy(tmp_path):
    """A copy of the estimators with two modules more, of which one calls the other."""
    package = tmp_path / "package" / "flexaxis"
    source = Path(compiler.__file__).parents[1]
    shutil.copytree(source, package / "estimators", ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__init__.py").touch()
    (package / "estimators" / "part.py").write_text(PART)
    (package / "estimators" / "whole.py").write_text(WHOLE)
    return package


def start(copy, cache, program=PROGRAM):
    environment = {k: v for k, v in os.environ.items() if "NUMBA" not in k}
    environment.pop("FLEXAXIS_COMPILED", None)
    environment |= {"XDG_CACHE_HOME": str(cache), "LOCALAPPDATA": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-c", program],
        env=environment | {"PYTHONPATH": str(copy.parent)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    stdout, stderr = process.communicate(timeout=240)
    assert process.returncode == 0, stderr
    return stdout.strip(), stderr


@pytest.mark.slow
def test_an_edit_of_what_is_called_is_seen(copy, tmp_path):
    """Numba by itself would keep the caller, whose own file is as it was."""
    cache = tmp_path / "cache"
    value, words = ended(start(copy, cache))
    assert value == "6.0" and "compiling filters once" in words
    assert ended(start(copy, cache)) == ("6.0", "")  # nothing left to compile
    (copy / "estimators" / "part.py").write_text(PART.replace("2.0", "5.0"))
    assert ended(start(copy, cache))[0] == "15.0"


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_is_told_in_a_line(copy, tmp_path):
    nowhere = tmp_path / "file"
    nowhere.touch()
    value, words = ended(start(copy, nowhere))
    assert value == "6.0"
    assert "no cache folder is writable" in words and words.count("\n") == 1
    assert not list(copy.rglob("*.nbi"))


def test_each_kind_of_view_has_its_own_name():
    """Numba links cached functions by name and argument types, not by what they return."""
    kinds = [np.dtype(float), np.dtype(np.int64), np.dtype([("a", float), ("b", np.int64)])]
    names = {memory._view(kind, n).__qualname__ for kind in kinds for n in (1, 2, 3)}
    assert len(names) == 9


@pytest.mark.slow
def test_processes_at_once_compile_each_signature_once(copy, tmp_path):
    """Without a lock, both could be kept in one file, and a later process would take the wrong."""
    programs, cache = [PROGRAM, PROGRAM, PROGRAM.replace("3.0", "3")], tmp_path / "cache"
    started = [start(copy, cache, program) for program in programs]
    values, words = zip(*map(ended, started), strict=True)
    assert values == ("6.0",) * 3 and "".join(words).count("compiling") == 1
    assert len(list(cache.rglob("*.nbc"))) == 2
    assert ended(start(copy, cache, ";".join(programs[1:])))[0].split() == ["6.0", "6.0"]


STEPS = """
import sys
import numpy as np
from flexaxis.estimators.registry import REGISTRY
np.seterr(all="ignore")
nominal = eval(sys.argv[1])
u = np.random.default_rng(0).standard_normal(400)
for name in sys.argv[2:]:
    made = REGISTRY[name].factory(nominal, 0.005, torque=u)
    print(made.run(u[:12], np.cumsum(u[:12]))[-1].tolist())
"""


@pytest.mark.slow
def test_one_can_step_through_the_filters(nominal):
    """Without compilation, as a debugger needs it, they give the same numbers."""
    names = ("rpem-forgetting", "cusum-reset", "ekf", "imm", "glr")
    program = [sys.executable, "-c", STEPS, repr(dict(nominal)), *names]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(program, env=environment, capture_output=True, text=True, check=True)
    u = np.random.default_rng(0).standard_normal(400)
    for name, line in zip(names, done.stdout.splitlines(), strict=True):
        made = REGISTRY[name].factory(nominal, 0.005, torque=u)
        expected = made.run(u[:12], np.cumsum(u[:12]))[-1]
        np.testing.assert_allclose(eval(line), expected, rtol=1e-9, err_msg=name)
