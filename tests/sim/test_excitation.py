"""The reference: its spectrum, its size, and its clock in pauses."""

import numpy as np
import pytest

from flexaxis.sim.tables.excitation import Moves, Multisine
from flexaxis.sim.timing import PERIOD, Grid


def rng(seed=0):
    return np.random.default_rng(seed)


def grid(samples):
    return Grid.first(samples, PERIOD)


@pytest.mark.parametrize("seed", range(3))
def test_lines_of_the_band_have_equal_size_and_no_other_line_exists(seed):
    signal = Multisine().one_period(rng(seed), PERIOD)
    size = np.abs(np.fft.rfft(signal)) / signal.size
    assert signal.size == 2000
    # 300 lines of amplitude a have rms a sqrt(300/2); a DFT line is half its amplitude.
    assert np.allclose(size[1:301], 0.0511 / np.sqrt(300 / 2) / 2, rtol=1e-12)
    assert np.max(np.delete(size, np.s_[1:301])) < 1e-16


def test_band_ends_are_included_whatever_the_rounding():
    signal = Multisine(low=0.3, high=0.7, period=10.0).one_period(rng(), PERIOD)
    lines = np.flatnonzero(np.abs(np.fft.rfft(signal)) > 1e-9)
    assert lines.tolist() == [3, 4, 5, 6, 7]


def test_size_does_not_depend_on_the_phase_and_phases_do_on_the_stream():
    one, two = (
        Multisine(rms=0.1).one_period(rng(1), PERIOD),
        Multisine(rms=0.1).one_period(rng(2), PERIOD),
    )
    assert np.std(one) == pytest.approx(0.1, rel=1e-12) == pytest.approx(np.std(two), rel=1e-12)
    assert np.max(np.abs(one - two)) > 0.1
    assert np.array_equal(one, Multisine(rms=0.1).one_period(rng(1), PERIOD))


def test_a_pause_holds_the_last_value_and_stops_the_clock():
    samples = grid(4000)
    always = Multisine().reference(samples, rng())
    paused = Multisine(pause=((5.0, 12.0), (15.0, 16.0))).reference(samples, rng())
    assert np.array_equal(paused[:1000], always[:1000])
    assert np.all(paused[1000:2400] == always[999])
    assert np.array_equal(paused[2400:3000], always[1000:1600])  # on without a jump
    assert np.all(paused[3000:3200] == always[1599])
    assert np.array_equal(paused[3200:], always[1600:2400])


def test_moves_are_of_least_jerk_between_rests():
    moves = Moves(reach=3.0, move=0.4, dwell=0.2)
    samples = grid(1200)
    reference, excited = moves.reference(samples, rng()), moves.excited(samples)
    cycles = reference.reshape(10, 120)  # 80 samples of motion, 40 at rest
    assert np.array_equal(excited.reshape(10, 120), np.tile(np.arange(120) < 80, (10, 1)))
    targets = cycles[:, -1]
    assert np.array_equal(cycles[:, 80:], np.tile(targets[:, None], 40))
    assert reference[0] == 0 and np.array_equal(cycles[1:, 0], targets[:-1])
    assert np.abs(targets).max() <= 3.0 and np.unique(targets).size == 10
    # The polynomial of least jerk is the one of fifth degree at rest at both ends, and its
    # largest speed is 15/8 of the mean.
    path = cycles[4, :80]
    fit = np.polynomial.Polynomial.fit(np.arange(80) / 80, path, 5, domain=[0, 1], window=[0, 1])
    assert np.abs(fit(np.arange(80) / 80) - path).max() < 1e-9
    ends = [fit.deriv(n)(edge) for n in (1, 2) for edge in (0.0, 1.0)]
    assert np.abs(ends).max() < 1e-6
    assert fit.deriv()(0.5) == pytest.approx(15 / 8 * (targets[4] - targets[3]))
