"""The prediction-error method beside the same in C, straight-line for its pattern."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.methods.beside import registers

spec = importlib.util.spec_from_file_location("floor", Path(__file__).parent / "floor.py")
floor = importlib.util.module_from_spec(spec)
sys.modules["floor"] = floor
spec.loader.exec_module(floor)

pytestmark = pytest.mark.skipif(floor.CC is None or not registers(), reason="no C compiler here")


@pytest.mark.slow
@pytest.mark.parametrize("runs", [1, registers() or 1])
def test_both_do_the_same(tmp_path, runs):
    u, y = floor.signals()
    one = floor.filter_()
    theta = one.run(u, y) / one._design.scale
    found = floor.Floor(one, runs, tmp_path).run(
        *(np.repeat(each[:, None], runs, axis=1) for each in (u, y))
    )
    for r in range(runs):
        np.testing.assert_allclose(found[:, :3, r], theta, rtol=1e-12)
        said = found[50:, 3:, r]  # before, R̂ is not known
        np.testing.assert_allclose(said, one._trace[50:], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_one_run_and_a_register_of_them_take_no_more_than_half_as_long_again(tmp_path):
    found, width = floor.best(tmp_path), registers()
    assert found["ours", 1] < 1.5 * found["C", 1]
    assert found["ours", width] < 1.5 * found["C", width]
