"""What import sees in logs of an axis that is known, each with one thing wrong with it."""

import h5py
import numpy as np
import pytest
from scipy.signal import butter, cont2discrete, dlsim, lfilter, sosfilt

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.doubts import MOVED, SAMPLED
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.moved import outliers
from flexaxis.experiments.logs.doubts.sampled import updates_every
from flexaxis.experiments.logs.doubts.torque_kind import torque_kind
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.importing import import_log, read_any
from flexaxis.experiments.logs.prepare import unwrapped

T, FINE = 1e-3, 20  # s, steps of the simulation a sample
J, F = 0.01, 0.05  # kg m², N m s/rad


def shaken(seconds=20.0, *, seed=0, low=2.0, high=120.0):
    """Return a torque [N m] with power between two frequencies [Hz], of rms 1."""
    rng = np.random.default_rng(seed)
    sos = butter(4, [2 * low * T, 2 * high * T], "bandpass", output="sos")
    u = sosfilt(sos, rng.standard_normal(round(seconds / T)))
    return u / u.std()


def moved(u, *, coulomb=0.0, between=None):
    """Return angles [rad] of a mass under a torque, held or as given at FINE points a sample."""
    fine = np.repeat(u, FINE) if between is None else between
    h, v, phi = T / FINE, 0.0, 0.0
    angle = np.empty(len(u))
    for k, torque in enumerate(fine.tolist()):  # numbers of Python, which NumPy's are slow beside
        if k % FINE == 0:
            angle[k // FINE] = phi
        push = torque - F * v
        # the friction of a step is what would stop the mass, and no more than there is
        stick = min(max(push + J * v / h, -coulomb), coulomb)
        v += h / J * (push - stick)
        phi += h * v
    return angle


def log(u, angle, **more):
    return {"time": T * np.arange(len(u)), "torque": u, "angle": angle} | more


def imported(folder, columns, tables=None, **treatment):
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    return import_log(folder / "log.h5", tables or {}, **treatment)


def seen(found, name):
    (doubt,) = [check for check in found.checks if check.name == name]
    return doubt


@pytest.fixture(scope="module")
def clean():
    u = shaken()
    return log(u, moved(u))


def test_nothing_is_doubted_of_a_clean_log(clean, tmp_path):
    found = imported(tmp_path, clean, STATED)
    assert [c.name for c in found.checks if c.kind != "ok"] == []
    assert len({check.name for check in found.checks}) == len(SAMPLED + MOVED)


def test_infinite_values_are_called_that(clean, tmp_path):
    torque = clean["torque"].copy()
    torque[[500, 900]] = np.inf
    doubt = seen(imported(tmp_path, clean | {"torque": torque}), "time stamps")
    assert "torque in 2 samples" in doubt.text


def test_what_was_measured_reads_well():
    assert Finding("ok", "", "clocks", 1.0, "samples").measured == "1 sample"
    assert Finding("ok", "", "jitter", 2.5e-11, "% of T").measured == "0 % of T"
    assert Finding("ok", "", "jitter", 0.0115, "% of T").measured == "0.0115 % of T"


@pytest.mark.parametrize("names", [("Zeit", "Moment", "Winkel"), ("temps", "Courant", "ANGLE")])
def test_columns_in_german_and_french(names, clean, tmp_path):
    translated = dict(zip(names, (clean[n] for n in ("time", "torque", "angle")), strict=True))
    record = imported(tmp_path, translated).record
    np.testing.assert_array_equal(record.torque, imported(tmp_path, clean).record.torque)


STATED = {"unit": {"angle": "rad"}}


def test_units_that_nobody_stated_are_doubted(clean, tmp_path):
    """An angle in degrees makes an inertia 57 times too small, and nothing else tells."""
    found = seen(imported(tmp_path, clean | {"angle": np.degrees(clean["angle"]) / 10}), "units")
    assert found.kind == "note" and "--unit angle=rad" in found.command
    assert seen(imported(tmp_path, clean, STATED), "units").kind == "ok"
    slow = {"time": 50 * clean["time"]}  # ms at 20 kHz?
    found = seen(imported(tmp_path, clean | slow, STATED), "units")
    assert found.kind == "note" and found.command == "--unit time=s"
    untimed = {name: clean[name] for name in ("torque", "angle")}
    found = imported(tmp_path, untimed, STATED | {"rate": 1 / (50 * T)})
    assert seen(found, "units").kind == "ok"


@pytest.mark.parametrize("by", [1e6, 0.5, -0.02])
def test_outliers_are_seen_and_what_follows_from_them_is_not_advised(by, clean, tmp_path):
    angle = clean["angle"].copy()
    angle[[700, 4200, 4201, 9100]] += by
    assert by < 0 or by > 5 * np.abs(np.diff(clean["angle"])).max()
    found = imported(tmp_path, clean | {"angle": angle}, STATED)
    doubt = seen(found, "outliers of the motion")
    assert doubt.kind == "problem" and doubt.value == 4 and "0.7, 4.2, 4.201, 9.1" in doubt.text
    assert [check.name for check in found.checks if check.command] == []
    empty = np.where(angle == clean["angle"], angle, np.nan)  # what is advised
    found = imported(tmp_path, clean | {"angle": empty}, STATED)
    assert seen(found, "outliers of the motion").kind == "ok"
    assert seen(found, "signs of torque and motion").kind == "ok"


def test_an_outlier_of_a_speed(clean, tmp_path):
    speed = np.gradient(clean["angle"], T)
    speed[3000] = 50 * np.abs(speed).max()
    columns = {"time": clean["time"], "torque": clean["torque"], "speed": speed}
    assert seen(imported(tmp_path, columns), "outliers of the motion").value == 1


@pytest.mark.parametrize("kind", ["impacts", "coarse", "rest", "wrapped", "noise"])
def test_no_axis_that_moves_has_outliers(kind, clean):
    """Bounces off an end stop, few counts, seldom a move, sawtooth, and noise alone."""
    t, rng = np.arange(20_000) * T, np.random.default_rng(0)
    moved = {
        "impacts": np.abs(np.sin(t)) * 10,
        "coarse": np.round(20 * clean["angle"]),
        "rest": np.where(np.abs(t - 10) < 0.08, np.cos((t - 10) * 60), np.cos(0.08 * 60)),
        "wrapped": (30 * t) % (2 * np.pi),
        "noise": rng.standard_normal(len(t)),
    }
    assert not outliers(unwrapped(moved[kind])[0]).any()


@pytest.mark.parametrize("coulomb", [0.05, 0.2, 0.6])
def test_dry_friction(coulomb, tmp_path):
    u = shaken(10.0)
    angle = moved(u, coulomb=coulomb) + 1e-6 * np.random.default_rng(2).standard_normal(len(u))
    doubt = seen(imported(tmp_path, log(u, angle)), "dry friction")
    assert doubt.kind == "problem" and not doubt.command
    assert "identify looks for it by itself, unless --friction none" in doubt.text


def test_dry_friction_spoils_no_import(tmp_path, capsys):
    """`identify` looks for it: it is to be known, and no reason for a status."""
    u = shaken(10.0)
    angle = moved(u, coulomb=0.2) + 1e-6 * np.random.default_rng(2).standard_normal(len(u))
    imported(tmp_path, log(u, angle))
    line = ["import", str(tmp_path / "log.h5"), "--strict", "--unit", "angle=rad"]
    assert main([*line, "--torque-is", "held"]) == 0
    said = capsys.readouterr().out
    assert "! dry friction: " in said and "--friction auto" not in said


def test_what_is_stated_of_a_torque_is_believed_but_doubted(tmp_path):
    u = shaken(10.0)
    between, measured = current(u, noise=0.02)
    columns = log(measured, moved(u, between=between))
    found = imported(tmp_path, columns, {"torque_is": "held"})
    doubt = seen(found, "torque between samples")
    assert found.record.versions["torque"] == "held"
    assert doubt.kind == "problem" and doubt.command == "--torque-is smooth"


def test_few_reversals_and_pauses(clean, tmp_path):
    u = np.full(4000, 1.0) + 0.1 * shaken(4.0)
    doubt = seen(imported(tmp_path, log(u, moved(u))), "dry friction")
    assert doubt.kind == "note" and "reversals" in doubt.text
    u = clean["torque"].copy()
    u[6000:14000] = 0  # a pause is no standing under torque
    angle = moved(u) + 1e-7 * np.random.default_rng(0).standard_normal(len(u))
    assert "stands" not in seen(imported(tmp_path, log(u, angle)), "dry friction").text


def in_closed_loop(reference, *, gravity=0.0, step=0.0, coulomb=0.0):
    """Return torque and angle of a mass that a controller moves, by an encoder of some step."""
    h, v, phi, before = T / FINE, 0.0, 0.0, 0.0
    u, angle = np.empty(len(reference)), np.empty(len(reference))
    for k, wanted in enumerate(reference):
        measured = np.rint(phi / step) * step if step else phi
        u[k] = 40.0 * (wanted - measured) - 1.0 * (measured - before) / T
        angle[k] = before = measured
        for _ in range(FINE):
            push = u[k] - F * v - gravity * np.sin(phi)
            v += h / J * (push - min(max(push + J * v / h, -coulomb), coulomb))
            phi += h * v
    return u, angle


@pytest.mark.parametrize(
    ("gravity", "bits", "band"),
    [(0.5, 13, (0.5, 5.0)), (0.5, 16, (0.5, 5.0)), (2.0, 16, (0.5, 5.0)),
     (2.0, 13, (0.2, 1.0))],  # the last is slower than the pendulum: the torque holds it up
)  # fmt: skip
def test_gravity_in_a_loop_is_no_sign(gravity, bits, band, tmp_path):
    reference = 0.8 * np.cumsum(shaken(20.0, low=band[0], high=band[1])) * T
    u, angle = in_closed_loop(reference, gravity=gravity, step=2 * np.pi / 2**bits)
    found = imported(tmp_path, log(u, angle))
    doubt = seen(found, "signs of torque and motion")
    assert doubt.kind == "ok" and "--scale" not in doubt.command


def test_dry_friction_is_seen_through_a_controller_without_noise(tmp_path):
    """In closed loop and without noise, the torque is a linear function of the motion as well."""
    reference = 0.5 * np.cumsum(shaken(10.0, low=0.5, high=5.0)) * T
    u, angle = in_closed_loop(reference, coulomb=0.1)
    assert seen(imported(tmp_path, log(u, angle)), "dry friction").kind == "problem"


def test_a_flexible_axis_is_not_dry(tmp_path):
    """Two masses and a spring, lightly damped, through both of whose modes the torque goes."""
    k, d = 400.0, 0.02
    A = np.array([[0, 1, -1], [-k / J, -(d + F) / J, d / J], [k / J, d / J, -(d + F) / J]])
    B, C, D = np.array([[0], [1 / J], [0]]), np.array([[0, 1, 0]]), np.zeros((1, 1))
    u = shaken(10.0)
    _, speed, _ = dlsim(cont2discrete((A, B, C, D), T), u)
    noise = 1e-2 * np.random.default_rng(0).standard_normal(len(u))
    columns = {"time": T * np.arange(len(u)), "torque": u, "speed": speed[:, 0] + noise}
    doubt = seen(imported(tmp_path, columns, {"torque_is": "held"}), "dry friction")
    assert doubt.value < 2 and doubt.kind == "ok"


def current(u, *, noise, seed=3):
    """Return a smooth torque at FINE points a sample, and what its sensor makes of it."""
    sos = butter(2, 2 * 300.0 * T / FINE, output="sos")
    between = sosfilt(sos, np.repeat(u, FINE))
    rng = np.random.default_rng(seed)
    return between, between[::FINE] + noise * rng.standard_normal(len(u))


def test_a_measured_current_is_told_from_a_command(tmp_path):
    u = shaken(10.0)
    between, measured = current(u, noise=0.02)
    found = imported(tmp_path, log(measured, moved(u, between=between)))
    assert found.record.versions["torque"] == "smooth"
    assert "noise of a sensor" in seen(found, "torque between samples").text
    # the same as a command: noise and all moves the motor
    held = u + 0.02 * np.random.default_rng(4).standard_normal(len(u))
    found = imported(tmp_path, log(held, moved(held)))
    assert found.record.versions["torque"] == "held"
    assert "move the motor" in seen(found, "torque between samples").text


@pytest.mark.parametrize(
    ("torque", "name", "kind"),
    [
        (np.repeat(np.random.default_rng(0).standard_normal(500), 4), "", "held"),
        (np.repeat(shaken(8.0, high=10.0)[::8], 8), "iq_meas", "held"),
        (np.sign(np.random.default_rng(0).standard_normal(2000)), "iq_meas", "held"),
        (shaken(5.0), "iq_meas", "held"),  # without any noise: computed
    ],
)
def test_kinds_that_the_torque_alone_tells(torque, name, kind):
    assert torque_kind(torque, T, name=name)[0] == kind


@pytest.mark.parametrize(
    ("name", "kind"), [("iq_ref", "held"), ("iq_actual", "smooth"), ("torque", "held")]
)
def test_names_are_believed_where_the_samples_do_not_tell(name, kind):
    u = shaken(5.0) + 0.01 * np.random.default_rng(0).standard_normal(5000)
    told = torque_kind(u, T, name=name)
    assert told[0] == kind and "do not tell" in told[1]


def test_wrapped_angles_are_unwrapped_and_fast_ones_are_not():
    turning = np.cumsum(np.full(3000, 0.4)) + 0.1 * np.sin(np.arange(3000))
    for low in (0.0, -np.pi):
        wrapped = (turning - low) % (2 * np.pi) + low
        free, wrap = unwrapped(wrapped)
        np.testing.assert_allclose(free - free[0], turning - turning[0], atol=1e-9)
        assert wrap.jumps == len(np.flatnonzero(abs(np.diff(wrapped)) > np.pi))
    # a counter of ten turns
    free, wrap = unwrapped(turning % (20 * np.pi))
    np.testing.assert_allclose(free - free[0], turning - turning[0], atol=1e-9)
    assert wrap.turn == pytest.approx(20 * np.pi) and wrap.fastest < 0.02
    # a fast spindle, more than half a turn in a sample, is left as it was logged
    fast = np.cumsum(4.0 + 0.5 * np.sin(np.arange(3000) / 50))
    free, wrap = unwrapped(fast)
    np.testing.assert_array_equal(free, fast)
    assert wrap.turn == 0
    # and so is one that goes to and fro by many turns at once
    fro = np.tile([0.0, 30.0, 60.0, 0.0], 100)
    np.testing.assert_array_equal(unwrapped(fro)[0], fro)


def test_a_wrapped_angle_too_fast_to_unwrap_is_a_problem(tmp_path):
    u = shaken(5.0)
    fast = moved(u) + 2.9 * np.arange(len(u))
    columns = log(u, fast % (2 * np.pi))
    doubt = seen(imported(tmp_path, columns, {"unit": {"angle": "rad"}}), "wrapping of the angle")
    assert doubt.kind == "problem" and "--speed" in doubt.command


def test_two_clocks(clean, tmp_path):
    angle = np.repeat(clean["angle"][::5], 5)
    doubt = seen(imported(tmp_path, clean | {"angle": angle}), "clocks")
    assert doubt.kind == "problem" and doubt.value == 5 and doubt.command == "--resample 200"
    coarse = np.round(clean["angle"] / 2e-3) * 2e-3  # which repeats its values as well
    assert seen(imported(tmp_path, clean | {"angle": coarse}), "clocks").kind == "ok"
    ramp = np.repeat(np.arange(300.0), 4)  # one step of an encoder in every fourth sample
    assert updates_every(ramp) == 1
    assert updates_every(np.repeat(clean["angle"][:300], 4)) == 4


def test_opposite_signs(clean, tmp_path):
    found = imported(tmp_path, clean | {"angle": -clean["angle"]})
    doubt = seen(found, "signs of torque and motion")
    assert doubt.kind == "problem" and doubt.command == "--scale torque=-1"


def test_clipping(clean, tmp_path):
    u = np.clip(clean["torque"], -1.5, 1.5)
    doubt = seen(imported(tmp_path, log(u, moved(u))), "clipping of the torque")
    assert doubt.kind == "problem" and doubt.value > 5


def test_gaps_and_jitter(clean, tmp_path):
    keep = np.ones(len(clean["time"]), bool)
    keep[3000:3600] = False
    found = imported(tmp_path, {name: values[keep] for name, values in clean.items()})
    assert "600" not in seen(found, "time stamps").text.replace("600 samples", "")
    assert seen(found, "time stamps").value == pytest.approx(3.0, abs=0.1)
    late = clean["time"] + 2e-4 * np.random.default_rng(0).random(len(keep))
    doubt = seen(imported(tmp_path, clean | {"time": late}), "time stamps")
    assert doubt.kind == "note" and doubt.command == "--rate 1000"


def test_a_torque_that_acts_only_where_no_motion_is_logged_is_refused(clean, tmp_path):
    u, angle = np.zeros(len(clean["torque"])), clean["angle"].copy()
    u[3000:3500], angle[3000:3600] = 1.0, np.nan
    with pytest.raises(LogError, match="constant where both are there"):
        imported(tmp_path, clean | {"torque": u, "angle": angle})


def test_slow_motion_ruled_by_friction_is_no_opposite_sign(tmp_path):
    """Far below the corner f/J, 80 Hz, the acceleration leads by 90°, and by more if shifted."""
    u = shaken(40.0, low=0.5, high=2.0)
    speed = np.roll(lfilter([0, T / J], [1, -np.exp(-5.0 * T / J)], u), -3)
    for sign in (1, -1):
        columns = {"time": T * np.arange(len(u)), "torque": sign * u, "speed": speed}
        found = imported(tmp_path, columns, {"torque_is": "held"})
        wanted = "" if sign > 0 else "--scale torque=-1"
        assert seen(found, "signs of torque and motion").command == wanted


def gapped(folder, columns, **more):
    """Return the path of a record from a log without some of its samples, and the record."""
    kept = np.r_[0:3000, 3010 : len(columns["time"])]
    found = imported(folder, {name: values[kept] for name, values in columns.items()}, **more)
    assert (~found.record.valid).sum() == 11
    return found.record.save(folder / "rec.nc"), found.record


def test_options_on_a_record_do_not_make_a_log_of_it(clean, tmp_path):
    path, record = gapped(tmp_path, clean, tables={"torque_is": "smooth"})
    given = read_any(path, {}, burn_in=1.5, resample=None)
    assert given.burn_in == 1.5
    for name in ("time", "torque", "angle", "increment", "valid"):
        np.testing.assert_array_equal(getattr(given, name), getattr(record, name), err_msg=name)
    assert given.versions == record.versions
    same = read_any(path, {"torque_is": "smooth"})
    np.testing.assert_array_equal(same.torque, record.torque)


def test_gaps_are_not_what_the_torque_does_not_explain(clean, tmp_path):
    """Spectra over bridges of 50 ms, in which an angle is a line, are of another motion."""
    found = imported(tmp_path, clean)
    whole = Evidence(found.record, None, None)
    kept = np.ones(len(clean["time"]), bool)
    for start in (4000, 9500, 15500):
        kept[start : start + round(0.05 / T)] = False
    found = imported(tmp_path, {name: values[kept] for name, values in clean.items()}, STATED)
    gaps = Evidence(found.record, None, None)
    slow = whole.spectra.frequency < whole.spectra.band[1]
    assert np.median(1 - gaps.spectra.coherence[slow]) < 2 * np.median(
        1 - whole.spectra.coherence[slow]
    )
    doubted = {check.name for check in found.checks if check.kind != "ok"}
    assert doubted <= {"time stamps", "torque between samples"}


@pytest.mark.parametrize(
    ("tables", "treatment", "word"),
    [
        ({"torque": "current"}, {}, "--torque .and --map. are for logs"),
        ({"unit": {"angle": "deg"}, "scale": {"torque": 2}}, {}, "--unit, --scale .* are for logs"),
        ({"load_angle": "phi_l"}, {}, "--load-angle .* are for logs"),
        ({}, {"resample": 500.0}, "--resample .* import log.h5"),
        ({"torque_is": "held"}, {}, "--torque-is .* import log.h5"),
        ({}, {"burn_in": 19.0}, "--burn-in 19 s"),
        ({}, {"burn_in": -1.0}, "--burn-in -1 s"),
    ],
)
def test_what_a_record_cannot_take_is_refused(tables, treatment, word, clean, tmp_path):
    path, _ = gapped(tmp_path, clean, tables={"torque_is": "smooth"})
    with pytest.raises(LogError, match=f"rec.nc.*{word}"):
        read_any(path, tables, **treatment)


def test_a_record_needs_no_import(clean, tmp_path, capsys):
    path, _ = gapped(tmp_path, clean)
    assert main(["import", str(path)]) == 2
    assert f"go on with flexaxis identify {path}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("top", "verdict"), [(1500.0, "note"), (6000.0, "problem"), (12_000.0, None)]
)
def test_the_speed_of_a_spindle_is_doubted_and_not_refused(top, verdict, clean, tmp_path):
    """60 000 rpm are 6283 rad/s."""
    speed = np.gradient(clean["angle"], T)
    speed *= top / np.percentile(abs(speed), 95)
    columns = {"time": clean["time"], "torque": clean["torque"], "speed": speed}
    if verdict is None:
        with pytest.raises(LogError, match=r"would turn at 1\.2e"):
            imported(tmp_path, columns)
    else:
        found = seen(imported(tmp_path, columns), "units")
        assert found.kind == verdict
        assert (found.command == "--unit speed=UNIT") == (verdict == "problem")
    stated = imported(tmp_path, columns, {"unit": {"speed": "rad/s"}})
    assert seen(stated, "units").kind == "ok"
