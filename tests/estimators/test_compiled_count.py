"""How much is compiled before a first result: counted, as seconds depend on the machine."""

import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import collections, json, sys
from numba.core import event
from flexaxis.estimators.sampling.parts import WholeCompiler

kinds = collections.Counter()

class Count(event.Listener):
    def on_start(self, event):
        pass

    def on_end(self, event):
        made = event.data["dispatcher"]
        whole = made._compiler.pipeline_class is WholeCompiler
        ours = made.py_func.__module__.startswith("flexaxis.")
        kinds["whole" if whole else "part" if ours else "numba's"] += 1

event.register("numba:compile", Count())
{body}
print(json.dumps(kinds))
"""
ONE = """
import numpy as np
from flexaxis.estimators import Rpem, three_mass
nominal = json.loads(sys.argv[1])
Rpem(three_mass(nominal), identify=("f_m",), P0=[1e-5], period=0.005).run(np.ones(9), np.ones(9))
"""
SUITE = """
from flexaxis.experiments.cli import main
main(["run", "smoke", "--seeds", "1", "--jobs", "1", "--json", "-o", sys.argv[1]])
"""


def counted(body, argument, cache):
    """Return how many functions a program compiles from nothing, by kind."""
    program = PROGRAM.replace("{body}", body)
    made = subprocess.run(
        [sys.executable, "-c", program, argument],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(made.stdout.splitlines()[-1])


def test_a_filter_is_one_function_for_python_and_each_of_its_parts_once(nominal, tmp_path):
    """More than one whole function would make machine code of the same parts again."""
    kinds = counted(ONE, json.dumps(dict(nominal)), tmp_path / "compiled")
    assert kinds["whole"] == 1
    assert kinds["part"] <= 18


@pytest.mark.slow
def test_a_first_suite_compiles_no_more_than_it_did(tmp_path):
    """Half a minute of one core: seven estimators, on speeds and on increments."""
    kinds = counted(SUITE, str(tmp_path / "results"), tmp_path / "compiled")
    assert kinds["whole"] <= 21
    assert kinds["part"] <= 275
