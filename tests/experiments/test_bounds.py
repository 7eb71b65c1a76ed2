"""The bounds, met by an estimator that should meet them: by simulation, within its interval."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.models.discretisation import sampled_system
from flexaxis.estimators.signals import counted_angle
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import bounds
from flexaxis.sim.parameters import preset
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
NOMINAL = preset("n1").as_dict()
COUNT = 2 * np.pi / 65536


@pytest.fixture(scope="module")
def record():
    return simulate(find_scenario("fm_step-v1"), [0])[0]


def outputs(model, theta, u, x):
    """Output of the axis from the state x, by its own sampled matrices."""
    transition, gain, _ = sampled_system(model.parametrize(NAMES), theta, 0.005)
    A, b, y = transition[-len(x) :, -len(x) :], gain[-len(x) :], []
    for torque in u:
        y.append(x[2] if len(x) == 5 else x[5])
        x = A @ x + b * torque
    return np.array(y)


def white(shape, clean):
    return 0.1 * np.random.default_rng(0).standard_normal(shape)


def rounding(shape, clean):
    """Errors of an encoder that starts anywhere within a count."""
    angle = clean + COUNT * np.random.default_rng(0).random((shape[0], 1))
    return COUNT * np.round(angle / COUNT) - angle


@pytest.mark.parametrize(
    ("model", "noise", "variance"),
    [
        (three_mass(NOMINAL), white, 0.01),
        (counted_angle(three_mass(NOMINAL)), rounding, COUNT**2 / 12),
    ],
)
def test_an_oracle_fit_meets_the_cramer_rao_bound(record, model, noise, variance):
    """Least squares from the true state and time, 1000 runs of new noise."""
    theta, u, x = model.parametrize(NAMES).theta, record.torque[2000:2300], np.zeros(len(model.A))
    clean, chosen = outputs(model, theta, u, x), model.parametrize(NAMES)
    psi = bounds.jump_gradient(chosen, theta, u, x, period=0.005)
    C = bounds.cramer_rao(psi, variance, theta)[-1]
    found = []
    for e in noise((1000, 300), clean):
        guess = 1.01 * theta  # two steps of Gauss–Newton are enough from here
        for _ in range(2):
            slope = bounds.jump_gradient(chosen, guess, u, x, period=0.005)
            guess = guess + np.linalg.lstsq(slope, clean + e - outputs(model, guess, u, x))[0]
        found.append(guess)
    ratio = np.var(found, axis=0) / np.diag(C)
    # a variance from 1000 runs is known to ±4.5 %; the prior of the bound adds less than 1 %
    assert (abs(ratio - 1) < 0.1).all(), ratio


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


def test_what_has_to_be_learnt_lies_between_what_is_known_and_what_never_is(record):
    told = find_scenario("fm_step-v1")
    wrong = told.override({"known": {"k_g": 1.05, "J_m": 0.95}})
    after = 2000, 2400, record.torque
    known = bounds.jump_bound(told, NAMES, *after)
    np.testing.assert_allclose(known.learnt, known.unknown, rtol=1e-6)
    learnt = bounds.jump_bound(wrong, NAMES, *after).learnt
    never = bounds.jump_bound(wrong, (*NAMES, "J_m", "k_g"), *after).unknown[:, :3]
    assert (known.unknown[200:] < learnt[200:]).all() and (learnt[200:] < never[200:]).all()
