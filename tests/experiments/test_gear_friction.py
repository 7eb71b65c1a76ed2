"""Friction that grows with the load of a gear: the model beside the plant, its bound, its units."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.scoring import bounds, true_model
from flexaxis.sim.simulate import simulate

SHARES = ("mu_m", "mu_e", "mu_ms", "mu_es")


@pytest.fixture(scope="module", params=[("erob80_50_fm_step-v1", 0.01), ("mx64_fc_step-v1", 0.02)])
def drive(request):
    """A drive that nothing happens to, whose speed is read with 2 % of white noise; its record."""
    name, sigma = request.param
    scenario = find_scenario(name).override(
        {"fault": [], "duration": 8.0, "output": "speed", "noise.speed": sigma, "encoder": {}}
    )
    return scenario, simulate(scenario, [0])[0]


def repeated(scenario, record, **changed):
    """Mean of z² of the innovations, and their correlation; at the truth, but for these values."""
    model = true_model.true_model(scenario, scenario.true_parameters()[0])
    model = replace(model, nominal=dict(model.nominal) | changed)
    filter_ = REGISTRY["ekf"].factory(
        model,
        scenario.period,
        identify=("k_T",),
        noise=scenario.noise.speed,
        walk=1e-9,
        spread=1e-9,
    )
    filter_.run(record.torque, record.speed)
    e, S = filter_.innovations[200:].T
    z = e / np.sqrt(S)
    return np.mean(z**2), np.corrcoef(z[1:], z[:-1])[0, 1]


@pytest.mark.slow
def test_innovations_are_white_at_the_truth_and_at_no_other_shares(drive):
    scenario, record = drive
    square, again = repeated(scenario, record)
    few = 4 / np.sqrt(len(record.torque))
    assert abs(square - 1) < np.sqrt(2) * few and abs(again) < few
    truth = true_model.true_model(scenario, scenario.true_parameters()[0]).nominal
    for name in (name for name in SHARES if truth[name] > 0.01):
        square, again = repeated(scenario, record, **{name: 0.0})
        assert square > 1.5 or again > 2 * few, name


def test_every_drive_with_a_fault_has_a_bound_that_is_that_of_its_model():
    for name in find_suite("drives").scenarios:
        scenario = find_scenario(name)
        assert true_model.describes(scenario), name
    scenario = find_scenario("erob80_50_fm_step-v1")
    (record,) = simulate(scenario, [0])
    without = scenario.override({"gear_friction.external_slow": 0.0})
    found, other = (bounds.limits(s, s.identify, record.torque)["f_m"] for s in (scenario, without))
    whole = found["lag_bound"]
    assert 0.005 < found["lag_bound_single"] < whole < 0.1  # .008 and .047 for this seed
    assert whole < found["lag_bound_learnt"]
    assert abs(other["lag_bound"] / whole - 1) > 0.02
