"""A model along a record: derivatives by everything that is open, and friction that reverses."""

from dataclasses import replace

import numpy as np
import pytest
from acceptance.differences import central

from flexaxis.estimators.models.axes import BRISTLES, STATIC, one_mass, two_mass
from flexaxis.estimators.offline.delay import delayed
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.trajectory import course

PERIOD = 0.002
VALUES = {"k_T": 1.0, "J_m": 4e-3, "J_l": 6e-3, "k": 60.0, "d": 0.05, "f_m": 0.02, "f_l": 0.005}
LAWS = {
    "none": (two_mass(VALUES), ()),
    "bristles": (
        replace(
            two_mass(VALUES | {"f_c": 0.2, "f_s": 0.1, "v_s": 1.0, "sigma_0": 50.0}),
            laws=(replace(BRISTLES, parameters=dict(list(BRISTLES.parameters.items())[:4])),),
        ),
        ("f_c", "f_s", "v_s", "sigma_0"),
    ),
    "static": (
        replace(
            two_mass(VALUES | {"f_c": 0.2, "f_s": 0.1, "alpha": 2.0, "beta": 3.0}),
            laws=(STATIC,),
        ),
        ("f_c", "f_s", "alpha", "beta"),
    ),
}


def torque(samples=1500, seed=0):
    """Return a smooth random torque."""
    raw = np.random.default_rng(seed).standard_normal(samples + 100)
    return 3 * np.convolve(raw, np.ones(100) / 10, "valid")[:samples]


@pytest.mark.parametrize("output", ["speed", "increment"])
@pytest.mark.parametrize("which", LAWS)
def test_derivatives_are_those_of_finite_differences(which, output):
    model, lawful = LAWS[which]
    names = ("J_m", "J_l", "k", "d", "f_m", *lawful)
    along = course(model, names, torque(), period=PERIOD, output=output, resting=False)
    z = np.r_[along.model.theta, np.full(along.q - len(names) - 2, 1e-3), 0.05, 0.3 * PERIOD]
    y, slopes = along.along(z)
    assert np.isfinite(y).all()
    expected = central(lambda there: along.along(there)[0], z, 1e-6)
    for i, (slope, difference) in enumerate(zip(slopes, expected, strict=True)):
        # rounding of y over the step, and where a gradient is steep what friction does in one
        assert np.linalg.norm(difference - slope) < 1e-3 * np.linalg.norm(difference), i


def test_without_anything_open_it_is_the_predictor():
    model, names = two_mass(VALUES), ("J_m", "k")
    along = course(model, names, torque(), period=PERIOD)
    y, slopes = along.along(np.r_[along.model.theta, 0.0, 0.0])
    expected, psi = predict(model.parametrize(names), along.model.theta, torque(), period=PERIOD)
    np.testing.assert_allclose(y, expected, rtol=0, atol=1e-10 * abs(expected).max())
    assert np.all(np.abs(slopes[:2].T - psi) < 1e-9 * abs(psi).max(axis=0))


def test_a_motor_reverses_as_a_textbook_loop_does():
    """Stick and slip under a slow sine that is twice Coulomb's torque, against tiny steps."""
    J, f_m, f_c, steps = 1e-3, 5e-3, 0.1, 400
    u = 0.2 * np.sin(2 * np.pi * 3 * PERIOD * np.arange(1000))
    v, exact = 0.0, np.zeros(len(u))
    for k, held in enumerate(u[:-1]):
        for _ in range(steps):
            free = v + PERIOD / steps * (held - f_m * v) / J
            v = free - np.clip(free, -f_c * PERIOD / steps / J, f_c * PERIOD / steps / J)
        exact[k + 1] = v
    law = replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 1e5})
    model = replace(one_mass({"k_T": 1.0, "J_m": J, "f_m": f_m, "f_c": f_c}), laws=(law,))
    along = course(model, ("f_c",), u, period=PERIOD)
    fine, _ = along.along(np.array([f_c, 0.0, 0.0]))
    coarse, _ = along.along(np.array([f_c, 0.0, 0.0]), coarse=True)
    # bristles that are caught swing by f_c/√(σ₀ J) = .01 rad/s; and 2 f_c/J in a step of T/16
    assert np.abs(fine - exact).max() < 0.02
    assert np.abs(coarse - exact).max() < 0.03


def gapped(*begins):
    """A course of two masses whose stretches begin at these samples, and unknowns."""
    model, names = two_mass(VALUES), ("J_m", "J_l", "k", "d", "f_m", "f_l")
    along = course(model, names, torque(400), period=PERIOD, resting=False, begins=begins)
    states = np.full(along.q - len(names) - 2, 1e-3) * (1 + np.arange(len(begins))).repeat(3)
    return along, np.r_[along.model.theta, states, 0.01, 0.3 * PERIOD]


def test_a_course_may_begin_late():
    late, z = gapped(100)
    y, slopes = late.along(z)
    assert np.all(y[:101] == 0) and np.all(slopes[:, :101] == 0)
    shifted, _ = gapped(0)
    shifted = replace(shifted, u=delayed(late.u, 0.3)[100:])
    expected, _ = shifted.along(np.r_[z[:-1], 0.0])
    np.testing.assert_allclose(y[100:], expected, atol=1e-9)


def test_a_course_begins_anew_behind_a_gap():
    """From the states that it has there it goes on as it would have, whatever is in the gap."""
    both, z = gapped(100, 220)
    y, slopes = both.along(z)
    for begin, end, place in zip((100, 220), (220, None), both.states, strict=True):
        alone, _ = gapped(begin)
        expected, derivatives = alone.along(np.r_[z[:6], z[place], z[-2:]])
        here = slice(begin + 1, end)
        np.testing.assert_array_equal(y[here], expected[here])
        np.testing.assert_array_equal(slopes[place, here], derivatives[alone.states[0], here])
        others = np.ones(both.q, bool)
        others[np.r_[:6, place, both.q - 2 : both.q]] = False
        assert not slopes[others, here].any()
