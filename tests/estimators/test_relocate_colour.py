"""What is normal in a residual, and the alarm: textbook equations and a loop written out."""

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from flexaxis.estimators.recursion.records import joined, record
from flexaxis.estimators.relocate.colour import hear, listen, listening, write_colour
from flexaxis.estimators.sampling.compiler import compiled

T = 0.005


@compiled
def many(tuning, state, residuals, rang, evidence):
    for k in range(len(residuals)):
        state[0]["epsilon"] = residuals[k]
        rang[k] = listen(tuning[0], state[0], residuals[k])
        state[0]["count"] += 1
        for i in range(2):
            evidence[k, i] = state[0]["evidence"][i]


def alone(alarm):
    """Tuning and state of the listener without a filter; the first field tells numba so."""
    tuning, state = listening(alarm, T)
    return joined(tuning, record(alone=1.0)), state


def given(**values):
    """What the listener finds in the state of a filter that is well under way."""
    usual = dict(epsilon=0.0, quiet=1.0, scale=1.0, psi=np.ones(3), count=0, samples=400.0)
    return record(**usual | values)


def heard(residuals, noise=1.0, alarm=10.0, psi=1.0):
    """Return the state after some residuals, when it rang, and the evidence at each."""
    tuning, state = alone(alarm)
    state = joined(state, given(quiet=noise, psi=np.full(3, psi)))
    rang, evidence = np.zeros(len(residuals), bool), np.zeros((len(residuals), 2))
    many(tuning, state, np.asarray(residuals, float), rang, evidence)
    return state[0], rang, evidence


def ar1(rng, factor, N):
    return np.sqrt(1 - factor**2) * lfilter([1.0], [1.0, -factor], rng.standard_normal(N))


def test_colour_is_the_solution_of_the_yule_walker_equations():
    correlations = np.array([1.2, 0.7, 0.1, -0.2, -0.1])
    colour = np.empty(5)
    write_colour.function(correlations, 0.0, colour)
    weights = solve_toeplitz(correlations[:4], correlations[1:])
    np.testing.assert_allclose(colour[:4], weights, rtol=1e-6)  # less a floor of 1e-9
    remains = 1 - weights @ correlations[1:] / correlations[0]
    assert colour[4] == pytest.approx(remains, rel=1e-6)


def test_the_alarm_is_the_cusum_of_two_likelihood_ratios():
    rng = np.random.default_rng(0)
    residuals = rng.standard_normal(600)
    residuals[500:] *= 1.5
    residuals[550] = 100.0  # counts as one of four deviations
    quiet = heard(residuals[:499])[0]
    _, _, evidence = heard(residuals, alarm=1e9)
    assert not evidence[:199].any()  # it warms up for a second
    assert np.all(evidence[549] > 0) and quiet["heard"] == 499
    gained = evidence[550] - evidence[549]
    for growth, got in zip((4.0, 1.6), gained, strict=True):
        # the correlation of neighbours is about zero: what it makes of 16 is 16 or a little less
        expected = (16 * (1 - 1 / growth) - np.log(growth)) / 2
        assert got == pytest.approx(expected, rel=0.15)
    white = heard(residuals, alarm=1e9)[0]["white"]
    assert abs(white) <= 4.0


def test_what_repeats_itself_counts_as_often_as_it_says_something_new():
    """(1+ρ)/(1−ρ) whitened residuals tell as much as one, where whitening does not remove ρ."""
    tuning, state = alone(1e9)
    state = joined(state, given(epsilon=3.0, count=400))
    state["heard"], state["learning"] = 400.0, 0
    rang, evidence = np.zeros(1, bool), np.zeros((1, 2))
    gained = []
    for correlation in (0.0, 0.5, -0.5):
        one = state.copy()
        one["correlation"] = correlation
        many(tuning, one, np.array([3.0]), rang, evidence)
        gained.append(evidence[0].copy())
    np.testing.assert_allclose(
        gained[0], [(9 * 0.75 - np.log(4)) / 2, (9 * 0.375 - np.log(1.6)) / 2]
    )
    np.testing.assert_allclose(gained[1], gained[0] / 3)
    np.testing.assert_allclose(gained[2], gained[0])


def test_a_coloured_residual_is_whitened_and_a_larger_one_still_rings():
    rng = np.random.default_rng(1)
    residuals = np.r_[ar1(rng, 0.95, 4000), ar1(rng, 0.95, 400)]
    residuals[4000:] *= 3
    state, rang, _ = heard(residuals)
    assert state["colour"][0] > 0.5
    assert not rang[:4000].any() and rang[4000:4100].any()


def test_whitening_ends_as_soon_as_it_no_longer_pays():
    """A model of an old transient would make a white residual seven times larger."""
    rng = np.random.default_rng(2)
    old, new = ar1(rng, 0.97, 2000), rng.standard_normal(2000)
    state, _, _ = heard(old)
    assert state["colour"][0] > 0.5
    state, _, _ = heard(np.r_[old, new[:300]], alarm=1e9)
    assert state["model"][0] > 0.4  # it is still remembered
    np.testing.assert_array_equal(state["colour"], [0, 0, 0, 0, 1])  # and not in use
    evidence = heard(np.r_[old, new], alarm=1e9)[2]
    assert np.all(evidence[-1] < 0.8 * evidence[2500])  # a stale model's would rise for ten seconds


def test_nothing_is_heard_while_the_axis_rests():
    rng = np.random.default_rng(3)
    residuals = np.r_[rng.standard_normal(400), 5 * rng.standard_normal(400)]
    state, rang, evidence = heard(residuals, psi=1e-3)
    assert state["heard"] == 0 and not rang.any() and not evidence.any()


def test_learning_stops_on_demand():
    tuning, state = listening(10.0, T)
    state["learning"] = 0
    before = state.copy()
    hear.function(tuning[0], state[0], 1.0, 2.0, 1.5)
    for name in ("heard", "correlations", "model", "colour", "plain", "power", "correlation"):
        np.testing.assert_array_equal(state[name], before[name])
    assert state["lags"][0, 0] == 2.0 and state["white"] == 1.5
