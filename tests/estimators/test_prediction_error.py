"""Fits of a record: how far it is to the bottom, what a gap is not, what steps of laws cost."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from flexaxis.estimators.models.axis_models import one_mass
from flexaxis.estimators.offline.prediction_error import CONVERGED, Problem, jackknife, noise_model
from flexaxis.estimators.offline.trajectory import Trajectory

PERIOD, N, SIGMA = 0.002, 4000, 0.05
VALUES = {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3}


def problem(model, names):
    """Return a problem of a simulated log that begins at rest."""
    rng = np.random.default_rng(3)
    u = np.convolve(0.5 * rng.standard_normal(N + 50), np.ones(50) / 7, "valid")[:N]
    along = Trajectory(model.parametrize(names), u, PERIOD)
    y, _ = along.along(np.r_[along.model.theta, np.zeros(along.q - along.p)])
    q, ok = along.q, np.ones(N, bool)
    held = np.zeros(q, bool)
    held[-1] = held[along.states[0]] = True
    ok[0], box = False, np.full(q, 1e6)
    return Problem(along, y + SIGMA * rng.standard_normal(N), ok, -box, box, held)


@pytest.fixture(scope="module")
def linear():
    result = problem(one_mass(VALUES), ("J_m", "f_m"))
    return result, result.fit(np.r_[1.3e-3, 4e-3, 0.0, 0.0, 0.0])


def test_a_fit_ends_where_the_bottom_is_near(linear):
    problem, fitted = linear
    assert fitted.converged
    assert problem.at(fitted.z, fitted.inverse).left <= CONVERGED
    again = problem.fit(fitted.z * 1.001)
    assert np.all(abs(again.z - fitted.z) <= 2 * CONVERGED * fitted.deviations)
    assert np.all(abs(fitted.z[:2] - [1e-3, 5e-3]) < 4 * fitted.deviations[:2])


def test_a_state_that_is_forgotten_before_it_counts_stays(linear):
    """Behind a gap, of which 3 s do not count, 15 times what it takes to forget a speed."""
    whole, _ = linear
    along = replace(whole.trajectory, begins=(0, 2000))
    ok, held, box = whole.ok.copy(), np.zeros(along.q, bool), np.full(along.q, 1e6)
    ok[2000:3500], held[[2, -1]] = False, True
    gapped = replace(whole, trajectory=along, ok=ok, held=held, lower=-box, upper=box)
    result = gapped.fit(np.r_[1.3e-3, 4e-3, 0.0, 3.0, 0.0, 0.0])
    assert result.converged and result.z[3] == pytest.approx(3.0)
    assert np.all(abs(result.z[:2] - [1e-3, 5e-3]) < 4 * result.deviations[:2])


def test_what_is_left_is_counted_in_standard_deviations(linear):
    problem, fitted = linear
    off, free = np.r_[1.0, -2.0, 0.0, 0.5, 0.0] * fitted.deviations, [0, 1, 3]
    covariance = fitted.covariance[np.ix_(free, free)]
    expected = np.sqrt(off[free] @ np.linalg.solve(covariance, off[free]))
    assert problem.at(fitted.z + off, fitted.inverse).left == pytest.approx(expected, rel=0.05)


def test_samples_on_either_side_of_a_gap_are_no_neighbours():
    """Pieces of an autoregression, each about a level of its own noise; gaps hold nonsense."""
    rng = np.random.default_rng(0)
    a = [1.0, -0.95]
    e = lfilter([1.0], a, rng.standard_normal(40_000))
    ok = np.arange(len(e)) % 40 < 20
    result = noise_model(np.where(ok, e, 1e3), 1, ok)
    # of 20 neighbours 19 are pairs, and a missing pair counts as none: −.95 · 19/20
    assert result[1] == pytest.approx(-0.95 * 19 / 20, abs=0.01)


def test_beside_white_noise_the_jackknife_says_what_a_covariance_says():
    rng, ratios = np.random.default_rng(5), []
    for _ in range(60):
        rows = rng.standard_normal((2, 2000)) * [[1.0], [3.0]]
        deviation = jackknife(rows, rng.standard_normal(2000), np.ones(2000, bool))
        ratios.append(deviation / np.sqrt(np.diag(np.linalg.inv(rows @ rows.T))))
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(ratios), axis=0)), 1.0, rtol=0.15)


def test_an_error_that_depends_on_the_speed_scatters_over_pieces_of_speed():
    """In time it is the same in every piece, as each has four periods but for one sample."""
    speed, good = np.sin(2 * np.pi * np.arange(2000) / 50), np.ones(2000, bool)
    assert jackknife(speed[None], speed**3, good) < 1e-4
    assert jackknife(speed[None], speed**3, good, abs(speed)) > 0.05
