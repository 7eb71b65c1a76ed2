"""The bounds, met by an estimator that should meet them: by simulation, within its interval."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.models.discretisation import sampled_system
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import bounds
from flexaxis.sim.parameters import preset
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
NOMINAL = preset("n1").as_dict()


@pytest.fixture(scope="module")
def record():
    return simulate(find_scenario("fm_step-v1"), [0])[0]


def outputs(theta, u, x):
    """Speed of the axis from the state x, by its own sampled matrices."""
    model = three_mass(NOMINAL).parametrize(NAMES)
    transition, gain, _ = sampled_system(model, theta, 0.005)
    A, b, y = transition[-5:, -5:], gain[-5:], []
    for torque in u:
        y.append(x[2])
        x = A @ x + b * torque
    return np.array(y)


def test_an_oracle_fit_meets_the_cramer_rao_bound(record):
    """Least squares from the true state and time, 250 runs of new noise."""
    model = three_mass(NOMINAL).parametrize(NAMES)
    theta, u, x, n = model.theta, record.torque[2000:2300], np.zeros(5), 299
    clean, psi = outputs(theta, u, x), bounds.jump_gradient(model, theta, u, x, period=0.005)
    C = bounds.cramer_rao(psi, 0.01, theta)[n]
    noise = 0.1 * np.random.default_rng(0).standard_normal((250, 300))
    found = []
    start = 1.01 * theta  # two steps of Gauss–Newton are enough from here
    first = bounds.jump_gradient(model, start, u, x, period=0.005)
    for e in noise:
        guess = start + np.linalg.lstsq(first, clean + e - outputs(start, u, x))[0]
        slope = bounds.jump_gradient(model, guess, u, x, period=0.005)
        found.append(guess + np.linalg.lstsq(slope, clean + e - outputs(guess, u, x))[0])
    ratio = np.var(found, axis=0) / np.diag(C)
    # a variance from 250 runs is known to ±9 %; the prior of the bound adds less than 1 %
    assert (abs(ratio - 1) < 0.25).all(), ratio


def test_the_bound_of_a_scenario_uses_state_and_parameters_at_its_fault(record):
    scenario = find_scenario("fm_step-v1")
    u = record.torque
    both = bounds.jump_bound(scenario, NAMES, 2000, 3000, u)
    deviation = both.unknown
    assert deviation.shape == (1000, 3)
    # before anything is measured the prior: half of each parameter after the jump
    np.testing.assert_allclose(deviation[0], [0.5, 0.625, 0.0375], rtol=1e-9)
    assert (np.diff(deviation, axis=0) <= 1e-12).all()
    assert 0.02 < bounds.lag_bound(deviation[:, 2], 0.025, period=0.005) < 0.12
    # who knows that it is f_m alone knows more, and what he knows is what a model of f_m has
    assert (both.single <= deviation + 1e-15).all()
    alone = bounds.jump_bound(scenario, ["f_m"], 2000, 3000, u)
    np.testing.assert_allclose(both.single[:, 2], alone.unknown[:, 0], rtol=1e-12)
