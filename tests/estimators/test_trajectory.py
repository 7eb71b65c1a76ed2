"""A model along a record: against tiny steps, the predictor, differences; its stretches."""

from dataclasses import replace

import numpy as np
import pytest
from acceptance.differences import central
from scipy.linalg import expm

from flexaxis.estimators.models.axis_models import BRISTLES, STATIC, one_mass, two_mass
from flexaxis.estimators.offline.coulomb import is_dry
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.trajectory import Trajectory, delayed
from flexaxis.estimators.signals import SIGNALS

PERIOD, LATE = 0.002, 0.3
HARD = replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 1e6})
ONE = {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3}
TWO = {"k_T": 1.0, "J_m": 4e-3, "J_l": 6e-3, "k": 60.0, "d": 0.05, "f_m": 0.02, "f_l": 0.005}
BENT = {"f_c": 0.2, "f_s": 0.1, "alpha": 2.0, "beta": 3.0}
AXES = {
    "one mass": (replace(one_mass(ONE | {"f_c": 0.1}), laws=(HARD,)), 0.3),
    "two masses": (replace(two_mass(TWO | {"f_c": 0.2}), laws=(HARD,)), 1.0),
    "linear": (two_mass(TWO), 1.0),
    "static": (replace(two_mass(TWO | BENT), laws=(STATIC,)), 1.0),
}


def axis(which, output="speed", samples=500, **options):
    """Return a trajectory that reverses often, and unknowns: moving, offset, late."""
    model, size = AXES[which]
    t = PERIOD * np.arange(samples)
    u = size * (np.sin(2 * np.pi * 8 * t) + np.sin(2 * np.pi * 13.7 * t + 1))
    names = tuple(name for name in model.parameters if name != "k_T")
    model = SIGNALS[output].predicted(model, PERIOD).parametrize(names)
    result = Trajectory(model, u, PERIOD, **options)
    states = 1e-3 * (1 + np.arange(result.q - len(names) - 2))
    return result, np.r_[result.model.theta, states, 0.01, LATE * PERIOD]


@pytest.mark.parametrize("which", ["one mass", "two masses"])
def test_reversals_are_where_tiny_steps_have_them(which):
    """Steps take friction as what stops the motor, or all of it."""
    along, z = axis(which, samples=200)
    often, n, motor, f_c = 400, along.model.n, along.model.drive[0] != 0, z[along.p - 1]
    P = along.model.blocks(z[: along.p])[0]
    step = expm(np.vstack([P[:n], np.zeros((1, n + 1))]) * PERIOD / often)
    friction, x = step[:n, n - 1].copy(), np.zeros(n)
    step[:n, n - 1] = 0.0
    x[list(along.free)] = z[along.states[0]]
    motor = int(np.argmax(motor))
    expected = np.zeros(200)
    for k, u in enumerate(delayed(along.u, LATE)[:-1] + z[-2]):
        for _ in range(often):
            x = step[:n, :n] @ x + step[:n, n] * u
            x = x + friction * np.clip(-x[motor] / friction[motor], -f_c, f_c)
        expected[k + 1] = x[motor]
    y, _ = along.along(z)
    assert np.sum(np.diff(np.sign(expected)) != 0) >= 8
    # a step is late by at most itself where friction turns, and by no more where it lets go
    assert np.abs(y - expected).max() < 3 * 2 * f_c / z[0] * PERIOD / often


@pytest.mark.parametrize("output", ["speed", "increment"])
@pytest.mark.parametrize("which", AXES)
def test_derivatives_are_those_of_central_differences(which, output):
    along, z = axis(which, output)
    y, slopes = along.along(z)
    assert np.isfinite(y).all()
    expected = central(lambda moved: along.along(moved)[0], z, 1e-6)
    for i, (slope, difference) in enumerate(zip(slopes, expected, strict=True)):
        assert np.linalg.norm(difference - slope) <= 2e-3 * np.linalg.norm(difference), i
    held = np.arange(along.q) % 2 == 0
    _, some = along.along(z, held)
    assert not some[held].any()
    np.testing.assert_array_equal(some[~held], slopes[~held])


def test_what_friction_holds_does_not_move():
    model, _ = AXES["one mass"]
    u = np.r_[0.09 * np.ones(50), 0.2 * np.ones(50)]
    along = Trajectory(model.parametrize(("J_m", "f_m", "f_c")), u, PERIOD)
    y, slopes = along.along(np.r_[1e-3, 5e-3, 0.1, np.zeros(along.q - 3)])
    assert np.all(y[:51] == 0) and np.all(slopes[:, :51] == 0)
    # from then on f_c and the torque act as one
    expected = 0.1 / 5e-3 * (1 - np.exp(-5 * PERIOD * np.arange(1, 50)))
    np.testing.assert_allclose(y[51:], expected, rtol=1e-9)
    np.testing.assert_allclose(slopes[2, 51:], -expected / 0.1, rtol=1e-5)


def test_what_is_dry():
    def answer(law, period=PERIOD):
        model = replace(one_mass(ONE | {"f_c": 0.1}), laws=(law,) if law else ())
        return is_dry(model.parametrize(("J_m",)), period)

    assert answer(HARD) and not answer(HARD, PERIOD / 100) and not answer(None)
    for more in ({"stiffness": 100.0}, {"breakaway": 0.1}, {"damping": 0.1}):
        assert not answer(replace(HARD, parameters=dict(HARD.parameters) | more))
    assert not answer(replace(STATIC, parameters={"coulomb": "f_c", "beta": 50.0}))


def test_without_anything_open_it_is_the_predictor():
    along, z = axis("linear")
    z[along.p :] = 0.0
    y, slopes = along.along(z)
    expected, psi = predict(along.model, along.model.theta, along.u, period=PERIOD)
    np.testing.assert_allclose(y, expected, rtol=0, atol=1e-10 * abs(expected).max())
    assert np.all(np.abs(slopes[: along.p].T - psi) < 1e-5 * abs(psi).max(axis=0))


@pytest.mark.parametrize("which", ["two masses", "linear", "static"])
def test_stretches_begin_anew_behind_gaps(which):
    """From the states that it has there it goes on as it would have, whatever is in the gap."""
    both, z = axis(which, samples=400, begins=(100, 220))
    y, slopes = both.along(z)
    assert np.all(y[:101] == 0) and np.all(slopes[:, :101] == 0)
    for begin, end, place in zip((100, 220), (220, None), both.states, strict=True):
        alone, _ = axis(which, samples=400, begins=(begin,))
        expected, derivatives = alone.along(np.r_[z[: both.p], z[place], z[-2:]])
        here = slice(begin + 1, end)
        np.testing.assert_array_equal(y[here], expected[here])
        # a step of a difference is as large as its state, which a rounding shows
        np.testing.assert_allclose(slopes[place, here], derivatives[alone.states[0], here], 1e-9)
        np.testing.assert_array_equal(slopes[: both.p, here], derivatives[: both.p, here])
        others = np.ones(both.q, bool)
        others[np.r_[: both.p, place, both.q - 2 : both.q]] = False
        assert not slopes[others, here].any()
