"""Detect, rewind, refit: its parts against closed forms, the whole against known faults."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_toeplitz
from scipy.signal import lfilter

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.case import Case, Comparison
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.memory import write_colour
from flexaxis.estimators.relocate.refit import Change, Past, _normal_equations, explain, replay
from flexaxis.estimators.relocate.screen import screen
from flexaxis.estimators.sampling.plan import plan
from flexaxis.estimators.sampling.sampled import sample, terms

NAMES = ("k_T", "1/J_a", "f_m")
SUSPECTS = ("J_m", "J_g", "k_g", "k_a", "d_g", "d_a", "f_g", "f_a")
P0 = known_P(NAMES, forgetting=0.995)


def table(nominal, names=NAMES):
    model = three_mass(nominal).parametrize(names)
    order, substeps = plan(model, 0.4 * model.theta, 2.5 * model.theta, 0.005)
    return model, terms(model, order, substeps, 0.005)


@pytest.fixture
def relocate(nominal):
    return Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=0.005)


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


def test_replay_is_least_squares(nominal, loop):
    model, given = table(nominal)
    N, theta = 400, 1.02 * model.theta
    y_hat, psi = predict(model, theta, loop.u[: N + 1])
    spread = (0.1 * theta) ** 2
    delta = replay(
        given, theta, np.zeros((4, 6)), np.diag(spread), loop.u[:N], loop.y[1 : N + 1],
        np.ones(N, bool), 1.0,
    )  # fmt: skip
    R = np.diag(1 / spread) + psi[1:].T @ psi[1:]
    expected = np.linalg.solve(R, psi[1:].T @ (loop.y[1 : N + 1] - y_hat[1:]))
    np.testing.assert_allclose(delta, expected, rtol=1e-6)


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
        run.u[first:-1], run.y[first + 1 :], np.ones(399 - first, bool),
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


@pytest.mark.parametrize(
    ("name", "factor"), [("f_m", 1.5), ("1/J_a", 1.1), ("k_T", 0.9), ("k_g", 0.8), ("J_m", 1.1)]
)
def test_names_the_parameter_and_its_size(nominal, simulated, relocate, name, factor):
    parameter = name.removeprefix("1/")
    run = simulated(12.0, seed=3, faults={6.0: nominal | {parameter: factor * nominal[parameter]}})
    theta = relocate.run(run.u, run.y)
    (finding,) = relocate.findings
    assert finding.parameters == (name,)
    ratio = finding.ratio[0] ** (-1 if name.startswith("1/") else 1)
    assert ratio - 1 == pytest.approx(factor - 1, rel=0.08)  # four deviations of the refit
    assert abs(finding.onset - 1200) <= 10 and finding.alarm - 1200 < 40
    truth = np.array([nominal["k_T"], 1 / nominal["J_a"], nominal["f_m"]])
    if name in NAMES:
        truth[NAMES.index(name)] *= finding.ratio[0]
    np.testing.assert_allclose(theta[-1], truth, rtol=0.015)


def test_without_a_change_it_is_the_corrected_rpem(nominal, loop, relocate):
    plain = Rpem(three_mass(nominal), P0=P0, state_correction=True, period=0.005)
    np.testing.assert_allclose(relocate.run(loop.u, loop.y), plain.run(loop.u, loop.y), rtol=1e-9)
    assert relocate.findings == ()


def test_steps_blocks_and_the_whole_agree(nominal, simulated, relocate):
    run = simulated(8.0, seed=1, faults={5.0: nominal | {"f_m": 0.1}})
    whole = relocate.run(run.u, run.y)
    found = relocate.findings
    relocate.reset()
    parts = [relocate.run(run.u[a:b], run.y[a:b]) for a, b in ((0, 900), (900, 1003))]
    steps, alarms = [], []
    for u, y in zip(run.u[1003:], run.y[1003:], strict=True):
        steps.append(relocate.step(u, y))
        alarms.append(relocate.alarm)
    np.testing.assert_array_equal(whole, np.vstack([*parts, steps]))
    assert relocate.findings == found
    assert np.flatnonzero(alarms).tolist() == [found[0].alarm - 1003]


def test_the_past_does_not_know_the_future(nominal, simulated, relocate):
    run = simulated(8.0, seed=2, faults={5.0: nominal | {"f_m": 0.1}})
    theta = relocate.run(run.u, run.y)
    other = run.y.copy()
    other[1020:] += 1.0
    relocate.reset()
    np.testing.assert_array_equal(relocate.run(run.u, other)[:1020], theta[:1020])


def test_no_model_of_the_change_is_said_and_said_once(nominal, simulated, relocate):
    run = simulated(12.0, seed=4)
    y = run.y.copy()
    y[1200:] += 2.0 * np.random.default_rng(0).standard_normal(1200)  # the sensor goes bad
    relocate.run(run.u, y)
    assert [finding.parameters for finding in relocate.findings] == [()]


def test_a_gap_and_an_increment_model(nominal, simulated):
    run = simulated(10.0, seed=5, faults={6.0: nominal | {"f_m": 0.1}})
    filter_ = Relocate(
        three_mass(nominal), suspects=SUSPECTS, P0=P0, output="increment", period=0.005
    )
    y = run.increment + 0.1 * np.random.default_rng(1).standard_normal(len(run.u))
    valid = np.ones(len(y), bool)
    valid[1100:1120] = False
    theta = filter_.run(run.u, y, valid)
    (finding,) = filter_.findings
    assert finding.parameters == ("f_m",)
    assert theta[-1, 2] == pytest.approx(0.1, rel=0.02)


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
        given, theta, x, u[:N], y, present, 0.3, 0.4 * theta, 2.5 * theta, 0.5
    )
    np.testing.assert_allclose(gain, gains.max(axis=0), rtol=1e-6)
    np.testing.assert_array_equal(onset, gains.argmax(axis=0))
    np.testing.assert_allclose(change, steps[onset, range(p)], rtol=1e-6)


def test_colour_is_the_solution_of_the_yule_walker_equations():
    correlations = np.array([1.2, 0.7, 0.1, -0.2, -0.1])
    colour = np.empty(5)
    write_colour.py_func(correlations, 0.0, colour)
    weights = solve_toeplitz(correlations[:4], correlations[1:])
    np.testing.assert_allclose(colour[:4], weights, rtol=1e-6)  # less a floor of 1e-9
    remains = 1 - weights @ correlations[1:] / correlations[0]
    assert colour[4] == pytest.approx(remains, rel=1e-6)


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
    misfit, H, g = _normal_equations(
        given, theta, np.zeros(5), loop.u[:N], y + noise, np.ones(N, bool), before, colour, 2.0,
        np.arange(3),
    )  # fmt: skip
    whitener = np.r_[1.0, -colour]
    white = np.convolve(np.r_[before, noise], whitener)[2 : N + 2]
    white_psi = np.array([np.convolve(column, whitener)[:N] for column in psi.T]).T
    assert misfit == pytest.approx(white @ white / 2, rel=1e-9)
    np.testing.assert_allclose(H, white_psi.T @ white_psi / 2, rtol=1e-9)
    np.testing.assert_allclose(g, white_psi.T @ white / 2, rtol=1e-6)


def test_a_fault_is_found_in_a_coloured_residual(nominal, simulated, relocate):
    run = simulated(14.0, seed=6, faults={10.0: nominal | {"f_m": 0.075}})
    white = np.random.default_rng(2).standard_normal(len(run.u))
    y = run.y + 0.1 * lfilter([1.0], [1.0, -1.8, 0.9], white)  # rms 0.5 rad/s, five times σ
    relocate.run(run.u, y)
    (finding,) = relocate.findings
    assert finding.parameters == ("f_m",)
    assert abs(finding.onset - 2000) < 20 and finding.alarm < 2400


@pytest.mark.parametrize(
    ("remains", "lead", "odds", "age", "convinced"),
    [
        (1.0, 6.0, 20.0, 0, True),
        (1.0, 6.0, 10.0, 0, False),  # too little evidence
        (1.0, 1.0, 20.0, 5, False),  # two hypotheses explain it equally well: wait
        (1.0, 1.0, 20.0, 30, True),  # they still do: take either
        (0.5, 6.0, 60.0, 0, False),  # half of the residual is no noise: see whether it lasts
        (0.5, 6.0, 20.0, 40, False),  # and ask for three times as much
        (0.5, 6.0, 60.0, 40, True),
    ],
)
def test_when_a_change_is_believed(remains, lead, odds, age, convinced):
    case = Case(100, 95, 95, 0.01, np.array([0.0, 0.0, 0.0, 0.0, remains]), 1.0)
    case.likelihood = np.array([-3.0, -5.0])
    found = Comparison(np.array([0]), Change(2, np.ones(3), 0.0, 1.0), odds - 5.0, lead)
    assert case.convinced(found, age, 14.0) == convinced
    case.active = np.array(
        [1]
    )  # another one is in use: it goes only for one that is clearly better
    assert case.convinced(found, age, 14.0) == (lead > 5)
