"""The bounds, met by an estimator that should meet them: by simulation, within its interval."""

import numpy as np
import pytest

from flexaxis.estimators.models.discretisation import sampled_system
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import bounds
from flexaxis.experiments.scoring.true_model import true_model
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
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


def white(clean):
    return 0.1 * np.random.default_rng(0).standard_normal((4000, len(clean)))


def rounding(clean):
    """Errors of an encoder on movements of sizes from 1 to 1.05."""
    angle = clean * (1 + 0.05 * np.random.default_rng(0).random((4000, 1)))
    return COUNT * np.round(angle / COUNT) - angle


@pytest.mark.parametrize(
    ("output", "noise", "variance"), [("speed", white, 0.01), ("angle", rounding, COUNT**2 / 12)]
)
def test_least_squares_meet_the_cramer_rao_bound(record, output, noise, variance):
    """From the true state and time, with slopes by differences; 4000 runs of new noise."""
    scenario = find_scenario("fm_step-v1").override({"output": output})
    model = true_model(scenario, scenario.unchanged)
    theta, u = model.parametrize(NAMES).theta, record.torque[2000:2300]
    x = bounds.state_at(scenario, scenario.true_parameters(), record.torque, 2000)
    slope = np.column_stack(
        [
            (outputs(model, theta + h, u, x) - outputs(model, theta - h, u, x)) / (2 * h.sum())
            for h in np.diag(1e-5 * theta)
        ]
    )
    errors = noise(outputs(model, theta, u, x)) @ np.linalg.pinv(slope).T
    psi = bounds.jump_gradient(model.parametrize(NAMES), theta, u, x, period=0.005)
    ratio = np.var(errors, axis=0) / np.diag(bounds.cramer_rao(psi, variance, theta)[-1])
    # a variance from 4000 runs is known to ±2.2 %; the prior of the bound adds less than 1 %
    assert (abs(ratio - 1) < 0.1).all(), ratio


def test_the_bound_of_one_unknown_parameter_is_that_of_a_model_of_this_parameter(record):
    scenario = find_scenario("fm_step-v1")
    u = record.torque
    both = bounds.jump_bound(scenario, NAMES, 2000, 3000, u)
    # who knows that it is f_m alone knows more, and what he knows is what a model of f_m has
    assert (both.single <= both.unknown + 1e-15).all()
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
