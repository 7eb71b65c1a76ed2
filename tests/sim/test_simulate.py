"""Runs against the exact solution, the textbook loop, and runs in other company."""

import os

import numpy as np
import pytest

from flexaxis.sim.errors import SimulationError
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.random_draws import stream
from flexaxis.sim.record import Record
from flexaxis.sim.simulate import simulate

from .conftest import commanded, exact_speed

ARRAYS = ("time", "torque", "angle", "speed", "increment", "true_speed", "true_angle_m",
          "true_angle_g", "true_angle_a", "true_parameters")  # fmt: skip


def step(parameter, factor=1.5, at=2.0):
    return f"""
[[fault]]
kind = "step"
parameter = "{parameter}"
at = {at}
factor = {factor}
"""


def identical(a: Record, b: Record) -> bool:
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in ARRAYS)


@pytest.mark.parametrize("parameter", [name for name in PARAMETER_NAMES if name != "r"])
def test_speed_is_the_exact_solution_across_a_fault_of(parameter, make):
    factor = 0.7 if parameter == "J_m" else 1.5  # J_m down is the harder way: the loop gain rises
    scenario = make(step(parameter, factor), duration=4.0)
    (record,) = simulate(scenario, [0])
    exact = exact_speed(record.torque, record.true_parameters, scenario.period)
    column = PARAMETER_NAMES.index(parameter)
    assert record.true_parameters[399, column] != record.true_parameters[400, column]
    for part in (slice(0, 400), slice(400, 800)):
        error = record.true_speed[part] - exact[part]
        assert np.linalg.norm(error) < 3e-4 * np.linalg.norm(exact[part])


MEASURED = """feedback = "measured"
noise.angle = 1e-4
encoder.counts = 65536
delay.measurement = 2
controller.Kv = 0.1
"""


@pytest.mark.parametrize(
    ("sensors", "read"),
    [("", "true_angle_m"), ("delay.measurement = 3\nencoder.counts = 2048\n", "true_angle_m"),
     (MEASURED, "angle")],
)  # fmt: skip
def test_torque_is_the_textbook_loop_on_reference_and_angle(sensors, read, make):
    """Pins the order of things in a sample: measure at t_k, then act on [t_k, t_{k+1})."""
    scenario = make(sensors + step("f_m"), duration=3.0)
    (record,) = simulate(scenario, [5])
    rng = stream(scenario.key, 5, "excitation")
    reference = scenario.excitation.reference(scenario.grid, rng)
    error, Kv = reference - getattr(record, read), scenario.controller.Kv
    expected = [*commanded(error, scenario.period, Kv=Kv)]
    np.testing.assert_allclose(record.torque, expected, rtol=1e-9, atol=1e-12)
    assert record.true_speed[0] == record.true_angle_m[0] == 0
    assert record.true_speed[1] != 0  # u[0] is seen for the first time in y[1]


def test_excitation_gives_the_motor_speed_and_torque_it_is_scaled_for(make):
    """The set n1: speed 5 rad/s rms and torque 0.85 N m rms, whatever the phases.

    By Parseval the phases do not matter; measured are 5.004 rad/s and 0.8490 N m.
    """
    records = simulate(make(duration=20.0), range(3))
    for record in records:
        last = slice(2000, 4000)  # one period, in steady state
        assert np.sqrt(np.mean(record.true_speed[last] ** 2)) == pytest.approx(5.0, rel=2e-3)
        assert np.sqrt(np.mean(record.torque[last] ** 2)) == pytest.approx(0.85, rel=2e-3)


@pytest.mark.parametrize(
    "text",
    [
        "",
        'feedback = "measured"\nnoise.angle = 1e-4\nencoder.counts = 65536\n'
        "delay.measurement = 1\ncontroller.Kv = 0.1\n" + step("J_a"),
    ],
    ids=["clean", "everything"],
)
def test_a_record_is_the_same_in_any_batch(text, make):
    scenario = make(text, duration=3.0)
    together = simulate(scenario, [7, 3, 1000, 4])
    assert [record.seed for record in together] == [7, 3, 1000, 4]
    assert identical(simulate(scenario, [1000])[0], together[2])
    assert identical(simulate(scenario, [4, 3])[1], together[1])
    assert identical(simulate(scenario, [7, 3, 1000, 4])[0], together[0])
    assert not np.array_equal(together[0].torque, together[1].torque)


def test_measured_signals_are_truth_and_noise(make):
    scenario = make("noise = { speed = 0.2, angle = 1e-3 }", duration=10.0)
    (record,) = simulate(scenario, [1])
    speed_noise = record.speed - record.true_speed
    angle_noise = record.angle - record.true_angle_m
    # The rms of 2000 values scatters by 1/sqrt(4000) = 1.6 %.
    assert np.std(speed_noise) == pytest.approx(0.2, rel=0.08)
    assert np.std(angle_noise) == pytest.approx(1e-3, rel=0.08)
    assert abs(np.corrcoef(speed_noise, angle_noise)[0, 1]) < 0.1
    increment = np.diff(record.angle) / scenario.period
    assert record.increment[0] == 0
    assert np.allclose(record.increment[1:], increment, rtol=1e-12)


def test_a_record_knows_where_it_is_from(make):
    scenario = make("burn_in = 0.5" + step("k_T", at=0.3), duration=1.0)
    (record,) = simulate(scenario, [12])
    assert record.scenario == scenario.resolved() and record.hash == scenario.hash
    assert (record.seed, record.burn_in, record.period) == (12, 0.5, 0.005)
    assert set(record.versions) == {"python", "flexaxis", "mujoco", "numpy", "mjcf"}
    assert np.array_equal(record.true_parameters, scenario.true_parameters())


def test_an_unstable_run_names_scenario_seed_and_time(make, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario = make(step("k_T", factor=10.0, at=1.0), duration=20.0)
    with pytest.raises(SimulationError) as caught:
        simulate(scenario, [41, 42])
    message = str(caught.value)
    assert message.startswith(("test-v1, seed 41:", "test-v1, seed 42:"))
    assert f"t = {caught.value.time:.3f} s (MuJoCo warning" in message
    assert 1.0 < caught.value.time < 20.0
    assert os.listdir(tmp_path) == []
