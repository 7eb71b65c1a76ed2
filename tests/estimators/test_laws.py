"""Nonlinear laws of models: against an adaptive integrator, differences, the engine, a textbook."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexaxis.estimators import Rpem
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models import acting
from flexaxis.estimators.models import law_torques as torques
from flexaxis.estimators.models.axes import (
    BRISTLES,
    COGGING,
    GEAR_FRICTION,
    GEAR_SPRING,
    LIMIT,
    N1,
    STATIC,
    three_mass,
    with_angle,
)
from flexaxis.estimators.models.laws import KINDS, Law
from flexaxis.estimators.models.simulation import along as run_along
from flexaxis.estimators.models.simulation import simulation
from flexaxis.estimators.signals import increment
from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.tables.friction import GearFrictionConfig, LuGreConfig
from flexaxis.sim.tables.nonlinear import (
    CoggingConfig,
    SaturationConfig,
    StiffeningConfig,
)

T = 0.005
VALUES = N1 | {
    "f_c": 0.1, "f_s": 0.05, "v_s": 0.5, "sigma_0": 100.0, "sigma_1": 0.3, "v_0": 0.05,
    "alpha": 3.24, "beta": 8.0, "kappa": 3e4, "gap": 5e-5,
    "c_sin": 0.1, "c_cos": 0.02, "poles": 24.0, "torque_limit": 1.0,
    "mu_m": 0.08, "mu_e": 0.1, "mu_ms": 0.06, "mu_es": 0.12, "sharpness": 1.6,
}  # fmt: skip
LAWS = {
    "bristle": (BRISTLES,),
    "static": (STATIC,),
    "spring": (GEAR_SPRING,),
    "sinusoid": (COGGING,),
    "clip": (LIMIT,),
    "gear": (GEAR_FRICTION, GEAR_SPRING),
    "all": (BRISTLES, GEAR_SPRING, COGGING, LIMIT),
}


def axis(name, **values):
    return replace(with_angle(three_mass(VALUES | values)), laws=LAWS[name])


def estimated(model):
    own = (n for law in model.laws for n in law.names if n != "poles")
    return ("k_T", "1/J_a", "f_m", "k_g", *own)


def torque(n=200):
    return 0.8 * np.convolve(np.random.default_rng(0).standard_normal(n), np.ones(3) / 2, "same")


def along(design, eta, u, *, steps=None):
    """Yield the simulation, and states and sensitivities (1+p, n+1) after each sample."""
    ready = simulation(design, eta, T, steps=steps)
    for value in u:
        run_along(ready, np.array([value]))
        yield ready, ready["X"][:, : 1 + len(eta)].T


def travelled(model, u, *, steps=None, theta=None):
    """States and sensitivities (N, 1+p, n+1) after each sample, in relative parameters."""
    names = estimated(model)
    one = model.parametrize(names)
    eta = np.ones(len(names)) if theta is None else theta
    return np.array([X.copy() for _, X in along(one.relative(one.theta), eta, u, steps=steps)])


def unsolved(ready):
    """What a step leaves of its equation, over the size of it."""
    law, mean, gain = ready["laws"][0], ready["lanes"][1], ready["square"][0]
    return abs(mean[0, 0] - law["offset"] - gain[0, 0] * law["local"][0]) / law["reach"]


def force(law, w, v):
    """The torque of a law, and the rate of its own state: (F, ṗ), written out by hand."""
    match law.kind:
        case "static":
            return (v["f_c"] + v["f_s"] / np.cosh(v["alpha"] * w)) * np.tanh(v["beta"] * w), None
        case "gear":  # w: speed, and the torques of gear and motor
            speed, gear, motor = w
            fast = v["f_c"] + abs(v["mu_e"] * gear + v["mu_m"] * motor)
            slow = v["f_s"] + abs(v["mu_es"] * gear + v["mu_ms"] * motor)
            left = np.exp(-(abs(speed / v["v_s"]) ** v["sharpness"]))
            return (fast + slow * left) * np.tanh(speed / v["v_0"]), None
        case "spring":
            d = np.sign(w) * max(abs(w) - v["gap"] / 2, 0.0)
            return d + v["kappa"] * d**3 - w, None
        case "sinusoid":
            angle = v["poles"] * w
            return v["c_sin"] * np.sin(angle) + v["c_cos"] * np.cos(angle), None
        case "clip":
            return np.clip(w, -v["torque_limit"], v["torque_limit"]) - w, None


def adaptive(model, u, period=T):
    """Motor speed after each sample of the equations of motion, by an adaptive method."""
    v, states = model.nominal, list(model.states)

    def rate(t, s, u):
        x1, x2, vm, vg, va, angle = s[:6]
        gear = v["k_g"] * x1 + v["d_g"] * (v["r"] * vm - vg)
        arm = v["k_a"] * x2 + v["d_a"] * (vg - va)
        motor, own = v["k_T"] * u - v["f_m"] * vm, []
        for law in model.laws:
            if law.kind == "bristle":
                g = (v["f_c"] + v["f_s"] * np.exp(-((vm / v["v_s"]) ** 2))) * np.tanh(
                    abs(vm) / v["v_0"]
                )
                slide = abs(vm) * s[6] / g if vm else 0.0
                own.append(v["sigma_0"] * (vm - slide))
                motor -= s[6] + v["sigma_1"] * (vm - slide)
            elif law.kind == "static":
                motor -= force(law, vm, v)[0]
            elif law.kind == "gear":
                motor -= force(law, (vm, v["r"] * v["k_g"] * x1, v["k_T"] * u), v)[0]
            elif law.kind == "spring":
                gear += v["k_g"] * force(law, x1, v)[0]
            elif law.kind == "sinusoid":
                motor += force(law, angle, v)[0]
            else:
                motor += v["k_T"] * force(law, u, v)[0]
        return [v["r"] * vm - vg, vg - va, (motor - v["r"] * gear) / v["J_m"],
                (gear - arm - v["f_g"] * vg) / v["J_g"], (arm - v["f_a"] * va) / v["J_a"],
                vm, *own]  # fmt: skip

    s, out = np.zeros(len(states) + sum(law.remembers for law in model.laws)), []
    for value in u:
        found = solve_ivp(
            rate, (0, period), s, "LSODA", args=(value,), rtol=1e-10, atol=1e-12, max_step=T / 4
        )
        s = found.y[:, -1]
        out.append(s[2])
    return np.array(out)


def distance(ours, reference):
    return np.sqrt(np.mean((ours - reference) ** 2) / np.mean(reference**2))


@pytest.mark.parametrize("name", ["bristle", "sinusoid", "all"])
def test_second_order_against_an_adaptive_integrator(name):
    model, u = axis(name), torque()
    reference = adaptive(model, u)
    errors = [distance(travelled(model, u, steps=s)[:, 0, -1], reference) for s in (8, 16, 32)]
    # the gap's corner and the sticking of dry friction are met once in a step: not smooth
    assert errors[2] < 1e-4 and errors[1] < errors[0] / 2.5 and errors[2] < errors[1] / 2.5, errors


@pytest.mark.parametrize(
    ("name", "most"), [("static", 2e-3), ("gear", 5e-3), ("spring", 6e-4), ("clip", 1e-8)]
)
def test_against_an_adaptive_integrator(name, most):
    model, u = axis(name), torque()
    reference = adaptive(model, u)
    assert distance(travelled(model, u, steps=8)[:, 0, -1], reference) < most
    assert distance(travelled(model, u, steps=64)[:, 0, -1], reference) < max(most / 50, 1e-8)


def test_the_search_ends_where_the_laws_hold():
    """Under a rough torque as well, where a step of the search may halve what is left, no more."""
    u = 0.8 * np.random.default_rng(1).standard_normal(1000)
    for name in ("static", "bristle"):
        model = axis(name, beta=8.0, sigma_0=1e4, v_0=0.0)
        one = model.parametrize(["k_T"])
        assert max(unsolved(ready) for ready, _ in along(one, one.theta, u)) < 1e-9


def test_friction_that_falls_steeply_is_solved_for_and_amplifies_no_rounding():
    """A step may then have several solutions; laws that are learnt get there."""
    rng, ends = np.random.default_rng(0), []
    for case in range(40):
        decades = {"f_c": (-2.5, -0.5), "f_s": (-1.5, -0.2), "v_s": (-1.3, 0.3), "v_0": (-2, -0.5)}
        decades |= {"sigma_0": (2, 3.5), "sigma_1": (-1, 0.5)}
        one = axis("bristle", **{n: 10 ** rng.uniform(*r) for n, r in decades.items()})
        one, u = one.parametrize(["k_T"]), 0.8 * np.random.default_rng(case).standard_normal(400)
        for rounding in (0.0, 1e-14):
            for ready, X in along(one, one.theta, u * (1 + rounding)):
                assert unsolved(ready) < 1e-6, case
                last = X[0].copy()
            ends.append(last)
    one, other = np.array(ends[::2]), np.array(ends[1::2])
    assert np.all(abs(one - other).max(axis=1) < 1e-8 * abs(one).max(axis=1))  # 1e-9 as it is


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("output", ["speed", "increment"])
def test_derivatives_against_differences(name, output):
    model, u = axis(name), torque(120)
    model = model if output == "speed" else increment(model, T)
    exact, p = travelled(model, u), len(estimated(model))
    for i in range(p):
        step = 3e-6 * np.eye(p)[i]
        high, low = (travelled(model, u, theta=np.ones(p) + s)[:, 0, -1] for s in (step, -step))
        slope = (high - low) / 6e-6
        assert abs(slope - exact[:, 1 + i, -1]).max() < 1e-6 * abs(slope).max(), estimated(model)[i]


@pytest.mark.parametrize("v", [-2.0, 1e-6, 3.0])
def test_bristles_without_a_level_have_the_limit_of_little(v):
    """Their derivative by the level too: a friction that has gone can come again."""
    found = []
    for level in (0.0, 1e-15):
        local = np.zeros(acting.LAW["local"].shape)
        value = np.array([level, 0.0, 0.0, 176.0, 0.0, 0.0])
        torques.force(KINDS.index("bristle"), v, 0.1 * v, 0.0, T, value, local)
        found.append(local[[acting.F, acting.S, acting.ROLE, acting.ROLE + 1]])
    np.testing.assert_allclose(*found, rtol=1e-6, atol=2e-15)


ENGINE = {
    "bristle": (
        LuGreConfig(stiffness=100.0, damping=0.3, coulomb=0.1, static=0.15, stribeck=0.5),
        160, 2e-3,  # the engine's bristles are of first order: .0012 with these
    ),
    "gear": (
        GearFrictionConfig(
            f_c=0.1, f_s=0.05, motor=0.08, external=0.1, motor_slow=0.06, external_slow=0.12,
            v_s=0.5, alpha=1.6,
        ),
        40, 2e-3,  # .0003 with twice the steps of the model, where friction is steep
    ),
    "spring": (StiffeningConfig(gear=3e4), 20, 1e-3),
    "sinusoid": (CoggingConfig(amplitude=0.1, poles=24), 5, 1e-3),
    "clip": (SaturationConfig(torque=1.0), 5, 1e-4),
}  # fmt: skip


@pytest.mark.parametrize("name", ENGINE)
def test_against_the_engine(name):
    feature, substeps, most = ENGINE[name]
    v_0 = 0.05 if name == "gear" else 1e-9
    model = axis(name, gap=0.0, kappa=0.0 if name == "gear" else 3e4, c_cos=1e-12, v_0=v_0)
    plant, u, speed = (
        Plant([preset("n1")], period=T, substeps=substeps, nonlinear=[feature]),
        torque(),
        [],
    )
    for value in u:
        plant.step(np.array([value]))
        speed.append(plant.speed_m[0])
    laws, linear = (m.parametrize(["k_T"]) for m in (model, replace(model, laws=())))
    ours, without = (
        np.array([X[0, -1] for _, X in along(one, one.theta, u, steps=steps)])
        for one, steps in ((laws, 16), (linear, None))
    )
    speed = np.array(speed)
    assert distance(ours, speed) < most
    assert not linear.forces and distance(ours, speed) < distance(without, speed) / 10


@pytest.mark.slow
def test_a_filter_against_a_textbook_loop():
    """Eq. (5)–(9), with the gradient from differences of one sample of the model."""
    names, values = ("k_T", "f_m", "f_c"), VALUES | {"k_T": 1.05, "f_c": 0.08, "gap": 0.0}
    model = replace(three_mass(values), laws=(BRISTLES,))
    theta, u = model.parametrize(names).theta, torque(60)
    truth = replace(axis("bristle"), identify=names)
    y = np.r_[0.0, travelled(truth, u)[:-1, 0, -1]]
    P0 = np.diag((0.05 * theta) ** 2)
    ours = Rpem(model, identify=names, P0=P0, period=T, forgetting=0.99).run(u, y)

    def sample(x, theta, u):
        one = model.parametrize(names)
        ready = simulation(one, theta, T)
        ready["X"][:n, 0] = x
        run_along(ready, np.array([u]))
        return ready["X"][:n, 0].copy()

    theta0, n, p = theta.copy(), 6, len(names)
    x, z, P = np.zeros(n), np.zeros((n, p)), P0
    for k in range(len(u)):
        psi, epsilon = z[2], y[k] - x[2]
        P = P - np.outer(P @ psi, P @ psi) / (1 + psi @ P @ psi)
        theta = theta + P @ psi * epsilon
        P = P / 0.99
        assert np.allclose(ours[k], theta, rtol=2e-7, atol=0), k
        ahead = sample(x, theta, u[k])
        by_x = np.empty((n, n))
        for j in range(n):
            step = 1e-6 * np.eye(n)[j] * max(1e-3, abs(x[j]))
            by_x[:, j] = (sample(x + step, theta, u[k]) - sample(x - step, theta, u[k])) / (
                2 * step[j]
            )
        by_theta = np.empty((n, p))
        for i in range(p):
            step = 1e-5 * theta0[i] * np.eye(p)[i]
            by_theta[:, i] = (sample(x, theta + step, u[k]) - sample(x, theta - step, u[k])) / (
                2 * step[i]
            )
        x, z = ahead, by_x @ z + by_theta


FULL = ({"speed_motor": 1.0}, {"speed_motor": "-1/J_m"}, GEAR_FRICTION.parameters)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (("static", {"speed": 1.0}, {"speed_motor": "-1/J_m"}, {"coulomb": "f_c"}), "speed_motor"),
        (("bristle", {"speed_motor": 1.0}, {"speed_motor": "1"}, {"coulomb": "f_c"}), "stiffness"),
        (("statik", {"speed_motor": 1.0}, {"speed_motor": "1"}, {}), "static"),
        (("static", {"speed_motor": 1.0}, {"speed_motor": "1"}, {"colomb": 1.0}), "coulomb"),
        (("static", {}, {"speed_motor": "1"}, {"coulomb": 1.0}), "drive"),
        (("gear", *FULL), "a law 'spring', and model 'three_mass' has none"),
        (("static", {"speed_motor": 1.0}, {"speed_motor": "sin(k)"}, {"coulomb": 1.0}), "sin"),
    ],
)  # fmt: skip
def test_a_law_that_cannot_be_is_refused(law, words):
    with pytest.raises(EstimatorError, match=words):
        replace(three_mass(VALUES), laws=(Law(*law),))
