"""Filters stay sound however long they run; `tests/scale/stream.py` tries it for hours."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

spec = importlib.util.spec_from_file_location("stream", Path(__file__).parent / "stream.py")
stream = importlib.util.module_from_spec(spec)
sys.modules["stream"] = stream
spec.loader.exec_module(stream)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rpem-forgetting", "glr", "imm"])
def test_a_million_samples_leave_it_sound(name):
    found = stream.stream(name, samples=1e6)
    assert found.finite
    assert found.least > 1e-6
    assert found.error < 0.05
    assert found.grown < 20  # MB


def test_a_covariance_that_is_none_is_seen():
    assert stream.smallest(np.diag([1.0, 1e-12])) == 1.0
    assert stream.smallest([[1.0, 2.0], [2.0, 1.0]]) < 0
