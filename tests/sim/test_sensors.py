"""Sensors: delay, noise, rounding and filter by their definitions, one sample or all at a time."""

import math

import numpy as np
import pytest

from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.tables.sensors import (
    DelayConfig,
    EncoderConfig,
    FilterConfig,
    NoiseConfig,
    reading,
)

ANGLE = np.cumsum(np.random.default_rng(0).normal(0, 0.01, (500, 2)), axis=0)
ALL = (DelayConfig(measurement=3), NoiseConfig(speed=0.1, angle=1e-3), EncoderConfig(counts=2048),
       FilterConfig(speed=0.002))  # fmt: skip


def white(purpose):
    """Noise for a purpose; another purpose, other noise."""
    seed = {"noise.speed": 1, "noise.angle": 2}[purpose]
    return np.random.default_rng(seed).normal(size=ANGLE.shape)


def read(*sensors, signal="angle"):
    return reading(sensors, signal, white, period=0.005)(ANGLE)


@pytest.mark.parametrize("signal", ["angle", "speed"])
def test_a_signal_meets_delay_noise_encoder_and_filter_in_turn(signal):
    """The textbook, a sample at a time; as the keys of a scenario stand."""
    assert tuple(parse_scenario(
        'name = "x"\nduration = 1\nfilter.speed = 0.002\nencoder.counts = 2048\n'
        "noise = { angle = 1e-3, speed = 0.1 }\ndelay.measurement = 3\n"
    ).sensors.values()) == ALL  # fmt: skip
    a, step, filtered, expected = math.exp(-0.005 / 0.002), 2 * math.pi / 2048, 0.0, []
    noise = white(f"noise.{signal}")[:, 1]
    for k in range(len(ANGLE)):
        value = ANGLE[k - 3, 1] if k >= 3 else 0.0
        if signal == "angle":
            expected.append(round((value + 1e-3 * noise[k]) / step) * step)
        else:
            filtered = a * filtered + (1 - a) * (value + 0.1 * noise[k])
            expected.append(filtered)
    np.testing.assert_allclose(read(*ALL, signal=signal)[:, 1], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("signal", ["angle", "speed"])
@pytest.mark.parametrize("size", [1, 2, 7])
def test_a_sample_at_a_time_gives_the_same_bits(signal, size):
    one = reading(ALL, signal, white, period=0.005)
    pieces = [one(ANGLE[k : k + size]) for k in range(0, len(ANGLE), size)]
    assert np.concatenate(pieces).tobytes() == read(*ALL, signal=signal).tobytes()
