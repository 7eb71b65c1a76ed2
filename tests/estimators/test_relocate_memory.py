"""The past as it was: against the estimates that the filter gave at the time."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.filter import Relocate

T = 0.005
NAMES = ("k_T", "1/J_a", "f_m")
P0 = known_P(NAMES, forgetting=0.995)
COUNT, LENGTH = 2500, 1024  # samples, and those of 5.12 s


@pytest.fixture(scope="module")
def filtered(nominal, loop):
    filter_ = Relocate(three_mass(nominal), suspects=["k_g"], P0=P0, period=T)
    valid = np.ones(COUNT, bool)
    valid[2000:2010] = False
    theta = filter_.run(loop.u[:COUNT], loop.y[:COUNT], valid)
    return filter_, theta / filter_._design.scale[:3], valid


def test_a_stretch_is_what_was_known_whatever_the_ring(filtered, loop):
    filter_, eta, valid = filtered
    memory = filter_._judge.memory
    assert memory.count == COUNT and memory.first == COUNT - LENGTH
    for first in (memory.first, 2040, 2048, 2499):  # the ring closes at 2048
        stretch = memory.stretch(first)
        assert stretch.first == first and len(stretch.rows) == COUNT - first
        np.testing.assert_allclose(stretch.theta[:, :3], eta[first:], rtol=1e-14)
        assert stretch.at(2499)["count"] == COUNT
        u, y, present = memory.signals(first)
        np.testing.assert_array_equal(u[:, 0], loop.u[first:COUNT])
        np.testing.assert_array_equal(present, valid[first + 1 :])
        np.testing.assert_array_equal(y[present], loop.y[first + 1 : COUNT][present])
    assert np.isnan(memory.read("epsilon", 1990)[10:20]).all()
    innovations = filter_.innovations[2000:, 0]
    np.testing.assert_array_equal(memory.read("epsilon", 2000), innovations)


def test_before_what_is_remembered_there_is_nothing(nominal, loop, filtered):
    memory = filtered[0]._judge.memory
    assert memory.stretch(0).first == memory.first
    assert not memory.read("theta", memory.first - 3)[:3].any()
    young = filtered[0].copy()
    young.reset()
    young.run(loop.u[:10], loop.y[:10])
    assert not young._judge.memory.read("epsilon", -4)[:4].any()
    assert young._judge.memory.read("y", 0).tolist() == loop.y[:10].tolist()


def test_a_stretch_is_a_copy_that_nothing_changes(filtered, loop):
    filter_ = filtered[0].copy()
    stretch = filter_._judge.memory.stretch(2400)
    before = stretch.theta.copy()
    filter_.run(loop.u[:LENGTH], loop.y[:LENGTH])
    np.testing.assert_array_equal(stretch.theta, before)
    with pytest.raises(ValueError, match="read-only"):
        stretch.rows["theta"][0, 0] = 1.0


@pytest.mark.parametrize("period", [0.001, 0.01])
def test_it_is_as_long_in_seconds_at_any_rate(nominal, loop, period):
    filter_ = Relocate(three_mass(nominal), P0=P0, period=period)
    N = round(6 / period)
    filter_.run(np.resize(loop.u, N), np.zeros(N), np.zeros(N, bool))
    seconds = (filter_._judge.memory.count - filter_._judge.memory.first) * period
    # a search of the last 4 s takes up to 200 samples, at low rates longer than the rest
    assert seconds == pytest.approx(max(5.12, 4.0 + 200 * period))
