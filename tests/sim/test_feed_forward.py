"""A controller that follows estimates: what it commands, from when on, and within what limits."""

import numpy as np

from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.loop import closed_loop
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.tables.controller import Controller

N1 = preset("n1")
TEXT = """name = "x"
duration = 1.5
friction.coulomb = 0.05
excitation.kind = "moves"
controller.adapt = { smooth = 0.2 }
fault = [{ kind = "step", parameter = "f_m", at = 0.5, factor = 1.5 }]
"""
SCENARIO = parse_scenario(TEXT)
NAMES = ("k_T", "1/J_a", "f_m", "f_c")
NOMINAL = np.array([1.0, 1 / 0.8, 0.05, 0.05])


class Follower:
    """Returns a path of estimates that is known beforehand, and remembers what it was given."""

    def __init__(self, path, output="speed"):
        self.names, self.output, self.path, self.given = NAMES, output, path, []

    def step(self, u, y):
        self.given.append((u, y))
        return self.path[len(self.given) - 1]


def path():
    """Estimates that are others in every sample."""
    k = np.arange(SCENARIO.samples)[:, None]
    return NOMINAL * (1 + 0.3 * np.sin(0.05 * k * np.array([1, 2, 3, 4]) + 1))


def reference():
    rng = np.random.default_rng(3)
    return SCENARIO.excitation.reference(SCENARIO.grid, rng)


def loop(follower):
    noise = np.random.default_rng(1).standard_normal((SCENARIO.samples, 1))
    return closed_loop([SCENARIO], reference()[:, None], lambda _: noise, followers=[follower])


def commands(truth, estimates):
    """What the formula asks for, written out by hand, of the motion that there was."""
    r, controller = reference(), Controller(SCENARIO.controller, 1, period=0.005)
    known = np.vstack([NOMINAL, estimates])  # before the first estimate: nominal
    found = []
    for k in range(SCENARIO.samples - 1):
        k_T, inverse, f_m, f_c = known[k]
        v = (r[k + 1] - r[k]) / 0.005
        a = (r[k + 1] - 2 * r[k] + r[k - 1]) / 0.005**2 if k else v / 0.005
        J = N1.J_m + N1.r**2 * (N1.J_g + 1 / inverse)
        more = J * a + f_m * v + f_c * np.tanh(v / 0.2)
        asked = controller.torque(r[k : k + 1], truth.angles[k, :, 0])
        found.append((asked + more) / k_T)
    return np.array(found)


def test_commands_are_made_of_the_estimates_that_are_known_by_then():
    truth = loop(Follower(path()))
    np.testing.assert_allclose(truth.torque[:-1], commands(truth, path()), rtol=0, atol=1e-12)
    assert not truth.limited.any()


def test_a_follower_is_given_what_the_log_has():
    noise = 0.1 * np.random.default_rng(1).standard_normal((SCENARIO.samples, 1))
    for output in ("speed", "increment"):
        follower = Follower(path(), output)
        truth = loop(follower)
        u, y = np.array(follower.given).T
        angle = truth.angles[:, 0, 0]
        increment = np.concatenate([[0.0], np.diff(angle) / 0.005])
        assert np.array_equal(u, truth.torque[:, 0])
        wanted = truth.speed[:, 0] + noise[:, 0] if output == "speed" else increment
        np.testing.assert_allclose(y, wanted, rtol=0, atol=1e-12)
