"""track says of a log that it is not of the axis, or not in its units."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.track import _limits

J, F, T, N = 0.01, 0.05, 0.004, 2500  # of one mass, k_T = 1; s; samples
AXIS = f"""model = "one_mass"
noise = 0.05
rate = {1 / T}
[nominal]
k_T = 1.0
J_m = {J}
f_m = {F}
"""


def log(path, torque_times, noise=0.05):
    rng = np.random.default_rng(3)
    time = T * np.arange(N)
    torque = 0.5 * np.sin(2 * np.pi * np.array([0.7, 2.3, 9.1])[:, None] * time).sum(axis=0)
    torque += 0.3 * rng.standard_normal(N)
    speed, keep = np.zeros(N), np.exp(-F / J * T)
    for k in range(N - 1):
        speed[k + 1] = keep * speed[k] + (1 - keep) / F * torque[k]
    measured = speed + noise * rng.standard_normal(N)
    rows = zip(time, torque_times * torque, measured, strict=True)
    lines = [",".join(f"{x:.9g}" for x in row) for row in rows]
    path.write_text("\n".join(["time [s],torque [Nm],speed [rad/s]", *lines]) + "\n")
    return path


def tracked(tmp_path, capsys, axis, *more, **spoilt):
    source, toml = log(tmp_path / "log.csv", **spoilt), tmp_path / "axis.toml"
    toml.write_text(axis)
    words = ["track", source, "--model", toml, "--identify", "f_m", *more]
    status = main([str(word) for word in words])
    return status, capsys.readouterr().out


@pytest.mark.parametrize("axis", [AXIS, AXIS.replace("noise = 0.05\n", "")])
def test_its_own_log_is_fine(tmp_path, capsys, axis):
    status, out = tracked(tmp_path, capsys, axis, torque_times=1)
    assert status == 0 and "✓ no parameter changed" in out


def test_a_log_with_more_noise_is_fine_where_the_residual_is_white(tmp_path, capsys):
    axis = AXIS.replace("noise = 0.05\n", "")
    status, _ = tracked(tmp_path, capsys, axis, torque_times=1, noise=8.0)
    assert status == 0


@pytest.mark.parametrize(
    ("times", "said"),
    [(2, "and its errors elsewhere would leave 9"), (-1, "f_m at 10 times"), (0.2, "")],
)
def test_a_torque_in_another_unit_or_sign_is_status_1(tmp_path, capsys, times, said):
    status, out = tracked(tmp_path, capsys, AXIS, "--json", torque_times=times)
    told = json.loads(out)
    assert status == 1
    assert told["doubts"] and said in " ".join(told["doubts"])
    page = (tmp_path / "log-track.html").read_text(encoding="utf-8")
    assert ("the log: signs of torque" in page) == (times < 0)  # what import says of it
    assert page.count("<h2>Estimates</h2>") == 1 and "no parameter changed" not in page


LAW = """f_c = 0.02
[[law]]
kind = "bristle"
drive = { speed_motor = 1.0 }
acts = { speed_motor = "-1/J_m" }
parameters = { coulomb = "f_c", stiffness = 1e4 }
"""


@pytest.mark.parametrize("bounds", [None, np.array([[0.1], [1.0]]), np.array([[0.1] * 2, [1] * 2])])
def test_limits_are_those_that_an_estimator_tells(bounds):
    """One with laws tracks their parameters besides, for which it may tell none."""
    estimator = SimpleNamespace() if bounds is None else SimpleNamespace(bounds=bounds)
    limits = _limits(estimator, 2)
    told = 0 if bounds is None else bounds.shape[1]
    assert np.isnan(_limits(SimpleNamespace(bounds={"f_m": (0, 1)}), 2)).all()
    assert np.isfinite(limits[:, :told]).all() and np.isnan(limits[:, told:]).all()


@pytest.mark.slow
def test_an_axis_with_dry_friction_is_tracked(tmp_path, capsys):
    words = ("--estimator", "ekf")
    status, _ = tracked(tmp_path, capsys, AXIS + LAW, *words, torque_times=1)
    assert status in {0, 1}
