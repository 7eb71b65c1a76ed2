"""What theory allows on the live axis, and how a change is followed: against closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexaxis.estimators import three_mass
from flexaxis.experiments.demo.live_axis import KINDS, Friction, LiveAxis
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.demo.tracking import LENGTH, Jump, Tracking, allowed
from flexaxis.sim.timing import PERIOD, rate

RATE = rate(PERIOD)


def speeds(theta, torque, x):
    """Motor speed of the linear model from a state on, by the exponential of the whole system."""
    k_T, inverse, f_m = theta
    nominal = LiveAxis().nominal.as_dict() | {"k_T": k_T, "J_a": 1 / inverse, "f_m": f_m}
    model = three_mass(nominal).parametrize(NAMES)
    A, B, _ = model.matrices(model.theta)
    whole = np.zeros((6, 6))
    whole[:5, :5], whole[:5, 5] = A, np.ravel(B)
    step = expm(whole * PERIOD)
    found = []
    for u in torque:
        found.append(x[2])
        x = step[:5, :5] @ x + step[:5, 5] * u
    return np.array(found)


@pytest.fixture(scope="module")
def jumped():
    """An axis whose f_m has doubled, the jump as the demo takes it down, and 150 samples since."""
    axis = LiveAxis(seed=5)
    axis.advance(4 * RATE)
    axis.set_factors({"f_m": 2.0})
    jump = Jump(axis.scenario, axis.values, "f_m", 0.05, axis.state, axis.noise)
    axis.noise = 0.0
    return jump, axis.advance(150)


def test_the_state_is_that_of_the_axis(jumped):
    """The model goes on from it as the engine does."""
    jump, samples = jumped
    expected = speeds([1.0, 1.25, 0.1], samples.torque, jump.state)
    np.testing.assert_allclose(samples.speed, expected, atol=2e-3 * np.std(samples.speed))


def test_the_bound_is_that_of_central_differences(jumped):
    """Cramér–Rao from ψ by differences of the output; prior of half the value, as in the scores."""
    jump, samples = jumped
    theta, torque = np.array([1.0, 1.25, 0.1]), samples.torque
    steps = 1e-5 * np.diag(theta)
    psi = np.stack(
        [
            (speeds(theta + h, torque, jump.state) - speeds(theta - h, torque, jump.state))
            / (2 * h.max())
            for h in steps
        ],
        axis=1,
    )
    prior = np.diag(1 / (theta / 2) ** 2)
    found = allowed(jump, torque)
    for n in (20, 80, 149):
        information = prior + psi[: n + 1].T @ psi[: n + 1] / jump.noise**2
        deviations = [information[2, 2] ** -0.5, np.linalg.inv(information)[2, 2] ** 0.5]
        expected = np.minimum(1.0, np.sqrt(2 / np.pi) * np.array(deviations) / jump.size)
        np.testing.assert_allclose(found.error[n], expected, rtol=1e-4)
    np.testing.assert_allclose(found.lag, found.error.sum(axis=0) * PERIOD)
    assert found.lag[0] < found.lag[1] < 0.1


def test_dry_friction_has_a_bound_too():
    axis = LiveAxis(seed=6)
    axis.advance(2 * RATE)
    axis.set_friction(Friction("Coulomb", f_c=0.1))
    jump = Jump(axis.scenario, axis.values, "f_c", 0.1, axis.state, axis.noise)
    found = allowed(jump, axis.advance(RATE).torque)
    assert 0.005 < found.lag[0] < found.lag[1] < 0.3


@pytest.fixture
def tracking():
    before, after = np.array([1.0, 1.25, 0.05, 0.0]), np.array([1.0, 1.25, 0.10, 0.0])
    return Tracking(before, after, 2)


def test_a_pursuit_has_the_lag_of_what_it_was_shown(tracking):
    """An exponential with a time constant of 1 s, and one who stays where he was."""
    decay = 0.05 * np.exp(-np.arange(1500) * PERIOD)
    slow = np.tile(tracking.after, (1500, 1))
    slow[:, 2] -= decay
    still = np.tile(tracking.before, (1500, 1))
    moving = np.ones(1500, bool)
    moving[100:200] = False  # a pause, in which the clock stands
    slow = np.concatenate([slow[:100], np.full((100, 4), 9.0), slow[100:1400]])
    tracking.take([slow, still], np.zeros(1500), moving)
    assert tracking.changed == "f_m" and tracking.size == pytest.approx(0.05)
    assert not tracking.open and len(tracking.error) == LENGTH
    assert tracking.lags == pytest.approx([1 - np.exp(-5), 5.0], rel=0.01)
    assert tracking.allowed is None, "no jump was told"
    tracking.take([slow, still], np.zeros(1500), moving)
    assert len(tracking.error) == LENGTH


@pytest.mark.parametrize("kind", KINDS[1:])
def test_friction_comes_while_the_axis_runs(kind):
    """Angles and speeds stay; then the motor pays for viscous and dry friction, and little else."""
    axis, other = LiveAxis(seed=7), LiveAxis(seed=7)
    axis.noise = other.noise = 0.0
    for each in (axis, other):
        each.advance(RATE)
    state = axis.state
    axis.set_friction(Friction(kind, f_c=0.05, f_s=0.1))
    np.testing.assert_array_equal(axis.state, state)
    axis.set_friction(Friction(kind, f_c=0.4, f_s=0.01))  # turned, where the other is made so
    other.set_friction(Friction(kind, f_c=0.4, f_s=0.01))
    found = axis.advance(2000)
    np.testing.assert_array_equal(found.speed, other.advance(2000).speed)
    between = (found.speed[1:] + found.speed[:-1]) / 2  # where a torque is held
    spent = np.mean(found.torque[:-1] * between) - 0.05 * np.mean(found.speed**2)
    assert 1.0 < spent / (0.4 * np.mean(np.abs(found.speed))) < 1.2
    axis.set_friction(Friction())
    assert axis.theta(SHOWN)[3] == 0.0
