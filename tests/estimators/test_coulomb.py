"""Coulomb friction by its events: against tiny steps, finite differences, and what sticks."""

from dataclasses import replace

import numpy as np
import pytest
from acceptance.differences import central
from scipy.linalg import expm

from flexaxis.estimators.models.axes import BRISTLES, STATIC, one_mass, two_mass
from flexaxis.estimators.offline.coulomb import is_dry
from flexaxis.estimators.offline.delay import delayed
from flexaxis.estimators.offline.trajectory import course

PERIOD, LATE = 0.002, 0.3
HARD = replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 1e6})
ONE = {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3, "f_c": 0.1}
TWO = {
    "k_T": 1.0, "J_m": 4e-3, "J_l": 6e-3, "k": 60.0, "d": 0.05, "f_m": 0.02, "f_l": 0.005,
    "f_c": 0.2,
}  # fmt: skip
AXES = {
    "one mass": (replace(one_mass(ONE), laws=(HARD,)), ("J_m", "f_m", "f_c"), 0.3),
    "two masses": (
        replace(two_mass(TWO), laws=(HARD,)),
        ("J_m", "J_l", "k", "d", "f_m", "f_l", "f_c"),
        1.0,
    ),
}


def torque(size, samples=1000):
    """Return a torque that reverses an axis often, and not evenly."""
    t = PERIOD * np.arange(samples)
    return size * (np.sin(2 * np.pi * 8 * t) + np.sin(2 * np.pi * 13.7 * t + 1))


def along_with(which, output="speed", **options):
    """Return a course and unknowns: moving at first, with an offset, late."""
    model, names, size = AXES[which]
    found = course(
        model, names, torque(size), period=PERIOD, output=output, resting=False, **options
    )
    z = np.r_[found.model.theta, np.full(found.q - len(names) - 2, 1e-3), 0.01, LATE * PERIOD]
    return found, z


def tiny_steps(along, z, often=400):
    """Return the speed (N,) by steps that take friction as what stops the motor, or all of it."""
    P, n = along.model.blocks(z[: along.p])[0], along.model.n
    step = expm(np.vstack([P[:n], np.zeros((1, n + 1))]) * along.period / often)
    motor, f_c = int(np.argmax(along.model.laws.drive[0])), z[along.p - 1]
    u, x = delayed(along.u, z[-1] / along.period), np.zeros(n)
    friction, step[:n, n - 1] = step[:n, n - 1].copy(), 0.0
    x[[*along.free, along.offset]] = z[along.p : -1]
    v = np.zeros(len(u))
    for k in range(len(u) - 1):
        for _ in range(often):
            x = step[:n, :n] @ x + step[:n, n] * u[k]
            x = x + friction * np.clip(-x[motor] / friction[motor], -f_c, f_c)
        v[k + 1] = x[motor]
    return v


@pytest.mark.parametrize("which", AXES)
def test_reversals_are_where_tiny_steps_have_them(which):
    along, z = along_with(which)
    along = replace(along, u=along.u[:300])
    assert along.dry
    y, _ = along.along(z)
    expected = tiny_steps(along, z)
    assert np.sum(np.diff(np.sign(expected)) != 0) >= 8
    # a step is late by at most itself where friction turns, and by no more where it lets go
    turning = 2 * z[along.p - 1] / z[0] * PERIOD / 400
    assert np.abs(y - expected).max() < 3 * turning


@pytest.mark.parametrize("output", ["speed", "increment"])
@pytest.mark.parametrize("which", AXES)
def test_derivatives_are_those_of_finite_differences(which, output):
    along, z = along_with(which, output)
    _, slopes = along.along(z)
    expected = central(lambda there: along.along(there)[0], z, 1e-6)
    for i, (slope, difference) in enumerate(zip(slopes, expected, strict=True)):
        # rounding of y over the step
        assert np.linalg.norm(difference - slope) <= 2e-4 * np.linalg.norm(difference), i


def test_what_friction_holds_does_not_move():
    model, names, _ = AXES["one mass"]
    u = np.r_[0.09 * np.ones(50), 0.2 * np.ones(50)]
    y, slopes = course(model, names, u, period=PERIOD).along(np.r_[1e-3, 5e-3, 0.1, 0.0, 0.0])
    assert np.all(y[:51] == 0) and np.all(slopes[:, :51] == 0)
    # from then on f_c and the torque act as one
    expected = 0.1 / 5e-3 * (1 - np.exp(-5 * PERIOD * np.arange(1, 50)))
    np.testing.assert_allclose(y[51:], expected, rtol=1e-9)
    np.testing.assert_allclose(slopes[2, 51:], -expected / 0.1, rtol=1e-9)


def test_what_is_dry():
    model, names, _ = AXES["one mass"]

    def answer(law, values=ONE):
        return is_dry(replace(one_mass(values), laws=(law,)).parametrize(("J_m",)), PERIOD)

    assert answer(HARD)
    soft = replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 100.0})
    assert not answer(soft)  # swings in .3 rad a sample: the log can show that
    assert not answer(replace(HARD, parameters=dict(HARD.parameters) | {"breakaway": 0.1}))
    assert not answer(replace(HARD, parameters=dict(HARD.parameters) | {"damping": 0.1}))
    assert not answer(replace(STATIC, parameters={"coulomb": "f_c", "beta": 50.0}))
    assert not is_dry(one_mass(ONE | {}).parametrize(("J_m",)), PERIOD)
    assert names[-1] == "f_c" and not is_dry(model.parametrize(names), PERIOD / 100)


@pytest.mark.parametrize("rubs", [True, False])
def test_a_course_may_begin_late(rubs):
    whole, z = along_with("two masses")
    if not rubs:
        model = replace(AXES["two masses"][0], laws=())
        names = [name for name in TWO if name not in ("k_T", "f_c")]
        whole = course(model, names, whole.u, period=PERIOD, resting=False)
        z = np.r_[whole.model.theta, 1e-3, 1e-3, 1e-3, 0.01, LATE * PERIOD]
    late = replace(whole, begins=(100,))
    y, slopes = late.along(z)
    assert np.all(y[:101] == 0) and np.all(slopes[:, :101] == 0)
    shifted = replace(whole, u=delayed(whole.u, LATE)[100:])
    expected, _ = shifted.along(np.r_[z[:-1], 0.0])
    np.testing.assert_allclose(y[100:], expected, atol=1e-9)


def test_a_course_begins_anew_behind_a_gap():
    """From the states that it has there it goes on as it would have, whatever is in the gap."""
    whole, z = along_with("two masses")
    states = []
    for begin in (100, 220):
        part = replace(whole, begins=(begin,))
        states.append(z[part.states[0]] + 0.1 * begin * 1e-3)
    gapped = replace(whole, begins=(100, 220))
    p = whole.p + whole.m
    y, slopes = gapped.along(np.r_[z[:p], *states, z[-2:]])
    for state, begin, end, place in zip(
        states, (100, 220), (220, None), gapped.states, strict=True
    ):
        alone = replace(whole, begins=(begin,))
        expected, derivatives = alone.along(np.r_[z[:p], state, z[-2:]])
        here = slice(begin + 1, end)
        np.testing.assert_array_equal(y[here], expected[here])
        np.testing.assert_array_equal(slopes[place, here], derivatives[alone.states[0], here])
        np.testing.assert_array_equal(slopes[:p, here], derivatives[:p, here])
        others = np.ones(gapped.q, bool)
        others[np.r_[:p, place, gapped.q - 2 : gapped.q]] = False
        assert not slopes[others, here].any()
