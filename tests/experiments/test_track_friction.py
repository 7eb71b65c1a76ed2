"""track on an axis with dry friction at a slow rate, and what it says of the size of a change."""

import numpy as np
import pytest

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.discretisation import law_plan
from flexaxis.experiments.logs.changes import changes_along

RATE = 100.0
AXIS = """
model = "one_mass"
[nominal]
k_T = 1.0
J_m = 1.01e-3
f_m = 5.1e-3
f_c = 0.049
[deviation]
J_m = 5e-6
f_m = 1e-4
f_c = 1e-3
[[law]]
kind = "bristle"
drive = { speed_motor = 1.0 }
acts = { speed_motor = "-1/J_m" }
parameters = { coulomb = "f_c", stiffness = 1.1e5 }
"""


@pytest.mark.parametrize(("rate", "steps"), [(1000.0, 4), (200.0, 4), (100.0, 8), (50.0, 16)])
def test_laws_are_solved_in_steps_of_time(rate, steps):
    values = {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3}
    model = MODELS["one_mass"].factory(values).parametrize(["f_m"])
    assert law_plan(model, model.theta / 2, model.theta * 2, 1 / rate)[0] == steps


def test_a_change_has_its_size_however_large():
    """ŷ = x/a + b z, as friction acts: seen from a = 1.5, to first order, half is a third."""
    rng = np.random.default_rng(0)
    time, x, z = np.arange(4000.0), 1 + 0.3 * rng.standard_normal(4000), rng.standard_normal(4000)
    truth = np.where(time < 1000, 1.0, 1.5)
    y = x / truth + z + 0.01 * rng.standard_normal(4000)

    def look(theta):
        a, b = theta
        return y - x / a - b * z, np.column_stack([-x / a**2, z])

    (change,) = changes_along(look, time, np.array([1.5, 1.0]), ("a", "b"))
    assert change.name == "a" and abs(change.time - 1000) <= 100
    assert change.relative == pytest.approx(0.5, abs=0.005)


def test_changes_beside_a_large_one_are_those_that_there_are():
    """ŷ = exp(a) x + b x s(t): what is seen of a large change from afar passes for changes of b."""
    time = np.arange(8000.0)
    x = np.random.default_rng(1).standard_normal(8000)
    turning = 1 + 0.8 * np.sin(2 * np.pi * time / 2000)
    truth = np.where(time < 4000, 0.5, 1.5)
    y = np.exp(truth * turning) + x + 0.05 * np.random.default_rng(2).standard_normal(8000)

    def look(theta):
        a, b = theta
        motion = np.exp(a * turning)
        return y - motion - b * x, np.column_stack([turning * motion, x + 0.2 * turning])

    found = changes_along(look, time, np.array([1.5, 1.0]), ("a", "b"))
    assert [change.name for change in found] == ["a"]
