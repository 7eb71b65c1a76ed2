"""Logs as public bug reports describe them, of an axis that is known: right, or a message.

Each is made here, by a matrix exponential and numpy; nothing of flexaxis makes the data.
"""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.importing import import_log

pytestmark = pytest.mark.slow
TRUTH = {"J_m": 3e-3, "J_l": 8e-3, "k": 150.0, "d": 0.03, "f_m": 0.02, "f_l": 0.01}
T, N = 2e-3, 6000


def plant(scale=1.0, *, change=1.0, period=T):
    """Return a torque [N m], the motor speed and the motor angle of two masses, from rest."""
    q = {name: scale * value for name, value in TRUTH.items()}
    rng, h = np.random.default_rng(0), period
    lines = np.zeros(2001, complex)
    lines[3:240] = np.exp(2j * np.pi * rng.random(237))
    u = np.resize(np.fft.irfft(lines, 4000), N)
    u *= 2 * scale / u.std()
    A = np.zeros((5, 5))  # motor speed, load speed, twist, motor angle, torque
    A[2, :2], A[3, 0] = (1, -1), 1
    steps = []
    for J_m in (q["J_m"], change * q["J_m"]):
        A[0] = np.array([-q["f_m"] - q["d"], q["d"], -q["k"], 0, 1]) / J_m
        A[1] = np.array([q["d"], -q["d"] - q["f_l"], q["k"], 0, 0]) / q["J_l"]
        steps.append(expm(A * h))
    x, motion = np.zeros(5), np.empty((N, 2))
    for k in range(N):
        motion[k] = x[0], x[3]
        x[4] = u[k]
        x = steps[k >= N // 2] @ x
    return u, motion[:, 0] + 0.02 * rng.standard_normal(N), motion[:, 1]


def found(tmp_path, columns, tables=None, model="two_mass", **options):
    np.savetxt(
        tmp_path / "log.csv", np.column_stack([*columns.values()]), "%.9g", ",",
        header=",".join(columns), comments="",
    )  # fmt: skip
    record = import_log(tmp_path / "log.csv", **{"torque_is": "held"} | (tables or {})).record
    return identify(record, find_axis(model), friction="none", gravity="none", **options)


def columns_of(u, speed, time=None):
    time = T * np.arange(len(u)) if time is None else time
    return {"time [s]": time, "torque [Nm]": u, "speed [rad/s]": speed}


def right(result, scale=1.0, within=3.5):
    assert result.warnings == []
    for name, value in TRUTH.items():
        estimate, sd = result.estimates[name]
        assert abs(estimate - scale * value) < within * sd + 1e-4 * scale * value, name


@pytest.fixture(scope="module")
def log():
    return plant()


@pytest.mark.parametrize("scale", [1e-6, 1e4])
def test_axes_of_any_size_need_no_start(scale, tmp_path):
    """A galvanometer, and a joint seen from the arm."""
    u, speed, _ = plant(scale)
    right(found(tmp_path, columns_of(u, speed)), scale)


def test_a_torque_that_is_logged_two_samples_late_is_found(log, tmp_path):
    u, speed, _ = log
    result = found(tmp_path, columns_of(np.r_[0, 0, u[:-2]], speed))
    assert result.estimates["delay"]["value"] == pytest.approx(-2 * T, rel=0.01)
    assert any("before it is logged" in one.text for one in result.findings)
    right(result)


def test_a_low_passed_speed_is_never_status_0(log, tmp_path):
    u, speed, _ = log
    keep = np.exp(-T / 5e-3)
    result = found(tmp_path, columns_of(u, lfilter([1 - keep], [1, -keep], speed)))
    assert any("low-pass filtered" in text and "log the angle" in text for text in result.warnings)


@pytest.mark.parametrize("lost", ["every 10th", 0.2, 0.01])
def test_lost_rows_do_not_crash_and_give_no_wrong_number(lost, log, tmp_path):
    kept = np.arange(N) % 10 != 9
    if isinstance(lost, float):
        kept = np.random.default_rng(1).random(N) > lost
    columns = {name: values[kept] for name, values in columns_of(*log[:2]).items()}
    result = found(tmp_path, columns)
    if result.warnings:
        assert any("are missing" in text for text in result.warnings)
    else:
        right(result)


def test_a_parameter_that_changes_inside_the_log_is_named_with_its_rows(tmp_path):
    u, speed, _ = plant(change=1.1)
    result = found(tmp_path, columns_of(u, speed))
    (text,) = [text for text in result.warnings if "J_m changed" in text]
    assert "--rows 0:" in text and " at 6." in text.replace(" at 5.9", " at 6.")


def test_a_coarse_encoder_is_no_wrong_model(log, tmp_path):
    u, _, angle = log
    step = 2 * np.pi / 2000
    columns = {
        "time [s]": T * np.arange(N),
        "torque [Nm]": u,
        "angle [counts]": np.rint(angle / step),
    }
    right(found(tmp_path, columns, {"counts": 2000.0}))


def test_a_scaled_current_needs_no_torque_constant(log, tmp_path):
    u, speed, _ = log
    columns = {"time [s]": T * np.arange(N), "torque [A]": u / 0.06, "speed [rad/s]": speed}
    result = found(tmp_path, columns, {"scale": {"torque": 0.06}})
    assert result.units == "SI"
    right(result)


def test_a_log_that_determines_nothing_is_one_sentence(tmp_path):
    t = T * np.arange(N)
    u = np.sin(2 * np.pi * 0.4 * t) + 0.01 * np.random.default_rng(0).standard_normal(N)
    keep = np.exp(-0.03 / 0.011 * T)
    speed = lfilter([0, (1 - keep) / 0.03], [1, -keep], u)
    speed += 0.02 * np.random.default_rng(1).standard_normal(N)
    with pytest.raises(LogError, match=r"explains the output at only . freq.*--model one_mass"):
        found(tmp_path, columns_of(u, speed))
