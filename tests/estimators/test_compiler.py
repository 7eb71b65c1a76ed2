"""Compiled code is kept in the user's cache folder, and nothing goes wrong where it cannot be."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.recursion.kernel import rpem_loop
from flexaxis.estimators.sampling import compiler

PROGRAM = """
import json, sys, time
import numpy as np
from flexaxis.estimators import Rpem, three_mass
nominal = json.loads(sys.argv[1])
filter_ = Rpem(three_mass(nominal), identify=("f_m",), P0=[1e-5])
print(filter_.run(np.ones(50), np.ones(50))[-1].tolist())
"""


def start(nominal, cache):
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"XDG_CACHE_HOME": str(cache), "LOCALAPPDATA": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, json.dumps(dict(nominal))],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_parallel_first_calls_and_a_folder_that_cannot_be(nominal, tmp_path):
    cache, nowhere = tmp_path / "cache", tmp_path / "file"
    nowhere.touch()
    package = Path(compiler.__file__).parent
    before = set(package.rglob("*.nb?"))
    first = [start(nominal, folder) for folder in (cache, cache, nowhere)]
    outputs = [process.communicate(timeout=120) for process in first]
    assert [process.returncode for process in first] == [0, 0, 0], outputs
    assert all("compiling a filter for 5 states and 1 param" in stderr for _, stderr in outputs)
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
        made = Rpem(three_mass(nominal), identify=("f_g",), P0=[1.0])
        return made.run([1.0, 0.0], [1.0, 2.0])[-1].tolist()

    monkeypatch.setattr(compiler._settings, "CACHE_DIR", str(tmp_path))
    expected = first_call()
    assert "compiling" in capsys.readouterr().err
    files = list(tmp_path.rglob("*.nb?"))
    assert len(files) == 2  # index and code
    for file in files:
        file.write_bytes(b"torn")
    assert first_call() == expected
    rpem_loop.cache_clear()


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_the_folder_is_the_user_s(monkeypatch, platform):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    assert compiler.user_cache().is_relative_to(Path.home())
