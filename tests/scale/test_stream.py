"""Filters stay sound however long they run."""

import resource
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))

from acceptance.axes import AXES, SIGMA, simulate
from acceptance.measures import make

CHUNK = 20_000  # samples, ten periods of the reference
SETTLED = 2_000  # of those, the last: what was to be learnt has been


def smallest(covariance) -> float:
    """Return the smallest eigenvalue of a covariance as correlations."""
    deviation = np.sqrt(np.diag(covariance))
    return float(np.linalg.eigvalsh(covariance / np.outer(deviation, deviation))[0])


def peak() -> float:
    """Return the most memory that this process ever had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rpem-forgetting", "glr", "imm"])
def test_a_million_samples_leave_it_sound(name):
    """Motion of 100 s is repeated with fresh noise."""
    run = simulate(AXES["n1"], 1.5 * CHUNK * 0.005)
    u, clean = run.u[-CHUNK:], run.clean[-CHUNK:]  # the start from rest has died away
    estimator, noise, before = make(name), np.random.default_rng(0), 0.0
    for chunk in range(50):
        theta = estimator.run(u, clean + SIGMA * noise.standard_normal(CHUNK))
        assert np.isfinite(theta).all()
        assert smallest(estimator.covariance) > 1e-6
        if chunk:
            assert np.abs(theta[-SETTLED:] / run.theta[-1] - 1).max() < 0.05
        before = before or peak()
    assert peak() - before < 20  # MB


def test_a_covariance_that_is_none_is_seen():
    assert smallest(np.diag([1.0, 1e-12])) == 1.0
    assert smallest(np.array([[1.0, 2.0], [2.0, 1.0]])) < 0
