"""Faults against their definitions in words, sample by sample."""

import numpy as np
import pytest

from flexaxis.sim.tables.faults import Intermittent, Profile, Ramp, Step, Thermal
from flexaxis.sim.timing import PERIOD, Grid

GRID = Grid.first(4000, PERIOD)


def test_grid_times_are_the_decimals_that_users_write():
    assert PERIOD == 0.005
    assert GRID.times.tolist() == [float(f"{5 * k}e-3") for k in range(4000)]
    assert all(GRID.index(time) == k for k, time in enumerate(GRID.times))


@pytest.mark.parametrize(("at", "k0"), [(10.0, 2000), (10.3, 2060), (10.002, 2000), (10.003, 2001)])
def test_step_begins_at_the_nearest_sample(at, k0):
    factor = Step(parameter="f_m", at=at, factor=1.5).factor_at(GRID)
    assert np.all(factor[:k0] == 1) and np.all(factor[k0:] == 1.5)


@pytest.mark.parametrize("final", [1.5, 0.5])
def test_ramp_is_the_mean_of_a_straight_line_over_each_sample(final):
    ramp = Ramp(parameter="f_m", at=10.0, over=5.0, factor=final)
    fine = np.linspace(0, 20, 4000 * 10, endpoint=False) + 20 / 4000 / 10 / 2
    line = 1 + (final - 1) * np.clip((fine - 10.0) / 5.0, 0, 1)
    expected = line.reshape(4000, 10).mean(axis=1)
    factor = ramp.factor_at(GRID)
    assert np.allclose(factor, expected, rtol=1e-12)
    assert factor[1999] == 1 and factor[2000] != 1  # the onset has the first changed value
    assert factor[2999] != final and factor[3000] == final
    assert ramp.onsets(GRID) == [(2000, 3000)]


@pytest.mark.parametrize("until", [None, 12.25])
def test_intermittent_switches_as_told(until):
    fault = Intermittent(parameter="f_m", at=10.0, on=0.5, off=1.0, factor=2.0, until=until)
    expected, state, left = np.ones(4000), False, 0
    for k in range(2000, 4000 if until is None else round(until * 200)):
        if left == 0:
            state = not state
            left = 100 if state else 200
        left -= 1
        expected[k] = 2.0 if state else 1.0
    factor = fault.factor_at(GRID)
    assert np.array_equal(factor, expected)
    changes = np.flatnonzero(np.diff(factor)) + 1
    assert fault.onsets(GRID) == [(k, k) for k in changes]


@pytest.mark.parametrize("final", [1.5, 0.0])
def test_thermal_is_the_mean_of_an_exponential_over_each_sample(final):
    change = Thermal(parameter="f_m", at=5.0, time_constant=2.0, factor=final)
    fine = np.linspace(0, 20, 4000 * 100, endpoint=False) + 20 / 4000 / 100 / 2
    curve = 1 + (final - 1) * np.where(fine < 5, 0, -np.expm1(-(fine - 5.0) / 2.0))
    expected = curve.reshape(4000, 100).mean(axis=1)
    # the mean of 100 points of a curve that bends little in a sample
    assert np.allclose(change.factor_at(GRID), expected, rtol=0, atol=1e-9)
    ((first, settled),) = change.onsets(GRID)
    assert first == 1000 and change.factor_at(Grid(np.array([settled]), PERIOD))[0] == final


def test_a_profile_goes_straight_from_point_to_point():
    points = ((2.0, 0.4), (6.0, 0.4), (7.0, 1.0), (12.0, 0.5))
    wear = Profile(parameter="f_m", at=5.0, points=points, factor=3.0)
    factor = wear.factor_at(GRID)
    at = {5.0: 1.0, 6.0: 1.4, 7.0: 1.8, 9.0: 1.8, 11.5: 2.4, 12.0: 3.0, 14.5: 2.5, 17.0: 2.0}
    assert {t: pytest.approx(factor[GRID.index(t)], rel=1e-12) for t in at} == at
    assert np.all(factor[: GRID.index(5.0) + 1] == 1) and np.all(factor[GRID.index(17.0) :] == 2)
    lines = ((5.0, 7.0), (11.0, 12.0), (12.0, 17.0))  # and a level one, which is no event
    assert wear.onsets(GRID) == [(GRID.index(a) + 1, GRID.index(b)) for a, b in lines]
    assert wear.in_words() == "f_m 3-fold from 5 s in 4 points"
    changes = np.flatnonzero(np.diff(factor, 2) > 1e-9) + 1  # where it bends upwards
    assert changes.tolist() == [GRID.index(t) for t in (5.0, 11.0, 17.0)]
