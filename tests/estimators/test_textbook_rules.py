"""The compiled rules of forgetting against textbook loops: 2000 samples, gaps, and jumps."""

import numpy as np
import pytest
from acceptance.axes import AXES, NAMES, scaled, simulate, theta_of
from acceptance.textbook import Cusum, Variable, textbook

from flexaxis.estimators.registry import REGISTRY

LAMBDA = 0.995
LITERAL = {"robust": 0.0, "ceiling": np.inf}  # as in the papers, which know of neither
P0 = np.array([2.97e-4, 5.19e-5, 4.69e-6])
START = 1.05


@pytest.fixture(scope="module")
def jumps():
    """10 s with gaps, one of them long; k_T jumps soon after the start, and twice in a tenth."""
    axis = AXES["n1"]
    faults = {at: axis | {"k_T": k_T} for at, k_T in ((0.6, 0.7), (6.0, 0.7), (6.1, 1.2))}
    run = simulate(axis, 10.0, seed=2, faults=faults)
    k = np.arange(len(run.u))
    return run.u, run.y, (k % 11 > 0) & ((k < 600) | (k > 640))


def compare(signals, name, rule, *, corrected=False, **options):
    """Both over the same samples."""
    axis = scaled(AXES["n1"], START)
    theta0 = theta_of(axis)
    expected = textbook(axis, *signals, rule=rule, theta0=theta0, P0=P0, corrected=corrected)
    found = make(name, axis, **options).run(*signals)
    np.testing.assert_allclose(found / theta0, expected / theta0, rtol=0, atol=1e-9)


def make(name, axis, **options):
    given = {"identify": NAMES, "P0": P0, "forgetting": LAMBDA} | LITERAL | options
    return REGISTRY[name].factory(axis, 0.005, **given)


def test_variable(jumps):
    """The level is low, so that the formula lies between its limits now and then."""
    rule = Variable(LAMBDA, level=1.2)
    compare(jumps, "variable-forgetting", rule, level=1.2)
    factors = np.array(rule.factors)
    assert ((factors > 0.9) & (factors < LAMBDA)).sum() >= 50
    assert (factors == 0.9).any() and (factors == LAMBDA).any()


def test_cusum(jumps):
    """The first second is not judged, and after an alarm half of one: both were put to the test."""
    rule = Cusum(LAMBDA, level=10.0, reset=0.1)
    compare(jumps, "cusum-reset", rule, corrected=True, level=10.0, reset=0.1)
    measured = np.cumsum(jumps[2])
    first, second, third = (measured[k] for k in rule.alarms)
    # the first of all finds nothing in motion, and tells no variance to judge the next by
    assert first == 202 and third - second == 101 and second - first > 101
