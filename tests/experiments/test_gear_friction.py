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
    found, other = (bounds.limits(s, s.identify, record.torque)[2] for s in (scenario, without))
    assert 0.01 < found.lag_bound_single < found.lag_bound < 0.2  # .019 and .082 for this seed
    assert abs(other.lag_bound / found.lag_bound - 1) > 0.02


def test_units_do_not_matter(drive):
    """In N cm instead of N m, and with a gear whose two sides count otherwise."""
    scenario, record = drive
    model = true_model.true_model(scenario, scenario.true_parameters()[0])
    torques = ("J_m", "J_g", "J_a", "k_g", "k_a", "d_g", "d_a", "f_m", "f_g", "f_a", "f_c", "f_s")
    values = dict(model.nominal)
    small = values | {name: 100 * values[name] for name in torques}
    n = 50.0  # speeds of the load are slower, its inertia and springs are larger
    load = ("J_g", "J_a", "k_g", "k_a", "d_g", "d_a", "f_g", "f_a")
    geared = values | {"r": 1 / n} | {name: n**2 * values[name] for name in load}
    ends = []
    for nominal, u in ((values, 1.0), (small, 100.0), (geared, 1.0)):
        x = np.zeros(len(model.states))
        one = replace(model, nominal=nominal).parametrize(["k_T"])
        moved = true_model._travel(one, one.theta, u * record.torque[:400], x, scenario.period)
        ends.append(moved[1][2])
    np.testing.assert_allclose(ends[1:], ends[0], rtol=1e-9)
