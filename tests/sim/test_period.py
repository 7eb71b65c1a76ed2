"""Other sampling periods than 5 ms: the same axis, controller and faults on another grid."""

import numpy as np
import pytest

from flexaxis.sim.random_draws import stream
from flexaxis.sim.simulate import simulate

from .conftest import commanded, exact_speed

PERIODS = [0.001, 0.002, 0.0025, 0.01]
FAULT = '[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 1.5\nfactor = 1.5\n'


def scenario_at(make, period, text="", **top):
    slow = "controller.Kv = 0.06\n" if period == 0.01 else ""
    return make(f"period = {period}\n{slow}{text}", duration=3.0, **top)


@pytest.mark.parametrize("period", [*PERIODS, 0.005])
@pytest.mark.parametrize("name", ["n1", "n2"])
def test_the_plant_is_equations_3_and_4_sampled_with_that_period(period, name, make):
    scenario = scenario_at(make, period, FAULT, preset=f'"{name}"')
    (record,) = simulate(scenario, [0])
    assert len(record.time) == round(3.0 / period) and record.period == period
    exact = exact_speed(record.torque, scenario.true_parameters(), period)
    # RK4 in steps of 1 ms at most, over some thousands: below 3e-4 as `test_plant` has it.
    error = np.linalg.norm(record.true_speed - exact) / np.linalg.norm(exact)
    assert error < 3e-4
    assert np.array_equal(record.increment[1:], np.diff(record.angle) / period), (
        "the increment is over one sample"
    )


@pytest.mark.parametrize("period", PERIODS)
def test_the_controller_runs_at_that_period(period, make):
    scenario = scenario_at(make, period, "controller.tau = 0.002")
    (record,) = simulate(scenario, [3])
    wanted = scenario.excitation.reference(scenario.grid, stream(scenario.key, 3, "excitation"))
    gains = {name: getattr(scenario.controller, name) for name in ("Kp", "Kv", "Ki", "tau")}
    expected = [*commanded(wanted - record.true_angle_m, period, **gains)]
    np.testing.assert_allclose(record.torque, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("period", "late"), [(0.002, 0.001), (0.01, 0.003), (0.01, 0.012)])
def test_a_torque_delay_goes_by_ms_at_any_period(period, late, make):
    scenario = scenario_at(make, period, f"delay.torque = {late}\n")
    (record,) = simulate(scenario, [0])
    ticks = round(period / 0.001)
    acting = np.repeat(record.torque, ticks)
    acting = np.concatenate([np.zeros(round(late / 0.001)), acting])[: len(acting)]
    exact = exact_speed(acting, [np.array([*scenario.nominal.values()])] * len(acting), 0.001)[
        ::ticks
    ]
    error = np.linalg.norm(record.true_speed - exact) / np.linalg.norm(exact)
    assert error < 3e-4
