"""Fits of a record: how far it is to the bottom, what a gap is not, what steps of laws cost."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from flexaxis.estimators.models.axes import one_mass
from flexaxis.estimators.offline.colour import noise_model
from flexaxis.estimators.offline.prediction_error import CONVERGED, Problem, fit
from flexaxis.estimators.offline.trajectory import trajectory

PERIOD, N, SIGMA = 0.002, 4000, 0.05
VALUES = {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3}


def problem(model, names):
    """Return a problem of a simulated log."""
    rng = np.random.default_rng(3)
    u = np.convolve(0.5 * rng.standard_normal(N + 50), np.ones(50) / 7, "valid")[:N]
    along = trajectory(model, names, u, period=PERIOD)
    y, _ = along.along(np.r_[along.model.theta, 0.0, 0.0])
    q, ok = along.q, np.ones(N, bool)
    held = np.zeros(q, bool)
    held[-1], ok[0] = True, False
    box = np.full(q, 1e6)
    return Problem(along, y + SIGMA * rng.standard_normal(N), ok, -box, box, held, whiten=False)


@pytest.fixture(scope="module")
def linear():
    result = problem(one_mass(VALUES), ("J_m", "f_m"))
    return result, fit(result, np.r_[1.3e-3, 4e-3, 0.0, 0.0])


def test_a_fit_ends_where_the_bottom_is_near(linear):
    problem, fitted = linear
    assert fitted.converged
    assert problem.at(fitted.z, fitted.colour).left <= CONVERGED
    again = fit(problem, fitted.z * 1.001)
    assert np.all(abs(again.z - fitted.z)[:3] <= 2 * CONVERGED * fitted.deviations[:3])
    assert np.all(abs(fitted.z[:2] - [1e-3, 5e-3]) < 4 * fitted.deviations[:2])


def test_a_state_that_is_forgotten_before_it_counts_stays(linear):
    """Behind a gap, of which 3 s do not count, 15 times what it takes to forget a speed."""
    whole, _ = linear
    along = trajectory(
        one_mass(VALUES), ("J_m", "f_m"), whole.trajectory.u, period=PERIOD, begins=(0, 2000)
    )
    ok, held, box = whole.ok.copy(), np.zeros(along.q, bool), np.full(along.q, 1e6)
    ok[2000:3500], held[-1] = False, True
    gapped = replace(whole, trajectory=along, ok=ok, held=held, lower=-box, upper=box)
    result = fit(gapped, np.r_[1.3e-3, 4e-3, 3.0, 0.0, 0.0])
    assert result.converged and result.z[2] == pytest.approx(3.0)
    assert np.all(abs(result.z[:2] - [1e-3, 5e-3]) < 4 * result.deviations[:2])


def test_what_is_left_is_counted_in_standard_deviations(linear):
    problem, fitted = linear
    off = np.r_[1.0, -2.0, 0.5, 0.0] * fitted.deviations
    expected = np.sqrt(off[:3] @ np.linalg.solve(fitted.covariance[:3, :3], off[:3]))
    assert problem.at(fitted.z + off, fitted.colour).left == pytest.approx(expected, rel=0.05)


def test_samples_on_either_side_of_a_gap_are_no_neighbours():
    """Pieces of an autoregression, each about a level of its own noise; gaps hold nonsense."""
    rng = np.random.default_rng(0)
    a = [1.0, -0.95]
    e = lfilter([1.0], a, rng.standard_normal(40_000))
    ok = np.arange(len(e)) % 40 < 20
    result = noise_model(np.where(ok, e, 1e3), 1, ok)
    # of 20 neighbours 19 are pairs, and a missing pair counts as none: −.95 · 19/20
    assert result[1] == pytest.approx(-0.95 * 19 / 20, abs=0.01)
    np.testing.assert_array_equal(noise_model(e, 5), noise_model(e, 5, np.ones(len(e), bool)))
