"""A model as `control.StateSpace`: matrices, names, and a plain word without the package."""

import subprocess
import sys

import control
import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.signals import increment

T = 0.005


def test_matrices_and_names_are_those_of_the_model(nominal):
    model = three_mass(nominal)
    system = model.to_statespace()
    A, B, C = model.parametrize(["k_T"]).matrices([nominal["k_T"]])
    assert np.array_equal(system.A, A) and np.array_equal(system.B, B)
    assert np.array_equal(system.C, C) and not system.D.any() and system.isctime()
    assert system.state_labels == list(model.states)
    assert (system.input_labels, system.output_labels) == (["torque"], ["speed"])


def test_values_take_the_place_of_nominal_ones(nominal):
    system = three_mass(nominal).to_statespace({"J_a": 1.0, "f_m": 0.0})
    other = three_mass(dict(nominal) | {"J_a": 1.0, "f_m": 0.0}).to_statespace()
    assert np.array_equal(system.A, other.A)
    with pytest.raises(EstimatorError, match=r"no parameter 'J_b'.*J_a"):
        three_mass(nominal).to_statespace({"J_b": 1.0})
    with pytest.raises(EstimatorError, match="J_a = -1"):
        three_mass(nominal).to_statespace({"J_a": -1.0})


def test_sampled_by_control_it_predicts_what_the_predictor_does(nominal):
    model = three_mass(nominal)
    u = np.random.default_rng(0).standard_normal(400)
    sampled = control.c2d(model.to_statespace(), T, method="zoh")
    found = control.forced_response(sampled, inputs=u).outputs
    expected, _ = predict(model.parametrize(["k_T"]), [1.0], u, period=T)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_a_model_of_increments_has_one_state_more(nominal):
    system = increment(three_mass(nominal), T).to_statespace()
    assert system.nstates == 6 and system.state_labels[-1] == "angle_increment"


def test_estimators_need_no_control(nominal):
    code = f"""
import sys
sys.modules["control"] = None
from flexaxis.estimators import three_mass
try:
    three_mass({dict(nominal)}).to_statespace()
except ValueError as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("EstimatorError a control.StateSpace needs python-control")
