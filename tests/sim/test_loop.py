"""What goes on between samples and on the way to the log, against exact sampling in 1 ms steps."""

import numpy as np
import pytest

from flexaxis.sim.random_draws import stream
from flexaxis.sim.simulate import simulate

from .conftest import held, system

TICK = 0.001


def exact_ticks(scenario, command):
    """Motor angle and speed at each tick, `command(k, angle)` the torque from it on."""
    transition = held(*system(scenario.nominal.as_dict()), TICK)
    x, angles, speeds = np.zeros(6), [], []
    for k in range(5 * scenario.samples):
        angles.append(x[5])
        speeds.append(x[2])
        x = transition @ np.append(x, command(k, x[5]))
    return np.array(angles), np.array(speeds)


def reference_of(scenario, seed=0):
    rng = stream(scenario.key, seed, "excitation")
    return scenario.excitation.reference(scenario.grid, rng)


def close(ours, reference):
    """1 ms Runge-Kutta steps agree with exact sampling to about 1e-4 of the amplitude."""
    return np.abs(ours - reference).max() < 5e-4 * np.abs(reference).max()


@pytest.mark.parametrize("log", ["mean", "sample", None])
def test_an_inner_loop_is_the_textbook_loop_at_1_khz(log, make):
    scenario = make(f"controller.rate = 1000\n{f'controller.log = {log!r}' if log else ''}\n",
                    duration=2.0)  # fmt: skip
    (record,) = simulate(scenario, [0])
    r = reference_of(scenario)
    wanted = np.interp(np.arange(5 * r.size), 5 * np.arange(r.size), r)
    a, state, commands = np.exp(-TICK / 0.0005), np.zeros(3), []

    def command(k, angle):
        before, speed, integral = state
        error = wanted[k] - angle
        speed = a * speed + (1 - a) * (error - before) / TICK
        s = 4.0 * error + speed
        integral += TICK * 2.0 * s
        state[:] = error, speed, integral
        commands.append(0.22 * (s + integral))
        return commands[-1]

    _, speeds = exact_ticks(scenario, command)
    logged = np.reshape(commands, (-1, 5))
    assert close(record.true_speed, speeds[::5])
    assert close(record.torque, logged[:, 0] if log == "sample" else logged.mean(axis=1))


def test_saturation_limits_what_acts_and_not_what_is_logged(make):
    scenario = make("saturation.torque = 1.0\n", duration=2.0)
    (record,) = simulate(scenario, [0])
    assert np.abs(record.torque).max() > 1.2

    def command(k, angle):
        return np.clip(record.torque[k // 5], -1.0, 1.0)

    assert close(record.true_speed, exact_ticks(scenario, command)[1][::5])


@pytest.mark.parametrize("late", [None, 0.002])
def test_noise_on_the_torque_acts_and_is_not_logged(late, make):
    scenario = make(
        "noise.torque = 0.05\n" + (f"delay.torque = {late}\n" if late else ""), duration=2.0
    )
    (record,) = simulate(scenario, [2])
    noise = 0.05 * stream(scenario.key, 2, "noise.torque").standard_normal(scenario.samples)
    assert not scenario.linear and scenario.sensors["noise"].in_words().endswith(
        "noise of 0.05 N m on the acting torque"
    )
    ticks = round((late or 0.0) / TICK)

    def command(k, angle):
        return (record.torque[(k - ticks) // 5] if k >= ticks else 0.0) + noise[k // 5]

    assert close(record.true_speed, exact_ticks(scenario, command)[1][::5])
