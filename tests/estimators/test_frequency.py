"""G, G_θ and the information in a torque, against python-control, differences and time averages."""

import control
import numpy as np
from acceptance.differences import central
from scipy.signal import lfilter

from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.frequency import (
    fit_arx,
    frequency_response,
    information,
    line_spectrum,
)
from flexaxis.estimators.offline.predictor import predict

NAMES = ("k_T", "1/J_a", "f_m")
OMEGA = np.linspace(5.0, 600.0, 50)


def test_response_is_that_of_python_control(nominal, by_hand):
    A, B = by_hand(nominal)
    sampled = control.c2d(control.ss(A[:5, :5], B[:5, None], [0, 0, 1, 0, 0], 0), 0.005, "zoh")
    model = three_mass(nominal).parametrize(NAMES)
    response, _ = frequency_response(model, model.theta, OMEGA, period=0.005)
    expected = np.squeeze(control.frequency_response(sampled, OMEGA).complex)
    np.testing.assert_allclose(response, expected, rtol=1e-8)


def test_slope_is_the_derivative_of_the_response(nominal):
    model = three_mass(nominal).parametrize(NAMES)
    _, slopes = frequency_response(model, model.theta, OMEGA, period=0.005)
    expected = central(
        lambda theta: frequency_response(model, theta, OMEGA, period=0.005)[0], model.theta, 1e-5
    )
    for column, slope in zip(slopes.T, expected, strict=True):
        # a central difference: truncation 1e-10 × sharpness², rounding 1e-11
        assert np.abs(column - slope).max() < 1e-6 * np.abs(slope).max()


def test_information_is_the_time_average(nominal):
    """Eq. (28) and (31) on a torque of period 2 s, after its transient."""
    rng = np.random.default_rng(0)
    lines = np.zeros(201, complex)
    lines[1:60] = np.exp(2j * np.pi * rng.random(59))
    period = np.fft.irfft(lines)
    model = three_mass(nominal).parametrize(NAMES)
    _, psi = predict(model, model.theta, np.tile(period, 20), period=0.005)
    Q = information(model, model.theta, *line_spectrum(period, period=0.005), period=0.005)
    # what is left of the transient after 36 s is far below
    np.testing.assert_allclose(psi[-400:].T @ psi[-400:] / 400, Q, rtol=1e-6, atol=1e-9)


A, B = np.array([1.0, -1.5, 0.7]), np.array([0.0, 1.0, 0.5])


def test_finds_the_coefficients_of_a_noiseless_record():
    u = np.random.default_rng(0).standard_normal(500)
    a, b = fit_arx(u, lfilter(B, A, u), order=2)
    np.testing.assert_allclose(a, A, atol=1e-10)
    np.testing.assert_allclose(b, B, atol=1e-10)


def test_is_consistent_for_equation_noise():
    rng = np.random.default_rng(1)
    u, e = rng.standard_normal((2, 20000))
    a, b = fit_arx(u, lfilter(B, A, u) + lfilter([1], A, 0.1 * e), order=2)
    # least squares: standard deviations of 0.1/√20000 and less
    np.testing.assert_allclose(a, A, atol=4e-3)
    np.testing.assert_allclose(b, B, atol=4e-3)
