"""ŷ and ψ of a whole record, against a textbook loop and finite differences."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from acceptance.axes import AXES
from acceptance.differences import central

from flexaxis.estimators import increment, three_mass
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import STATIC
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.registry import REGISTRY

T = 0.005


def test_prediction_is_the_speed_of_the_axis(nominal, loop):
    """The loop of conftest has A and B written out by hand; only rounding may differ."""
    model = three_mass(nominal).parametrize(["k_T"])
    predicted, _ = predict(model, model.theta, loop.u, period=0.005)
    np.testing.assert_allclose(predicted, loop.clean, atol=1e-9)


def test_increments_are_differences_of_the_angle(nominal, loop):
    model = increment(three_mass(nominal), T).parametrize(["f_m"])
    predicted, _ = predict(model, model.theta, loop.u, period=0.005)
    np.testing.assert_allclose(predicted, loop.increment, atol=1e-8)


def output(model, u, theta):
    return predict(model, theta, u, period=T)[0]


def test_psi_is_the_slope_of_the_prediction(nominal, loop):
    for base in (three_mass(nominal), increment(three_mass(nominal), T)):
        names = ("1/J_a", "f_m", "k_g", "r")
        model, u = base.parametrize(names), loop.u[:1000]
        _, psi = predict(model, model.theta, u, period=0.005)
        expected = central(partial(output, model, u), model.theta, 1e-5)
        for column, slope in zip(psi.T, expected, strict=True):
            # a central difference: truncation 1e-8 (the resonances are sharp), rounding 1e-11
            assert np.abs(column - slope).max() < 1e-6 * np.abs(slope).max()


def test_a_model_with_laws_is_predicted_with_them(nominal):
    values = dict(nominal) | {"f_c": 0.1, "f_s": 0.0, "alpha": 1.0, "beta": 8.0}
    model = replace(three_mass(values), laws=(STATIC,)).parametrize(["k_T", "f_m", "f_c"])
    u = 0.8 * np.random.default_rng(1).standard_normal(200)
    y, psi = predict(model, model.theta, u, period=0.005)
    expected = central(partial(output, model, u), model.theta, 1e-5)
    for column, slope in zip(psi.T, expected, strict=True):
        assert abs(slope - column).max() < 1e-6 * abs(slope).max()
    linear = three_mass(nominal).parametrize(["k_T"])
    assert np.std(y - predict(linear, linear.theta, u, period=0.005)[0]) > 0.1 * np.std(y)


NO_TORQUE = [
    [[1.0]], "a", ["a", "b"], np.ones((300, 3)), 5.0, {}, [], [1j, 0], [[1.0], [1.0, 2.0]]
]  # fmt: skip


@pytest.mark.parametrize("given", NO_TORQUE, ids=lambda given: str(given)[:12])
@pytest.mark.parametrize("name", ["rpem-forgetting", "glr"])
def test_what_is_no_torque_of_a_run_is_refused_in_a_line(name, given):
    with pytest.raises(EstimatorError, match=r"^torque is .*; give the torque of a run in N m"):
        REGISTRY[name].factory(AXES["n1"], 0.005, torque=given)
