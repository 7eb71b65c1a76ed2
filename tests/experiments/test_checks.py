"""What import finds in logs of an axis that is known, each with one thing wrong with it."""

import re

import h5py
import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from flexaxis.experiments.logs.checks import outliers
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.signals import Log, resolution, rhythm, unwrapped

T, FINE = 1e-3, 20  # s, steps of the simulation a sample
J, F = 0.01, 0.05  # kg m², N m s/rad
STATED = {"unit": {"angle": "rad"}}


def shaken(seconds=10.0, *, seed=0, low=2.0, high=120.0):
    """Return a torque [N m] with power between two frequencies [Hz], of rms 1."""
    rng = np.random.default_rng(seed)
    sos = butter(4, [2 * low * T, 2 * high * T], "bandpass", output="sos")
    u = sosfilt(sos, rng.standard_normal(round(seconds / T)))
    return u / u.std()


def moved(u):
    """Return angles [rad] of a mass under a held torque."""
    fine, h = np.repeat(u, FINE), T / FINE
    keep = np.exp(-F / J * h)
    speed = lfilter([0, (1 - keep) / F], [1, -keep], fine)
    return np.cumsum(np.r_[0.0, h * (speed[1:] + speed[:-1]) / 2])[::FINE]


def log(u, angle, **more):
    return {"time": T * np.arange(len(u)), "torque": u, "angle": angle} | more


def imported(folder, columns, tables=None, **treatment):
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    return import_log(folder / "log.h5", **(tables or {}), **treatment)


def seen(result, name):
    (check,) = [check for check in result.checks if check.name == name]
    return check


@pytest.fixture(scope="module")
def clean():
    u = shaken()
    return log(u, moved(u))


def test_nothing_speaks_against_a_clean_log(clean, tmp_path):
    checks = imported(tmp_path, clean, STATED).checks
    assert {check.kind for check in checks} <= {"ok", "info"} and len(checks) > 6


@pytest.mark.parametrize("names", [("Zeit", "Moment", "Winkel"), ("temps", "Courant", "ANGLE")])
def test_columns_in_german_and_french(names, clean, tmp_path):
    translated = dict(zip(names, clean.values(), strict=True))
    record = imported(tmp_path, translated).record
    np.testing.assert_array_equal(record.torque, imported(tmp_path, clean).record.torque)


def test_units_that_are_not_stated_are_named(clean, tmp_path):
    """An angle in degrees makes an inertia 57 times too small, and nothing else tells."""
    check = seen(imported(tmp_path, clean), "units")
    assert check.kind == "note" and "the angle is in rad (not deg, rev or mm)" in check.text
    assert check.command == "--unit angle=UNIT"
    slow = {"time": 50 * clean["time"]}  # ms at 20 kHz?
    assert seen(imported(tmp_path, clean | slow, STATED), "units").command == "--unit time=UNIT"
    speed = np.degrees(np.gradient(clean["angle"], T))
    with pytest.raises(LogError, match="--unit speed=deg/s"):
        imported(tmp_path, clean | {"speed": speed})


@pytest.mark.parametrize("by", [1e6, 0.5, -0.02])
def test_outliers_are_named_and_hide_other_checks(by, clean, tmp_path):
    angle = clean["angle"].copy()
    angle[[700, 4200, 4201, 9100]] += by
    result = imported(tmp_path, clean | {"angle": angle}, STATED)
    check = seen(result, "outliers of the motion")
    assert check.kind == "problem" and "0.7, 4.2, 4.201, 9.1 s (4 outliers)" in check.text
    assert not any(check.name.startswith("signs") for check in result.checks)
    empty = np.where(angle == clean["angle"], angle, np.nan)  # what is advised
    result = imported(tmp_path, clean | {"angle": empty}, STATED)
    assert seen(result, "outliers of the motion").kind == "ok"


@pytest.mark.parametrize("kind", ["impacts", "coarse", "rest", "wrapped", "noise"])
def test_no_axis_that_moves_has_outliers(kind, clean):
    """Bounces off an end stop, few counts, seldom a move, sawtooth, and noise alone."""
    t = np.arange(20_000) * T
    motion = {
        "impacts": np.abs(np.sin(t)) * 10,
        "coarse": np.round(20 * clean["angle"]),
        "rest": np.where(np.abs(t - 10) < 0.08, np.cos((t - 10) * 60), np.cos(0.08 * 60)),
        "wrapped": (30 * t) % (2 * np.pi),
        "noise": np.random.default_rng(0).standard_normal(len(t)),
    }
    assert not outliers(unwrapped(motion[kind])[0]).any()


WHITE = np.random.default_rng(0).standard_normal(5000)
NOISY = shaken(5.0) + 0.01 * WHITE


@pytest.mark.parametrize(
    ("torque", "column", "kind"),
    [
        (np.repeat(WHITE[:500], 4), "iq_meas", "held"),
        (np.sign(WHITE), "iq_meas", "held"),
        (NOISY, "iq_act", "smooth"),
        (NOISY, "iq_ref", "held"),
    ],
)
def test_the_kind_of_a_torque_by_its_shape_and_else_by_its_name(torque, column, kind, tmp_path):
    still = np.random.default_rng(1).standard_normal(len(torque))  # which shows nothing
    columns = {"time": T * np.arange(len(torque)), column: torque, "speed": still}
    result = imported(tmp_path, columns, {"torque": column})
    assert result.record.versions["torque"] == kind


def test_wrapped_angles_are_unwrapped_and_fast_ones_are_not():
    turning = np.cumsum(np.full(3000, 0.4)) + 0.1 * np.sin(np.arange(3000))
    for turn, low in ((2 * np.pi, 0.0), (2 * np.pi, -np.pi), (20 * np.pi, 0.0)):
        wrapped = (turning - low) % turn + low
        free, turned = unwrapped(wrapped)
        np.testing.assert_allclose(free - free[0], turning - turning[0], atol=1e-9)
        assert turned == pytest.approx(turn)
    # a fast spindle, more than half a turn in a sample, is left as it was logged
    fast = np.cumsum(4.0 + 0.5 * np.sin(np.arange(3000) / 50))
    np.testing.assert_array_equal(unwrapped(fast)[0], fast)
    # and so is one that goes to and fro by many turns at once
    fro = np.tile([0.0, 30.0, 60.0, 0.0], 100)
    np.testing.assert_array_equal(unwrapped(fro)[0], fro)


def test_a_wrapped_angle_too_fast_to_unwrap_is_a_problem(tmp_path):
    u = shaken(5.0)
    fast = moved(u) + 2.9 * np.arange(len(u))
    check = seen(imported(tmp_path, log(u, fast % (2 * np.pi)), STATED), "wrapping of the angle")
    assert check.kind == "problem" and "--speed" in check.command


def test_a_signal_of_a_slower_clock_or_interpolated(clean, tmp_path):
    k = np.arange(len(clean["time"]))
    held = np.repeat(clean["angle"][::5], 5)
    check = seen(imported(tmp_path, clean | {"angle": held}), "clocks")
    assert check.kind == "problem" and check.command == "--resample 200"
    lines = np.interp(k, k[::5], clean["angle"][::5])
    check = seen(imported(tmp_path, clean | {"angle": lines}), "clocks")
    assert check.kind == "problem" and check.command == "--resample 200"
    coarse = np.round(clean["angle"] / 2e-3) * 2e-3  # which repeats its values as well
    assert rhythm(coarse) == (1, 0, False)
    ramp = np.repeat(np.arange(300.0), 4)  # one step of an encoder in every fourth sample
    assert rhythm(ramp) == (1, 0, False)


def test_of_an_interpolated_log_the_samples_are_taken(tmp_path):
    u = shaken()
    angle = moved(u)
    k = np.arange(4 * len(u) - 3)
    lines = {n: np.interp(k, k[::4], x) for n, x in log(u, angle).items()}
    result = imported(tmp_path, {n: np.round(x, 7) for n, x in lines.items()}, STATED)
    assert result.record.period == pytest.approx(T)
    np.testing.assert_allclose(result.record.angle, angle, atol=1e-7)
    assert "one of every 4 rows" in seen(result, "clocks").text


def test_opposite_signs(clean, tmp_path):
    check = seen(
        imported(tmp_path, clean | {"angle": -clean["angle"]}), "signs of torque and motion"
    )
    assert check.kind == "problem" and check.command == "--scale torque=-1"


def test_slow_motion_ruled_by_friction_is_no_opposite_sign(tmp_path):
    """Far below the corner f/J, 80 Hz, the acceleration leads by 90°, and by more if shifted."""
    u = shaken(40.0, low=0.5, high=2.0)
    speed = np.roll(lfilter([0, T / J], [1, -np.exp(-5.0 * T / J)], u), -3)
    for turned, wanted in ((1, ""), (-1, "--scale torque=-1")):
        columns = {"time": T * np.arange(len(u)), "torque": turned * u, "speed": speed}
        check = seen(imported(tmp_path, columns), "signs of torque and motion")
        assert check.command == wanted


def test_gravity_in_a_loop_is_no_sign(tmp_path):
    """A controller holds a pendulum up, and moves it more slowly than it would swing."""
    reference = 0.8 * np.cumsum(shaken(20.0, low=0.2, high=1.0)) * T
    h, v, phi, before, step = T / FINE, 0.0, 0.0, 0.0, 2 * np.pi / 2**13
    u, angle = np.empty(len(reference)), np.empty(len(reference))
    for k, wanted in enumerate(reference):
        measured = np.rint(phi / step) * step
        u[k] = 40.0 * (wanted - measured) - 1.0 * (measured - before) / T
        angle[k] = before = measured
        for _ in range(FINE):
            v += h / J * (u[k] - F * v - 2.0 * np.sin(phi))
            phi += h * v
    assert seen(imported(tmp_path, log(u, angle)), "signs of torque and motion").kind == "ok"


def test_clipping(clean, tmp_path):
    u = np.clip(clean["torque"], -1.5, 1.5)
    check = seen(imported(tmp_path, log(u, moved(u))), "clipping of the torque")
    assert check.kind == "problem" and "1.5" in check.text


def test_gaps_and_jitter(clean, tmp_path):
    keep = np.ones(len(clean["time"]), bool)
    keep[3000:3600] = False
    check = seen(imported(tmp_path, {n: x[keep] for n, x in clean.items()}), "time stamps")
    assert "6 % of the samples are missing (number of gaps: 1," in check.text
    late = clean["time"] + 2e-4 * np.random.default_rng(0).random(len(keep))
    check = seen(imported(tmp_path, clean | {"time": late}), "time stamps")
    assert check.kind == "note" and "use --rate 1000" in check.text
    torque = clean["torque"].copy()
    torque[[500, 900]] = np.inf
    record = imported(tmp_path, clean | {"torque": torque}).record
    assert not record.valid[[500, 900]].any() and np.isfinite(record.torque).all()


@pytest.mark.parametrize(("period", "tick"), [(1.25e-3, 1e-3), (20e-3, 15.6e-3), (1e-3, 2e-3)])
def test_stamps_coarser_than_the_sampling_need_the_rate(period, tick, clean, tmp_path):
    stamps = tick * np.floor(period * np.arange(len(clean["time"])) / tick)
    columns = clean | {"time": stamps}
    if tick > period:
        with pytest.raises(LogError, match=r"does not advance .* --rate HZ"):
            imported(tmp_path, columns)
    else:
        check = seen(imported(tmp_path, columns, STATED), "time stamps")
        rate = float(re.search(r"--rate (\S+)", check.text)[1])
        assert rate == pytest.approx(1 / period, rel=1e-3)
    record = imported(tmp_path, columns, STATED | {"rate": 1 / period}).record
    assert record.period == pytest.approx(period) and record.valid is None


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda t: np.r_[t[:500], t[499:]][: len(t)], "does not advance at 1 rows"),
        (
            lambda t: np.r_[t[:6000], t[:4000]],
            "If a new log begins at row 6000, select one log with --rows 0:6000",
        ),
    ],
)
def test_time_that_does_not_advance_is_refused_with_its_cause(spoil, said, clean, tmp_path):
    with pytest.raises(LogError, match=said):
        imported(tmp_path, clean | {"time": spoil(clean["time"])})


def test_irregular_stamps_are_refused_with_what_to_do(tmp_path):
    t = np.cumsum(np.random.default_rng(0).choice([1.2e-3, 2.86e-3, 5e-3], 3000))
    columns = {"time": t, "torque": np.sin(6 * np.pi * t), "speed": np.cos(7 * t)}
    with pytest.raises(LogError, match=r"steps of 0\.0012 s to 0\.005 s\. Resample .* --rate"):
        imported(tmp_path, columns)


def test_a_torque_that_acts_only_where_no_motion_is_logged_is_refused(clean, tmp_path):
    u, angle = np.zeros(len(clean["torque"])), clean["angle"].copy()
    u[3000:3500], angle[3000:3600] = 1.0, np.nan
    with pytest.raises(LogError, match="constant in all rows that contain both signals"):
        imported(tmp_path, clean | {"torque": u, "angle": angle})


def test_a_record_takes_a_burn_in_and_no_columns(clean, tmp_path):
    kept = np.r_[0:3000, 3010 : len(clean["time"])]
    record = imported(tmp_path, {n: x[kept] for n, x in clean.items()}).record
    assert (~record.valid).sum() == 11
    path = record.save(tmp_path / "rec.nc")
    again = import_log(path, burn_in=1.5).record
    assert again.burn_in == 1.5 and again.versions == record.versions
    np.testing.assert_array_equal(again.increment, record.increment)
    for options, said in (
        ({"torque": "current"}, "--torque apply only to logs"),
        ({"resample": 500.0}, "--resample .* when you import log.h5"),
        ({"burn_in": 19.0}, "--burn-in 19 s"),
    ):
        with pytest.raises(LogError, match=said):
            import_log(path, **options)


@pytest.mark.parametrize("counts", [8, 24, 500, 65536])
def test_the_step_of_an_encoder_however_few_counts(counts):
    """Slow and fast motion; noise has no step."""
    step, k = 2 * np.pi / counts, np.arange(5000)
    for speed in (0.01, 1.0, 30.0):
        angle = step * np.rint(speed * np.sin(k / 10 + np.sin(k / 37)) / step)
        assert resolution(np.round(angle, 9)) == pytest.approx(step, rel=1e-4) or speed < step
    assert resolution(np.random.default_rng(0).standard_normal(5000)) == 0.0


def test_the_noise_of_an_encoder_is_that_of_its_steps_and_not_of_printed_digits():
    step, ok = 2 * np.pi / 500, np.ones(5000, bool)
    angle = np.round(step * np.rint(20 * np.sin(np.arange(5000) / 50)), 6)
    log = Log(angle, np.diff(angle, prepend=0) / T, ok, T, "increment", False, True, angle)
    assert log.rounding == pytest.approx(step / np.sqrt(6) / T, rel=1e-3)
