"""Estimators that read an encoder: gaps, blocks, restarts and an offset change no estimate."""

import numpy as np
import pytest
from acceptance.axes import AXES, NAMES, simulate, theta_of
from acceptance.measures import nominal_torque

from flexaxis.estimators.registry import REGISTRY

COUNT = 2 * np.pi / 65536
ESTIMATORS = ["rpem-forgetting", "ekf", "imm", pytest.param("glr", marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def run():
    return simulate(AXES["n1"], 20.0)


@pytest.fixture(scope="module")
def y(run):
    return COUNT * np.round(run.angle / COUNT)


def made(name):
    torque = nominal_torque("n1", 0.005)
    options = {"identify": NAMES, "output": "angle", "torque": torque}
    return REGISTRY[name].factory(AXES["n1"], 0.005, **options)


@pytest.fixture(scope="module", params=ESTIMATORS)
def estimator(request):
    return made(request.param)


@pytest.fixture(scope="module")
def whole(estimator, run, y):
    """Estimates (N, p) without a disturbance, and their standard deviations at the end."""
    estimator.reset()
    theta = estimator.run(run.u, y)
    return theta, np.sqrt(np.diag(estimator.covariance)[:3])


def test_the_truth_is_estimated(whole):
    theta, deviation = whole
    truth = theta_of(AXES["n1"])
    # the claims of a fading memory are a mean over seconds: 5 sd, and 0.2 % for what rounds
    assert (abs(theta[-1, :3] - truth) < 5 * deviation + 2e-3 * truth).all()


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_blocks_and_a_restart(estimator, whole, run, y, size):
    estimator.reset()
    parts = range(0, 3000, size)
    theta = np.vstack([estimator.run(run.u[k : k + size], y[k : k + size]) for k in parts])
    np.testing.assert_array_equal(theta[:3000], whole[0][:3000])


def test_an_offset(estimator, whole, run, y):
    """An angle of 1e6 rad is rounded to 1.2e-10 rad, 4e-6 of the noise of the encoder."""
    estimator.reset()
    theta = estimator.run(run.u, y + 1e6)
    assert (abs(theta - whole[0])[-1, :3] < 1e-3 * whole[1]).all()


@pytest.mark.parametrize("gap", [1, 20, 400])
def test_a_gap(estimator, whole, run, y, gap):
    """What is lost is information: estimates differ by what they claim, within 4 sd."""
    estimator.reset()
    valid = np.ones(len(y), bool)
    valid[2000 : 2000 + gap] = False
    theta = estimator.run(run.u, np.where(valid, y, 0.0), valid)
    e, S = estimator.innovations.T
    assert np.isnan(e[2000 : 2000 + gap]).all()
    after = slice(2000 + gap + 1, 2000 + gap + 100)
    assert np.mean(e[after] ** 2 / S[after]) < 1.5  # of 99 samples, ± .14
    deviation = np.sqrt(np.diag(estimator.covariance)[:3])
    assert (abs(theta[-1, :3] - whole[0][-1, :3]) < 4 * deviation).all()


def test_a_stuck_encoder_costs_no_more_than_a_new_start(estimator, run, y):
    estimator.reset()
    stuck = y.copy()
    stuck[500:1000] = y[500]
    theta = estimator.run(run.u, stuck)[-1, :3]
    np.testing.assert_allclose(theta, theta_of(AXES["n1"]), rtol=0.02)


@pytest.mark.parametrize("name", ["ekf", "imm"])
@pytest.mark.parametrize("missing", [0.05, 0.2])
def test_torque_noise_is_learnt(name, missing, run, y):
    """The innovations have the claimed variance if the given torque lacks white noise [N m]."""
    estimator = made(name)
    estimator.run(run.u - missing * np.random.default_rng(0).standard_normal(len(y)), y)
    e, S = estimator.innovations[2000:].T
    assert 0.7 < np.mean(e**2 / S) < 1.4
