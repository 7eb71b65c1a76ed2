"""What an axis has and the model has not is said, where the noise model would hide it."""

import numpy as np
import pytest

from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.verdict import judge
from flexaxis.sim.record import Record

T, N, STEPS = 0.004, 2500, 40
TWO = {"k_T": 1.0, "J_m": 0.01, "J_l": 0.02, "k": 300.0, "d": 0.1, "f_m": 0.05, "f_l": 0.02}
ONE = {"k_T": 1.0, "J_m": 0.01, "f_m": 0.05}


def multisine(rng, low=0.2, high=40.0):
    lines = np.unique(np.round(np.geomspace(low, high, 60) * N * T)) / (N * T)
    t = T * np.arange(N)
    x = sum(np.cos(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f in lines)
    return x / np.std(x)


def two_masses(u, f_c=0.0, gap=0.0):
    """Return the angle of the motor, with dry friction of the load, or a gap in the spring."""
    q, h = TWO, T / STEPS
    motor = speed = load = turned = 0.0
    angle = np.zeros(N)
    for i in range(N):
        angle[i] = motor
        for _ in range(STEPS):
            bent = motor - turned
            bent = np.sign(bent) * max(abs(bent) - gap, 0.0) if gap else bent
            spring = q["k"] * bent + (q["d"] * (speed - load) if bent else 0.0)
            speed += h / q["J_m"] * (u[i] - spring - q["f_m"] * speed)
            load += h / q["J_l"] * (spring - q["f_l"] * load)
            load = np.sign(load) * max(abs(load) - h / q["J_l"] * f_c, 0.0) if f_c else load
            turned, motor = turned + h * load, motor + h * speed
    return angle


def one_mass(u, gravity=0.0):
    angle, speed, h, found = 0.0, 0.0, T / STEPS, np.zeros(N)
    for i in range(N):
        found[i] = angle
        for _ in range(STEPS):
            speed += h / ONE["J_m"] * (u[i] - ONE["f_m"] * speed - gravity * np.sin(angle))
            angle += h * speed
    return found


def logged(u, angle):
    return Record(
        time=T * np.arange(N), torque=u, angle=angle, increment=np.diff(angle, prepend=0.0) / T
    )


def said(u, angle, values, *, noise, smooth=False):
    """Return the verdict on a fit from the true values."""
    record = logged(u, angle + noise * np.random.default_rng(100).standard_normal(N))
    axis = find_axis("two_mass" if "k" in values else "one_mass").having(values)
    names = tuple(name for name in values if name not in {"k_T", "f_m"})
    log = log_of(record, axis)
    attempt = Attempt(log.smoothed() if smooth else log, axis.model, names)
    fitted = attempt.solve()
    return judge(attempt, fitted, fitted.deviations, seen=None, tried=(), word="none")


@pytest.fixture(scope="module")
def u():
    return multisine(np.random.default_rng(3))


@pytest.mark.parametrize(
    "off, text", [({"f_c": 0.2}, "dry friction at load"), ({"gap": 0.003}, "backlash")]
)
def test_what_two_masses_have_and_the_model_has_not_is_named(u, off, text):
    warnings = said(u, two_masses(u, **off), TWO, noise=1e-5).warnings
    assert any(text in warning for warning in warnings), warnings


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-3])
def test_a_healthy_axis_has_nothing_left_out(u, noise):
    warnings = said(u, two_masses(u), TWO, noise=noise).warnings
    assert not any("the axis has what" in warning for warning in warnings), warnings


def test_gravity_is_named():
    u = multisine(np.random.default_rng(5), 0.1, 20.0)
    warnings = said(u, one_mass(u, 0.5), ONE, noise=1e-5).warnings
    assert any("angle, such as gravity" in warning for warning in warnings), warnings


def test_a_held_torque_that_is_logged_a_sample_late_is_no_smooth_one(u):
    angle = one_mass(u)
    verdict = said(np.r_[0.0, u[:-1]], angle, ONE, noise=1e-5, smooth=True)
    assert any("before it is logged" in warning for warning in verdict.warnings)
    assert not any("smooth, measured" in remark for remark in verdict.remarks)
    assert not any("before it" in warning for warning in said(u, angle, ONE, noise=1e-5).warnings)


@pytest.fixture(scope="module")
def record(u):
    return logged(u, one_mass(u))


@pytest.mark.parametrize("delay", [-1.0, 5.0, float("nan"), float("inf")])
def test_a_delay_that_cannot_be_is_refused_with_those_that_can(record, delay):
    with pytest.raises(LogError, match=r"acts 0 … 0\.016 s after"):
        identify(record, find_axis("one_mass"), delay=delay)


@pytest.mark.parametrize("values", [{"f_m": 1e300}, {"k_T": 1e300}, {"J_m": 1e-300}])
def test_a_start_that_cannot_be_computed_with_is_refused(record, values):
    with pytest.raises(LogError, match="no axis has that"):
        identify(record, find_axis("one_mass").having(values))


def test_the_least_delay_is_no_estimate(record):
    found = identify(record, find_axis("one_mass").having(ONE), friction="none")
    assert found.delay == 0.0 and found.delay_deviation == 0.0
    assert any("least that a held torque can have" in text for text in found.remarks)


def test_a_fit_that_went_astray_blames_no_rate():
    """At 250 Hz nothing is seen of a mode at 400 Hz: what ended there says so, and what to do."""
    from flexaxis.experiments.logs.identify import _check_ended

    model = find_axis("two_mass").having(TWO).model
    _check_ended(model, T)
    stiff = find_axis("two_mass").having(TWO | {"k": 300.0 * 400}).model
    with pytest.raises(LogError, match=r"went astray.*--start"):
        _check_ended(stiff, T)
