"""Starts from which the recursive method alone does not return."""

import numpy as np
import pytest

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.finding import LOST
from flexaxis.estimators.relocate.search import halton

T = 0.005
NAMES = ("k_T", "1/J_a", "f_m")
P0 = known_P(NAMES, forgetting=0.995)


def test_halton_points_are_mirrored_digits():
    expected = [[1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9], [1 / 8, 4 / 9], [5 / 8, 7 / 9]]
    np.testing.assert_allclose(halton(5, 2), expected, rtol=1e-12)


@pytest.mark.parametrize("start", [0.5, 2.0])
def test_a_local_minimum_is_left_without_an_alarm(nominal, loop, start):
    truth = three_mass(nominal).parametrize(NAMES).theta
    options = dict(theta0=start * truth, P0=P0, period=T)
    lost = Rpem(three_mass(nominal), **options, state_correction=True)
    assert abs(lost.run(loop.u[:4000], loop.y[:4000])[-1] / truth - 1).max() > 0.3
    found = Relocate(three_mass(nominal), **options)
    np.testing.assert_allclose(found.run(loop.u[:4000], loop.y[:4000])[-1], truth, rtol=0.02)
    assert found.findings == ()


def test_where_nothing_explains_the_data_it_is_said_once(nominal, loop):
    """The output is that of another axis, foreign to any parameters in the box."""
    alien = np.roll(loop.y, 50)  # a quarter of a second too late
    filter_ = Relocate(three_mass(nominal), P0=P0, period=T, alarm=1e9)
    filter_.run(loop.u, alien)
    (finding,) = filter_.findings
    assert finding.parameters == () and finding.reason == LOST
