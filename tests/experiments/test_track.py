"""track: an estimator on a log, what changed in it, and whether it is of this axis."""

import json

import numpy as np
import pytest

from tests.experiments.command import flexaxis

J, F, T, N = 0.01, 0.05, 0.004, 5000  # of one mass, k_T = 1; s; samples
TIME = T * np.arange(N)
AXIS = f"""model = "one_mass"
noise = 0.05
error = 0.05
rate = {1 / T}
[nominal]
k_T = 1.0
J_m = {J}
f_m = {F}
"""
LAW = """f_c = 0.02
[[law]]
kind = "bristle"
drive = { speed_motor = 1.0 }
acts = { speed_motor = "-1/J_m" }
parameters = { coulomb = "f_c", stiffness = 1e4 }
"""


def written(  # noqa: PLR0917
    path, torque_times=1.0, friction=F, still=0, kept=slice(None), brake=N, angle=False
):
    rng = np.random.default_rng(3)
    torque = 0.5 * np.sin(2 * np.pi * np.array([0.7, 2.3, 9.1])[:, None] * TIME).sum(axis=0)
    torque += 0.3 * rng.standard_normal(N)
    torque[:still] = 0.0
    speed, turned, f = np.zeros(N), np.zeros(N), np.broadcast_to(friction, N)
    for k in range(min(N - 1, brake)):
        keep, final = np.exp(-f[k] / J * T), torque[k] / f[k]
        speed[k + 1] = keep * speed[k] + (1 - keep) * final
        turned[k + 1] = final * T + (speed[k] - final) * (1 - keep) * J / f[k]
    # the angle is exact to the rounding of %.9g; the speed has white noise
    y = np.cumsum(turned) if angle else speed + 0.05 * rng.standard_normal(N)
    rows = np.column_stack([TIME, torque_times * torque, y])[kept]
    head = f"time [s],torque [Nm],{'angle [rad]' if angle else 'speed [rad/s]'}"
    np.savetxt(path, rows, "%.9g", ",", header=head, comments="")
    return path


def tracked(tmp_path, capsys, axis=AXIS, *more, **log):
    source, toml = written(tmp_path / "log.csv", **log), tmp_path / "axis.toml"
    toml.write_text(axis)
    words = ("--model", toml, "--identify", "f_m", "--json", *more)
    status, out, _ = flexaxis(capsys, "track", source, *words)
    return status, json.loads(out)


@pytest.mark.parametrize("axis", [AXIS, AXIS.replace("noise = 0.05\n", "")])
def test_its_own_log_is_fine(tmp_path, capsys, axis):
    status, told = tracked(tmp_path, capsys, axis)
    assert status == 0 and told["changes"] == [] and told["doubts"] == []
    assert told["last"]["f_m"] == pytest.approx(F, rel=0.03)
    page = (tmp_path / "log-track.html").read_text(encoding="utf-8")
    assert "no parameter changed" in page and page.count("<svg") == 1


def test_problems_of_the_identification_are_repeated(tmp_path, capsys):
    tracked(tmp_path, capsys, AXIS.replace("[nominal]", 'problems = ["no fit"]\n[nominal]'))
    assert "no fit" in (tmp_path / "log-track.html").read_text(encoding="utf-8")


FRACTION = TIME / TIME[-1]
FORMS = {
    "step": (F * np.where(FRACTION < 0.5, 1.0, 0.7), "step", -0.3),
    "ramp": (F * (1 - 0.3 * FRACTION), "drift", -0.3),
    "exponential": (F * (1 - 0.3 * (1 - np.exp(-4 * FRACTION))), "drift", -0.3),
    "sine": (F * (1 - 0.2 * np.sin(2 * np.pi * FRACTION)), "drift", 0.5),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_change_is_told_as_what_it_is(form, tmp_path, capsys):
    friction, kind, size = FORMS[form]
    status, told = tracked(tmp_path, capsys, friction=friction)
    (change,) = told["changes"]
    assert (status, change["kind"]) == (1, kind)
    assert change["relative"] == pytest.approx(size, abs=0.07)


def test_after_a_standstill_only_the_change_is_told(tmp_path, capsys):
    assert not tracked(tmp_path, capsys, still=2000)[1]["changes"]
    friction = np.where(TIME < 14.0, F, 1.5 * F)
    _, told = tracked(tmp_path, capsys, still=2000, friction=friction)
    (change,) = told["changes"]
    assert abs(change["time"] - 14.0) < 1.0 and change["relative"] == pytest.approx(0.5, abs=0.06)


def test_a_brake_from_outside_is_no_change_of_friction(tmp_path, capsys):
    status, told = tracked(tmp_path, capsys, AXIS, "--identify", "1/J_m", brake=4300)
    assert status == 0 and not told["changes"]
    assert "stands still between 17" in (tmp_path / "log-track.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("angle", [False, True])
@pytest.mark.parametrize("size", [0.0, 0.2])
def test_the_torque_in_a_long_gap_is_unknown(size, angle, tmp_path, capsys):
    """The gap neither hides the step at 14 s nor looks like a change."""
    kept = np.ones(N, bool)
    kept[2000:2150] = False
    friction = np.where(TIME < 14.0, F, (1 + size) * F)
    status, result = tracked(tmp_path, capsys, kept=kept, friction=friction, angle=angle)
    assert "a gap of 0.6 s begins at 8.0 s" in (tmp_path / "log-track.html").read_text("utf-8")
    assert status == bool(size) == len(result["changes"])
    for change in result["changes"]:
        assert abs(change["time"] - 14.0) < 0.5
        assert change["relative"] == pytest.approx(size, abs=0.05)


@pytest.mark.parametrize("gaps", [1, 5, 40])
def test_gaps_are_no_changes(gaps, tmp_path, capsys):
    rng, kept = np.random.default_rng(gaps), np.ones(N, bool)
    for begin in rng.integers(100, N - 100, gaps):
        kept[begin : begin + rng.integers(1, 20)] = False
    status, told = tracked(tmp_path, capsys, kept=kept)
    assert status == 0 and not told["changes"]


@pytest.mark.parametrize(
    ("times", "said"),
    [(2, ", but at least 8"), (-1, "another unit or sign"), (0.2, "")],
)
def test_a_torque_in_another_unit_or_sign_is_status_1(tmp_path, capsys, times, said):
    status, told = tracked(tmp_path, capsys, torque_times=times)
    assert status == 1 and told["doubts"] and said in " ".join(told["doubts"])


@pytest.mark.slow
def test_an_axis_with_dry_friction_needs_an_estimator_that_knows_it(tmp_path, capsys):
    _, told = tracked(tmp_path, capsys, AXIS + LAW, "--estimator", "glr")
    assert told["last"].keys() == {"f_m", "f_c"}  # k_T is only a scale
    written(tmp_path / "log.csv")
    words = ["track", tmp_path / "log.csv", "--model", tmp_path / "axis.toml", "--identify", "f_m"]
    status, _, err = flexaxis(capsys, *words, "--estimator", "ekf")
    assert status == 2 and "glr" in err
