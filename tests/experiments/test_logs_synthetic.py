"""Logs of an axis that is known: read, imported, identified and tracked."""

import json

import numpy as np
import pytest
from acceptance.axes import held
from scipy.signal import lfilter

from flexaxis.estimators.offline.prediction_error import noise_model
from flexaxis.estimators.offline.trajectory import delayed
from flexaxis.experiments.logs.importing import import_log
from tests.experiments.command import flexaxis

T = 0.001
TRUTH = {"J_m": 4e-3, "J_l": 6e-3, "k": 400.0, "d": 0.05, "f_m": 0.05, "f_l": 0.03}


def bench(seconds=8.0, *, delay=0.0, seed=0, noise=2e-6, change=1.0):
    """Torque and motor angle of two masses by the matrix exponential; torque late by part of T."""
    q, rng, N = TRUTH, np.random.default_rng(seed), round(seconds / T)
    A = np.zeros((4, 4))  # motor angle, load angle, motor speed, load speed
    A[0, 2] = A[1, 3] = 1
    A[2] = np.array([-q["k"], q["k"], -q["d"] - q["f_m"], q["d"]]) / q["J_m"]
    A[3] = np.array([q["k"], -q["k"], q["d"], -q["d"] - q["f_l"]]) / q["J_l"]
    B = np.array([0, 0, 1 / q["J_m"], 0])

    first, second = (held(A, B, part * T) for part in (delay, 1 - delay))
    lines = np.zeros(1001, complex)  # period 2 s, 2 to 200 Hz
    lines[4:401] = np.exp(2j * np.pi * rng.random(397))
    u = np.resize(np.fft.irfft(lines, 2000), N)
    u *= 2 / u.std()
    x, before, angles = np.zeros(4), 0.0, np.empty((N, 2))
    for k in range(N):
        angles[k] = x[:2]
        factor = change if k >= N // 2 else 1.0
        x = first @ np.append(x, before)
        before = u[k] * factor
        x = second @ np.append(x, before)
    return u, angles[:, 0] + noise * rng.standard_normal(N)


def write_csv(path, columns, separator=","):
    head = separator.join(columns)
    rows = zip(*columns.values(), strict=True)
    lines = (separator.join(repr(float(v)) for v in row) for row in rows)
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def columns():
    u, phi = bench()
    return {"t": np.arange(len(u)) * T, "u": u, "phi": phi}


def test_a_change_of_the_torque_constant_is_named(tmp_path, capsys):
    u, phi = bench(change=0.9)
    log = write_csv(
        tmp_path / "log.csv", {"time": np.arange(len(u)) * T, "torque": u, "angle": phi}
    )
    axis = tmp_path / "axis.toml"
    nominal = "\n".join(f"{name} = {value}" for name, value in TRUTH.items())
    axis.write_text(f'model = "two_mass"\n[nominal]\nk_T = 1.0\n{nominal}\n', encoding="utf-8")
    words = ["--model", axis, "--identify", "k_T,1/J_l,k", "-o", tmp_path / "est.nc", "--json"]
    status, out, _ = flexaxis(capsys, "track", log, *words)
    (change,) = json.loads(out)["changes"]
    assert status == 1 and change["name"] == "k_T"
    assert abs(change["time"] - 4.0) <= 0.25  # forty windows of 0.2 s
    assert change["relative"] == pytest.approx(-0.1, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("fraction", [0.3, 0.0, 0.8])
def test_a_delayed_torque_is_recovered(tmp_path, capsys, fraction):
    """The fraction of a sample by which the torque was late, and the parameters with it."""
    u, phi = bench(delay=fraction)
    log = write_csv(
        tmp_path / "log.csv", {"time": np.arange(len(u)) * T, "torque": u, "angle": phi}
    )
    _, out, err = flexaxis(
        capsys, "identify", log, "--model", "two_mass", "--json", "-o", tmp_path / "a.toml"
    )
    told = json.loads(out)["estimates"]
    # the mean of a delayed torque is exact for an inertia's speed, but not for its increments:
    # up to δ(1−δ)/2·(ωT)² at the upper end of the excitation
    assert abs(told["delay"]["value"] / T - fraction) < 0.06, err
    assert told["J_m"]["value"] == pytest.approx(TRUTH["J_m"], rel=0.03)
    assert told["k"]["value"] == pytest.approx(TRUTH["k"], rel=0.03)


def test_delayed_is_exact_for_an_inertia():
    """Speed of an inertia after each sample, by integrating the late torque on a fine grid."""
    u = np.random.default_rng(0).standard_normal(50)
    fine = np.repeat(u, 100)
    late = np.concatenate([np.zeros(130), fine])[: len(fine)]
    exact = late.reshape(50, 100).mean(axis=1)
    np.testing.assert_allclose(delayed(u, 1.3), exact, atol=1e-12)
    t = np.arange(200)
    np.testing.assert_allclose(  # a cubic spline of a sine at 40 samples a period
        delayed(np.sin(t / 6), 0.4, smooth=True)[5:-5], np.sin((t - 0.4) / 6)[5:-5], atol=1e-5
    )


def test_noise_model_finds_the_autoregression():
    a = [1.0, -1.5, 0.8]
    e = lfilter([1.0], a, np.random.default_rng(0).standard_normal(20_000))
    every = np.ones(len(e), bool)
    found = noise_model(e, 30, every)
    assert len(found) == 3
    np.testing.assert_allclose(found, a, atol=0.02)  # standard deviation √((1−a₂²)/N) = .004
    assert len(noise_model(np.random.default_rng(1).standard_normal(20_000), 30, every)) == 1


def test_resampling_keeps_the_mean_torque_and_the_motion(columns, tmp_path, capsys):
    """To 500 Hz: a slow sine is kept, a torque above the new Nyquist frequency is gone."""
    t = columns["t"]
    fast = 5 * np.sin(2 * np.pi * 410 * t)
    data = {
        "time": t,
        "torque": np.sin(2 * np.pi * 5 * t) + fast,
        "angle": np.sin(2 * np.pi * 5 * t),
    }
    log = write_csv(tmp_path / "log.csv", data)
    record = import_log(log, resample=500.0).record
    inner = slice(200, -200)  # off the ends of the filter
    assert record.period == pytest.approx(0.002)
    expected = np.sin(2 * np.pi * 5 * record.time)
    np.testing.assert_allclose(record.angle[inner], expected[inner], atol=1e-3)
    # a held torque is on average half an old sample late, and is meant over the new sample
    middle = np.sin(2 * np.pi * 5 * (record.time + 0.001 - 0.0005))
    np.testing.assert_allclose(record.torque[inner], middle[inner], atol=5e-3)
    assert np.abs(data["torque"][::2] - np.sin(2 * np.pi * 5 * t[::2])).max() > 1  # the naive way
