"""The excess prediction error: of which samples it is, and of whom."""

import numpy as np
import pytest

from flexaxis.estimators.models.axis_models import three_mass
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.nominal_torque import nominal_torque
from flexaxis.experiments.scoring.pooling import excess

NAMES = ("k_T", "1/J_a", "f_m")


def test_the_excess_error_is_of_the_steady_state():
    """It is periodic, so that the period from 20 s on has the same ψ as the last two."""
    scenario = find_scenario("paper_nominal-v1").override({"start": 1.0})
    model = three_mass(scenario.nominal.as_dict()).parametrize(NAMES)
    _, psi = predict(model, model.theta, nominal_torque(scenario), period=0.005)
    psi = psi[4000:6000] * model.theta / 100
    wanted = psi.T @ psi / 2000 / 0.1**2
    np.testing.assert_allclose(information(scenario), wanted, rtol=1e-6)


@pytest.mark.parametrize(
    "changes",
    [{"fault[0].factor": 0.7}, {"noise.torque": 0.05}, {"noise.angle": 1e-3}, {"duration": 12.0}],
)
def test_the_nominal_run_knows_neither_fault_nor_noise(changes):
    scenario = find_scenario("fm_step-v1")
    other = scenario.override(changes)
    np.testing.assert_array_equal(nominal_torque(other), nominal_torque(scenario))
    assert len(nominal_torque(other)) == 8000


def test_a_lost_run_counts_as_it_is_and_has_no_bias_in_common():
    """By hand: (1 + 1 + 100)/3 less two thirds of the square of the common bias of one."""
    lost = np.array([False, False, True])
    biases = np.array([[1.0], [1.0], [50.0]])
    assert excess(np.array([1.0, 1.0, 100.0]), lost, biases, np.eye(1)) == pytest.approx(100 / 3)
