"""Sensors: rounding, increments and delays by their definitions."""

import numpy as np

from flexaxis.sim.sensors import angle_increment, delayed, measured_angle

ANGLE = np.cumsum(np.random.default_rng(0).normal(0, 0.01, (500, 2)), axis=0)


def test_ideal_encoder_adds_the_noise_and_nothing_else():
    noise = np.random.default_rng(1).normal(0, 0.01, ANGLE.shape)
    assert np.array_equal(measured_angle(ANGLE, noise, counts=0), ANGLE + noise)
    assert np.array_equal(measured_angle(ANGLE, 0.0, counts=0), ANGLE)


def test_encoder_reads_the_nearest_count():
    step = 2 * np.pi / 2048
    read = measured_angle(ANGLE, 0.0, counts=2048)
    counts = read / step
    assert np.max(np.abs(counts - np.round(counts))) < 1e-9
    assert np.max(np.abs(read - ANGLE)) <= step / 2 * (1 + 1e-12)
    # Rounding is uniform over a count: rms step/sqrt(12), here within the scatter of 1000 values.
    assert np.isclose(np.std(read - ANGLE), step / np.sqrt(12), rtol=0.1)


def test_increments_add_up_to_the_angle_and_start_at_zero():
    increment = angle_increment(ANGLE, period=0.005)
    assert not increment[0].any()
    assert np.allclose(ANGLE[0] + np.cumsum(increment, axis=0) * 0.005, ANGLE, atol=1e-12)


def test_delay_shifts_and_begins_at_rest():
    assert delayed(ANGLE, 0) is not ANGLE and np.array_equal(delayed(ANGLE, 0), ANGLE)
    late = delayed(ANGLE, 3)
    assert not late[:3].any() and np.array_equal(late[3:], ANGLE[:-3])
    assert not delayed(ANGLE[:2], 5).any() and delayed(ANGLE[:2], 5).shape == (2, 2)
