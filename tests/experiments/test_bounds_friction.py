"""Bounds on axes with friction: against equations of motion written out here, and by known set."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexaxis.experiments.catalogue.find import find_scenario, scenario_names
from flexaxis.experiments.scoring import true_model
from flexaxis.experiments.scoring.true_model import jump_gradient, state_at
from flexaxis.sim.simulate import simulate

T, ONSET, SIGMA = 0.005, 2000, 0.1
TRACKED = ("k_T", "1/J_a", "f_m", "f_c")


@cache
def drawn(name):
    scenario = find_scenario(name)
    return scenario, simulate(scenario, [0])[0]


def bristles(q, v, p):
    """Torque of LuGre friction and the change of that of its bristles."""
    level = q["f_c"] + q.get("f_s", 0.0) * np.exp(-((v / q.get("v_s", 1.0)) ** 2))
    change = q["sigma_0"] * (v - abs(v) * p / level)
    return p + q["sigma_1"] / q["sigma_0"] * change, change


def speeds(q, u, x):
    """Motor speed from a state [x1, x2, v_m, v_g, v_a, p] on, by an adaptive method."""

    def rates(t, x, u):
        friction, change = bristles(q, x[2], x[5])
        gear = q["k_g"] * x[0] + q["d_g"] * (q["r"] * x[2] - x[3])
        arm = q["k_a"] * x[1] + q["d_a"] * (x[3] - x[4])
        motor = q["k_T"] * u - friction - q["f_m"] * x[2] - q["r"] * gear
        return [
            q["r"] * x[2] - x[3],
            x[3] - x[4],
            motor / q["J_m"],
            (gear - arm - q["f_g"] * x[3]) / q["J_g"],
            (arm - q["f_a"] * x[4]) / q["J_a"],
            change,
        ]

    found = []
    for torque in u:
        found.append(x[2])
        x = solve_ivp(rates, (0, T), x, "LSODA", args=(torque,), rtol=1e-9, atol=1e-11).y[:, -1]
    return np.array(found)


def slopes(q, names, u, x):
    """Derivatives (N, p) of the speed by central differences."""
    columns = []
    for name in names:
        physical = name.removeprefix("1/")
        theta = 1 / q[physical] if "/" in name else q[physical]
        h = 1e-4 * theta
        ends = [1 / value if "/" in name else value for value in (theta + h, theta - h)]
        up, down = (speeds(q | {physical: end}, u, x) for end in ends)
        columns.append((up - down) / (2 * h))
    return np.column_stack(columns)


@pytest.fixture(scope="module")
def lugre():
    scenario, record = drawn("lugre_fm_step-v1")
    truth = scenario.true_parameters()
    x = state_at(scenario, truth, record.torque, ONSET)
    q = dict(zip(scenario.parameter_names, truth[ONSET].tolist(), strict=True))
    u = record.torque[ONSET : ONSET + 200]
    return scenario, truth, record.torque, x, slopes(q, TRACKED, u, x)


@pytest.mark.parametrize(("finer", "worst"), [(true_model.FINER, 0.03), (20, 0.005)])
def test_the_gradient_after_a_jump_against_differences_of_an_adaptive_method(
    finer, worst, lugre, monkeypatch
):
    """Steps in which the torque of friction is held leave something where the motor reverses."""
    monkeypatch.setattr(true_model, "FINER", finer)
    scenario, truth, u, x, expected = lugre
    model = true_model.true_model(scenario, truth[ONSET]).parametrize(TRACKED)
    psi = jump_gradient(model, model.theta, u[ONSET : ONSET + 200], x, period=T)
    assert not psi[0].any()
    scale = np.sqrt(np.mean(expected**2, axis=0))
    assert (np.sqrt(np.mean((psi - expected) ** 2, axis=0)) < worst * scale).all()


def test_which_scenarios_a_model_describes():
    described_ = {name: true_model.describes(find_scenario(name)) for name in scenario_names()}
    for name in ("coulomb_fm_step-v1", "real_lugre_fm_step-v1", "told_kg_fm_step-v1", "fm_step-v1"):
        assert described_[name]
    for name in scenario_names():
        if find_scenario(name).linear:
            assert described_[name]
    for name in ("torque_delay_fm_step-v1", "speed_filter_fm_step-v1",
                 "load_friction_fm_step-v1", "torque_noise_fm_step-v1"):  # fmt: skip
        assert not described_[name], name
    both = find_scenario("lugre_fm_step-v1").override({"friction": {"coulomb": 0.1}})
    assert not true_model.describes(both)
