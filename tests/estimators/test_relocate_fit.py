"""Changes judged to first order and fitted: against matrix exponentials and textbook loops."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from flexaxis.estimators import three_mass
from flexaxis.estimators.relocate.fit import Past, explain
from flexaxis.estimators.relocate.normal import normal_equations
from flexaxis.estimators.relocate.screen import screen
from flexaxis.estimators.sampling.plan import plan
from flexaxis.estimators.sampling.sampled import sample, terms

NAMES = ("k_T", "1/J_a", "f_m")


def table(nominal, names=NAMES):
    model = three_mass(nominal).parametrize(names)
    order, substeps = plan(model, 0.4 * model.theta, 2.5 * model.theta, 0.005)
    return model, terms(model, order, substeps, 0.005)


def test_the_sampled_system_is_the_matrix_exponential(nominal, by_hand):
    model, given = table(nominal)
    D = sample(given, model.theta, np.arange(3))
    A, B = by_hand(nominal)
    exact = expm(np.block([[A[:5, :5], B[:5, None]], [np.zeros((1, 6))]]) * 0.005)[:5]
    np.testing.assert_allclose(D[0, :5], exact, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(D[0, 5, :5], exact[2, :5], rtol=1e-10, atol=1e-12)  # y is x_3
    none = np.arange(0)
    for i, h in enumerate(1e-5 * np.diag(model.theta)):
        up, down = (sample(given, model.theta + side, none)[0] for side in (h, -h))
        slope = (up - down) / (2 * h[i])
        # central differences: h² of truncation and 1e-16/h of rounding
        np.testing.assert_allclose(D[1 + i], slope, rtol=1e-5, atol=1e-8 * abs(slope).max())


def test_explain_finds_parameter_and_time_of_a_change_without_noise(nominal, simulated):
    model, given = table(nominal, ("f_m", "k_g"))
    run = simulated(2.0, sigma=0.0, faults={1.0: nominal | {"k_g": 0.8 * nominal["k_g"]}})
    D = sample(given, model.theta, np.arange(0))[0]
    x, states = np.zeros(5), []
    for u in run.u[:260]:
        states.append(x)
        x = (D[:5] @ np.r_[x, u])[:5]
    first, count = 150, 100
    able = slice(first, first + count)
    squares = (run.y[able] - np.array(states)[able, 2]) ** 2 / 1e-4
    past = Past(
        np.tile(model.theta, (count, 1)), np.array(states)[able], -np.cumsum(squares) / 2,
        np.c_[run.u, 0 * run.u][first:-1], run.y[first + 1 :], np.ones(399 - first, bool),
        np.zeros(count + 2), np.zeros(2), 1e-4,
    )  # fmt: skip
    found = {
        i: explain(given, past, np.array([i]), 0.4 * model.theta, 2.5 * model.theta, 0.5, 49,
                   model.theta)
        for i in (0, 1)
    }  # fmt: skip
    onset, theta, evidence, unexplained = found[1]
    assert first + onset == 200
    assert theta[1] / model.theta[1] == pytest.approx(0.8, abs=1e-4)
    assert evidence > found[0][2] + 100 and unexplained < 0.01 < found[0][3]


def test_the_screen_is_the_linear_gain_of_every_change_at_every_time(nominal, loop):
    model, given = table(nominal)
    theta, u, N, p = model.theta, loop.u, 60, 3
    x = np.array([1e-4, -2e-4, 1.0, 0.01, 0.008])
    present = np.ones(N, bool)
    present[20:23] = False
    y = np.random.default_rng(0).standard_normal(N)
    D = sample(given, theta, np.arange(p))
    gains, steps = np.empty((N, p)), np.empty((N, p))
    for onset in range(N):  # the textbook way: one simulation for each
        states, epsilon, psi = np.r_[x, 0.0], np.zeros(N), np.zeros((N, p))
        z = np.zeros((p, 6))
        for k in range(N):
            now, past = np.r_[states[:5], u[k]], np.c_[z[:, :5], np.zeros(p)]
            z = past @ D[0].T + (D[1:] @ now if k >= onset else 0.0)
            states = D[0] @ now
            epsilon[k], psi[k] = y[k] - states[5], z[:, 5]
        g = psi[present].T @ epsilon[present] / 0.3
        H = np.sum(psi[present] ** 2, axis=0) / 0.3 + 1 / (0.5 * theta) ** 2
        step = np.clip(g / H, -0.6 * theta, 1.5 * theta)
        steps[onset] = step
        gains[onset] = g * step - H * step**2 / 2 - np.log(H * (0.5 * theta) ** 2) / 2
    onset, change, gain = screen(
        given,
        theta,
        np.arange(p),
        x,
        np.c_[u, 0 * u][:N],
        y,
        present,
        0.3,
        0.4 * theta,
        2.5 * theta,
        0.5,
    )
    np.testing.assert_allclose(gain, gains.max(axis=0), rtol=1e-6)
    np.testing.assert_array_equal(onset, gains.argmax(axis=0))
    np.testing.assert_allclose(change, steps[onset, range(p)], rtol=1e-6)


def test_a_coloured_residual_is_fitted_by_generalised_least_squares(nominal, loop):
    model, given = table(nominal)
    N, theta, colour = 300, model.theta, np.array([0.9, -0.4])
    noise = lfilter([1.0], np.r_[1.0, -colour], np.random.default_rng(1).standard_normal(N))
    before = np.r_[0.3, -0.2]  # the residual one and two samples before the stretch, oldest first
    D = sample(given, theta, np.arange(3))
    x, z, y, psi = np.zeros(5), np.zeros((3, 5)), np.empty(N), np.empty((N, 3))
    for k in range(N):
        now = np.r_[x, loop.u[k]]
        z_next = np.c_[z, np.zeros(3)] @ D[0].T + D[1:] @ now
        x, z, psi[k], y[k] = (D[0] @ now)[:5], z_next[:, :5], z_next[:, 5], (D[0] @ now)[5]
    misfit, H, g = normal_equations(
        given, theta, np.zeros(5), np.c_[loop.u, 0 * loop.u][:N], y + noise,
        np.ones(N, bool), before, colour, 2.0, np.arange(3),
    )  # fmt: skip
    whitener = np.r_[1.0, -colour]
    white = np.convolve(np.r_[before, noise], whitener)[2 : N + 2]
    white_psi = np.array([np.convolve(column, whitener)[:N] for column in psi.T]).T
    assert misfit == pytest.approx(white @ white / 2, rel=1e-9)
    np.testing.assert_allclose(H, white_psi.T @ white_psi / 2, rtol=1e-9)
    np.testing.assert_allclose(g, white_psi.T @ white / 2, rtol=1e-6)


def test_the_derivative_by_a_parameter_that_is_zero_is_right(nominal):
    names = ("f_m", "f_a", "d_a", "J_a")
    model, given = table(dict(nominal) | {"f_a": 0.0, "d_a": 0.0}, names)
    given = given._replace(order=40)
    D = sample(given, model.theta, np.arange(4))
    none = np.arange(0)
    for i, h in enumerate((1e-5, 1e-4, 1e-4, 1e-5)):
        up, down = (model.theta.copy() for _ in range(2))
        up[i], down[i] = up[i] + h, down[i] - h
        slope = (sample(given, up, none)[0] - sample(given, down, none)[0]) / (2 * h)
        # central differences: h² of truncation and 1e-16/h of rounding
        np.testing.assert_allclose(D[1 + i], slope, rtol=1e-5, atol=1e-6 * abs(slope).max())
