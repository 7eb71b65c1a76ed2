"""What the joint filters have in common: rest, noise, claims, options."""

from functools import partial

import numpy as np
import pytest
from acceptance.axes import held

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.methods.imm import joint_imm
from flexaxis.estimators.registry import REGISTRY

JOINT = ["ekf", "imm"]
TRUTH = np.array([1.0, 1.25, 0.05])
T = 0.005


def make(name, nominal, *, start=1.0, period=T, **options):
    """A registered estimator that starts off the truth."""
    off = {"k_T": start, "J_a": 1 / start, "f_m": start}
    told = {key: value * off.get(key, 1.0) for key, value in nominal.items()}
    return REGISTRY[name].factory(told, period, **options)


def encoder(loop, *, counts=65536):
    """Increments of an angle that is rounded."""
    step = 2 * np.pi / counts
    angle = np.round(loop.angle / step) * step
    return np.diff(angle, prepend=angle[0]) / T


# Outliers


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("name", JOINT)
def test_a_minute_after_outliers_all_is_well(nominal, simulated, name, number):
    loop = simulated(90.0, seed=6)
    y = loop.y.copy()
    y[6000 : 6000 + number] = 1e9
    filter_ = make(name, nominal, start=1.2)
    theta = filter_.run(loop.u, y)
    assert np.isfinite(theta).all() and np.isfinite(filter_.covariance).all()
    np.testing.assert_allclose(theta[-200:], np.tile(TRUTH, (200, 1)), rtol=0.02)
    assert 0.085 < deviation(filter_) < 0.115  # of 0.1


@pytest.mark.parametrize("name", JOINT)
def test_how_far_off_a_burst_is_does_not_matter(nominal, simulated, name):
    loop, found = simulated(20.0, seed=6), []
    for size in (1e4, 1e9):
        y = loop.y.copy()
        y[3000:3003] = size, 1.5 * size, 2 * size  # each another: else the sensor is stuck
        found.append(make(name, nominal).run(loop.u, y))
    np.testing.assert_array_equal(*found)


def with_spikes(nominal, loop, spikes, *, told=()):
    """Run over 30 s with these readings added, those of ``told`` declared invalid."""
    y, valid = loop.y.copy(), np.ones(len(loop.y), bool)
    for k, size in spikes.items():
        y[k] += size
    valid[list(told)] = False
    return make("ekf", nominal).run(loop.u, y, valid)[-1]


def test_wild_readings_are_left_out_once_a_sensor_has_shown_that_it_gives_them(nominal, simulated):
    """300 standard deviations, then 50, then two that have nothing in common: as if not valid."""
    loop = simulated(30.0, seed=6)
    spikes = {3000: 30.0, 4000: 5.0, 5000: 4.0, 5001: -3.0}
    expected = with_spikes(nominal, loop, {}, told=spikes)
    np.testing.assert_allclose(with_spikes(nominal, loop, spikes), expected, rtol=1e-9)


def test_a_wild_angle_is_known_by_two_increments(nominal, simulated):
    """There and back, 300 standard deviations, then 50; what is on both sides of a gap is not."""
    loop = simulated(30.0, seed=6)
    spikes = {3000: 30.0, 3001: -30.0, 4000: 5.0, 4001: -5.0}
    expected = with_spikes(nominal, loop, {}, told=spikes)
    np.testing.assert_allclose(with_spikes(nominal, loop, spikes), expected, rtol=1e-9)
    used = with_spikes(nominal, loop, {3000: 30.0, 4000: 5.0}, told=[3001])
    left_out = with_spikes(nominal, loop, {}, told=[3000, 3001, 4000])
    assert np.abs(used / left_out - 1).max() > 1e-6


def test_what_may_be_a_fault_is_used(nominal, simulated):
    """50 standard deviations of a sensor that has not erred, and a reading that goes on so."""
    loop = simulated(30.0, seed=6)
    left_out = with_spikes(nominal, loop, {}, told=(3000, 4000, 4001))
    for spikes in ({4000: 5.0}, {3000: 30.0, 4000: 2.0, 4001: 4.0}):
        used = with_spikes(nominal, loop, spikes, told={3000, 4000, 4001} - spikes.keys())
        assert np.abs(used / left_out - 1).max() > 1e-6


def test_a_reading_in_a_hundred_may_be_wild(nominal, simulated):
    loop, rng = simulated(60.0, seed=6), np.random.default_rng(14)
    wild = rng.random(len(loop.y)) < 0.01
    y = loop.y + 30 * wild * rng.standard_normal(len(wild))
    filter_ = make("ekf", nominal, start=1.2)
    theta = filter_.run(loop.u, y)
    np.testing.assert_allclose(theta[-200:], np.tile(TRUTH, (200, 1)), rtol=0.02)
    assert 0.085 < deviation(filter_) < 0.115


def deviation(filter_):
    """σ̂ of a filter."""
    return np.sqrt(np.max(filter_.state["noise"]))


@pytest.mark.parametrize("name", ["ekf", pytest.param("imm", marks=pytest.mark.slow)])
def test_an_encoder_at_rest_does_not_hide_its_noise(nominal, simulated, name):
    """Its increments are exactly zero there: σ̂ would fall by a factor in every second."""
    loop = simulated(110.0, seed=7, pause=(30.0, 50.0), sigma=0.0)
    filter_ = make(name, nominal, output="increment")
    y, known = encoder(loop), []
    for part in range(0, len(y), 400):
        filter_.run(loop.u[part : part + 400], y[part : part + 400])
        known.append(deviation(filter_))
    # 0.0078, from the rounding; the filters take the smaller of two means of 400 samples
    assert min(known[12:]) > 0.4 * 0.0078 and max(known[12:]) < 2 * 0.0078


# The noise level


@pytest.mark.parametrize("sigma", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("name", JOINT)
def test_the_noise_is_found(nominal, simulated, name, sigma):
    filter_ = make(name, nominal, start=1.2)
    found = []
    for seed in range(4):
        loop = simulated(20.0, seed=seed, sigma=sigma)
        filter_.reset()
        filter_.run(loop.u, loop.y)
        found.append(deviation(filter_))
    # of four runs with 200 samples or more: 2.5 %; the smaller of two means is 1 % low
    np.testing.assert_allclose(np.mean(found), sigma, rtol=0.08)


@pytest.mark.parametrize("name", JOINT)
def test_a_fault_is_not_taken_for_noise(nominal, simulated, name):
    """Its residual is 20 times the noise for seconds; R of the textbook would end there."""
    loop = simulated(25.0, seed=8, faults={20.0: nominal | {"f_m": 0.075}})
    filter_ = make(name, nominal)
    filter_.run(loop.u[:4000], loop.y[:4000])
    for k in range(4000, 5000):
        filter_.step(loop.u[k], loop.y[k])
        assert 0.09 < deviation(filter_) < 0.12


@pytest.mark.parametrize("name", JOINT)
def test_a_prediction_that_is_better_than_its_claim_leaves_the_noise(nominal, simulated, name):
    """θ stands still where it is told to walk by a half in a second: e² is a third of S."""
    loop = simulated(20.0, seed=14)
    filter_ = make(name, nominal, walk=0.5)
    filter_.run(loop.u, loop.y)
    e, variance = filter_.innovations[2000:].T
    assert np.mean(e**2 / variance) < 0.6
    assert 0.08 < deviation(filter_) < 0.13


def test_what_comes_from_parameters_that_walk_is_no_noise(nominal, loop, by_hand):
    y, _ = walking_axis(by_hand, nominal, np.random.default_rng(0), loop.u[:4000], 0.05)
    filter_ = make("ekf", nominal, walk=0.05, spread=0.01)
    filter_.run(loop.u[:4000], y)
    assert np.std(filter_.innovations[1000:, 0]) > 0.12
    assert 0.09 < deviation(filter_) < 0.11


@pytest.mark.parametrize("name", JOINT)
def test_noise_is_known_soon_though_the_start_was_rough(nominal, simulated, name):
    """R begins at some 10 000 times what it is; a mean over 2 s takes 20 s from there."""
    loop = simulated(7.0, seed=15, sigma=0.01)
    filter_ = make(name, nominal, start=1.2)
    filter_.run(loop.u, loop.y)
    assert deviation(filter_) < 0.014


@pytest.mark.parametrize("name", JOINT)
def test_noise_that_grows_is_followed(nominal, simulated, name):
    loop = simulated(30.0, seed=9)
    more = np.random.default_rng(0).standard_normal(len(loop.u)) * 0.5
    more[: len(more) // 2] = 0.0
    filter_ = make(name, nominal)
    filter_.run(loop.u, loop.y + more)
    assert 0.45 < deviation(filter_) < 0.57  # √(.1² + .5²) = .51


@pytest.mark.parametrize("name", ["ekf", pytest.param("imm", marks=pytest.mark.slow)])
def test_with_its_noise_found_a_filter_is_as_fast_as_with_it_given(nominal, simulated, name):
    """Through an encoder of 16 bits; 0.1 in place of 0.0078 takes the EKF six times as long."""
    loop = simulated(15.0, seed=10, sigma=0.0, faults={10.0: nominal | {"f_m": 0.075}})
    y, lag = encoder(loop), {}
    for noise in (None, 0.0078):
        filter_ = make(name, nominal, output="increment", noise=noise)
        theta = filter_.run(loop.u, y)
        lag[noise] = T * abs(theta[2000:, 2] - 0.075).sum() / 0.025
    assert lag[None] < 1.3 * lag[0.0078]


# What is claimed


@pytest.mark.parametrize("name", JOINT)
def test_innovations_are_what_they_are_claimed_to_be(nominal, loop, name):
    filter_ = make(name, nominal)
    filter_.run(loop.u[:4000], loop.y[:4000])
    filter_.run(loop.u[4000:], loop.y[4000:])
    e, variance = filter_.innovations.T
    # 8000 samples: mean of e²/S known to 1.6 %; the joint filters' R is 1 to 2 % low
    np.testing.assert_allclose(np.mean(e**2 / variance), 1.0, atol=0.06)
    white = e / np.sqrt(variance)
    for delay in (1, 2, 5, 20):
        assert abs(np.mean(white[delay:] * white[:-delay])) < 0.04  # 3.5 standard deviations
    assert filter_.innovation == pytest.approx(loop.y[-1] - filter_.prediction, rel=1e-12)
    assert filter_.innovation_variance == variance[-1]


def walking_axis(by_hand, nominal, rng, u, walk):
    """y of an axis whose θ walks, and θ; a step of the walk in every tenth sample."""
    theta, x = TRUTH.copy(), np.zeros(6)
    y, true = np.empty(len(u)), np.empty((len(u), 3))
    for k, torque in enumerate(u):
        if k % 10 == 0:
            theta = theta + walk * TRUTH * np.sqrt(10 * T) * rng.standard_normal(3)
            A, B = by_hand(nominal | {"k_T": theta[0], "J_a": 1 / theta[1], "f_m": theta[2]})
            step = held(A, B, T)
        y[k], true[k] = x[2] + 0.1 * rng.standard_normal(), theta
        x = step @ np.r_[x, torque]
    return y, true


def test_an_axis_that_walks_as_it_is_told_to_is_where_the_filter_says(nominal, loop, by_hand):
    """Mean of (θ̂−θ)ᵀP⁻¹(θ̂−θ) is p; of an axis that stands still it is p/2."""
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        u = loop.u[400 * seed : 400 * seed + 4000]
        y, true = walking_axis(by_hand, nominal, rng, u, 0.005)
        filter_ = make("ekf", nominal, walk=0.005, spread=0.01)
        for k in range(0, 4000, 200):
            filter_.run(u[k : k + 200], y[k : k + 200])
            apart = filter_.theta - true[k + 199]
            if k >= 1000:
                found.append(apart @ np.linalg.solve(filter_.covariance, apart))
    # 12 runs of 15 s, correlated over half a second: some 300 values of variance 6
    np.testing.assert_allclose(np.mean(found), 3.0, rtol=0.15)


# x(0), and the ceiling


def build(name, model, **options):
    """The class itself, with θ practically known."""
    design = make_design(
        model, P0=(1e-7 * TRUTH) ** 2, drift=(1e-12 * TRUTH) ** 2, period=T, **options
    )
    kind = {"ekf": joint_ekf, "imm": partial(joint_imm, jump=1e-20 * TRUTH)}
    return kind[name](design)


@pytest.mark.parametrize("name", JOINT)
def test_a_state_that_is_given_is_where_it_starts(nominal, by_hand, name):
    """With θ known, ŷ is that of a Kalman filter for x alone, written out."""
    rng, N, sigma = np.random.default_rng(13), 400, 0.1
    A, B = (part[:5] for part in by_hand(nominal))
    step = held(A[:, :5], B, T)
    root = rng.standard_normal((5, 5)) * np.array([2e-3, 2e-3, 3.0, 0.03, 0.03])[:, None]
    x0 = np.array([1e-3, -1e-3, 4.0, 0.02, -0.01])
    u, y = rng.standard_normal(N), np.empty(N)
    x = x0 + root @ rng.standard_normal(5)
    for k in range(N):
        y[k] = x[2] + sigma * rng.standard_normal()
        x = step @ np.r_[x, u[k]]
    model = three_mass(nominal)
    filter_ = build(name, model, noise=sigma, x0=x0, x0_covariance=root @ root.T)
    filter_.run(u, y)
    x, P, expected = x0, root @ root.T, np.empty((N, 2))
    for k in range(N):
        S = P[2, 2] + sigma**2
        expected[k] = y[k] - x[2], S
        x, P = x + P[:, 2] * (y[k] - x[2]) / S, P - np.outer(P[:, 2], P[2]) / S
        x, P = step @ np.r_[x, u[k]], step[:, :5] @ P @ step[:, :5].T
    np.testing.assert_allclose(filter_.innovations[:, 0], expected[:, 0], rtol=0, atol=2e-5)
    np.testing.assert_allclose(filter_.innovations[:, 1], expected[:, 1], rtol=1e-4)


@pytest.mark.parametrize("name", JOINT)
def test_a_state_need_not_name_what_a_sample_resets(nominal, loop, name):
    options = {"output": "increment", "x0": np.zeros(5), "x0_covariance": np.full(5, 1e-6)}
    theta = build(name, three_mass(nominal), **options).run(loop.u[:500], loop.increment[:500])
    assert np.isfinite(theta).all()


@pytest.mark.parametrize("name", JOINT)
def test_no_parameter_is_less_certain_than_by_its_size(nominal, loop, name):
    """The walk alone would take it to 2 θ(0) in the gap; correlations are those before."""
    filter_ = make(name, nominal, walk=0.4)
    filter_.run(loop.u[:2000], loop.y[:2000])
    filter_.run(np.zeros(5000), np.zeros(5000), np.zeros(5000, bool))
    spread = np.sqrt(np.diag(filter_.covariance)) / TRUTH
    np.testing.assert_allclose(spread, 1.0, rtol=0.01)
    assert np.linalg.eigvalsh(filter_.covariance / np.outer(TRUTH, TRUTH))[0] > 0


@pytest.mark.parametrize("name", JOINT)
def test_until_it_acts_the_ceiling_is_not_there(nominal, loop, name):
    bounded, free = make(name, nominal), make(name, nominal)
    free.state["ceiling"] = np.inf
    expected = free.run(loop.u[:3000], loop.y[:3000])
    np.testing.assert_array_equal(bounded.run(loop.u[:3000], loop.y[:3000]), expected)


# Options


@pytest.mark.parametrize("name", JOINT)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"noise": 0.0}, "noise is 0.0"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"noise": np.nan}, "noise is nan"),
        ({"x0": [1.0]}, "x0 is"),
        ({"x0": np.full(5, np.nan)}, "x0 is"),
        ({"x0_covariance": [1.0]}, "x0_covariance has the shape"),
        ({"x0_covariance": np.full(5, -1.0)}, "x0_covariance must be"),
        ({"x0_covariance": np.full(5, np.inf)}, "x0_covariance must be"),
        ({"x0_covariance": np.arange(25.0).reshape(5, 5)}, "x0_covariance must be"),
    ],
)
def test_wrong_options(nominal, name, options, words):
    with pytest.raises(EstimatorError, match=words):
        build(name, three_mass(nominal), **options)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("ekf", {"walk": 0.0}, "walk is 0.0"),
        ("imm", {"hold": 0.0}, "hold is 0.0"),
    ],
)
def test_wrong_settings(nominal, name, options, words):
    with pytest.raises(EstimatorError, match=words):
        make(name, nominal, **options)


def test_a_jump_does_not_depend_on_the_rate(nominal):
    """What θ gains while a mode holds has one variance, however many samples that takes."""
    gained = [
        make("imm", nominal, period=period, jump=0.2, hold=0.05).state["drift"][1, 0, 0]
        * 0.05 / period
        for period in (0.001, 0.005, 0.01)
    ]  # fmt: skip
    np.testing.assert_allclose(gained, 0.2**2, rtol=1e-3)
    walked = [
        make("ekf", nominal, period=period, walk=0.01).state["drift"][0, 0] / period
        for period in (0.001, 0.005, 0.01)
    ]
    np.testing.assert_allclose(walked, 0.01**2)  # a second's


@pytest.mark.parametrize("name", JOINT)
def test_the_memory_of_the_noise_is_in_seconds(nominal, name):
    for period in (0.001, 0.002, 0.005, 0.01):
        memory = np.max(make(name, nominal, period=period).state["memory"])
        assert memory * period == pytest.approx(2.0)
