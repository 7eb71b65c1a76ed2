"""A numba without what `parts` takes from its inside compiles all the same, and to the same."""

import json
import os
import subprocess
import sys

import pytest

from flexaxis.estimators import registry
from flexaxis.estimators.sampling import compiler
from flexaxis.estimators.sampling.compiler import Compiled, inlined


@inlined
def third(x):
    return x / 3.0


def twice(x):
    return third(x) + third(x)


@pytest.mark.parametrize("error", [ImportError, AttributeError])
def test_what_parts_lack_is_compiled_plainly(error, monkeypatch, tmp_path):
    def lacking(name):
        if name.endswith(".parts"):
            raise error(name)
        return imported(name)

    expected = Compiled(twice)
    value, digest = expected(0.1), expected.digest
    imported = compiler.import_module
    monkeypatch.setattr(compiler, "import_module", lacking)
    monkeypatch.setattr(compiler, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compiler, "_numbas", compiler.lru_cache(compiler._numbas.__wrapped__))
    monkeypatch.setitem(globals(), "third", Compiled(third.function, inline=True))
    made = Compiled(twice)
    assert made(0.1) == value
    assert made.digest != digest  # or the one would load what the other has kept
    assert list(tmp_path.glob("*.nbc"))


ANOTHER_NUMBA = """
import json, sys
import numpy as np
from numba import _dynfunc
make_function = _dynfunc.make_function
del _dynfunc.make_function
from flexaxis.estimators.sampling import compiler
found = compiler._numbas().__name__
_dynfunc.make_function = make_function  # numba itself uses it to compile
from flexaxis.estimators import registry
u, y = np.array(json.loads(sys.argv[2]))
made = registry.entry("rpem-forgetting").factory(json.loads(sys.argv[1]), 0.005)
print(json.dumps([found, compiler.inlined(len).digest, made.run(u, y).tobytes().hex()]))
"""


@pytest.mark.slow
def test_another_numba_gives_the_same_numbers(nominal, loop, tmp_path):
    """One that lacks what `parts` takes from its inside; what it compiles is kept apart."""
    u, y = loop.u[:100], loop.y[:100]
    given = json.dumps(dict(nominal)), json.dumps([u.tolist(), y.tolist()])
    made = subprocess.run(
        [sys.executable, "-c", ANOTHER_NUMBA, *given],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    found, digest, numbers = json.loads(made.stdout)
    assert found.endswith(".plain")
    assert digest != inlined(len).digest
    here = registry.entry("rpem-forgetting").factory(nominal, 0.005).run(u, y)
    assert numbers == here.tobytes().hex()
