"""Logs of simulated runs: as a robot writes them, and as import reads them."""

import json
import shlex

import h5py
import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.as_log import LONGEST_GAP, LogStyle, logged, write_log
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.days import Days, calendar, known_axis, told_axis, without_faults
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.importing import import_log
from flexaxis.sim.record import load_record
from flexaxis.sim.scenario import load_scenario
from flexaxis.sim.simulate import simulate


@pytest.fixture(scope="module")
def record():
    scenario = find_scenario("fm_step-v1").override({"duration": 11.0})
    return simulate(scenario, [0])[0]


def round_trip(record, style, path, tables):
    write_log(path, logged(record, style, np.random.default_rng(0)), style)
    return import_log(path, {"torque_is": "held"} | tables, burn_in=0.0).record


def test_round_trip_within_the_resolution(record, tmp_path):
    style = LogStyle(units=("ms", "deg", "rpm", "A"), counts=65536, jitter=2e-5, gaps=3)
    back = round_trip(record, style, tmp_path / "log.csv", {})
    assert 3 <= (~back.valid).sum() <= 3 * (LONGEST_GAP + 1)
    assert back.period == pytest.approx(record.period, rel=1e-4)
    there = back.valid  # stamps are off, samples are not
    assert np.max(abs(back.angle - record.angle)[there]) <= np.pi / 65536 + 1e-8
    np.testing.assert_allclose(back.torque[there], record.torque[there], atol=1e-8)
    np.testing.assert_allclose(back.speed[there], record.speed[there], atol=1e-6)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"units": ("degg",)}, "deg"),
        ({"gaps": -1}, "gaps"),
    ],
)
def test_wrong_styles_are_refused(given, word):
    with pytest.raises(LogError, match=word):
        LogStyle(**given)


def test_command(short, tmp_path, capsys):
    words = ["simulate", str(short), "--as-log", "csv", "--units", "deg,A", "--gaps", "2"]
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    for path in (one, other):
        assert main([*words, "-o", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out.splitlines()[0])
    assert said["import"].startswith("flexaxis import")
    assert one.read_bytes() == other.read_bytes()
    head = ["# written by flexaxis", "time [s],torque [A],angle [deg],speed [rad/s]"]
    assert one.read_text().splitlines()[:2] == head
    assert main([*words, "-o", str(tmp_path / "wrong.txt")]) == 2
    assert main(["simulate", str(short), "--gaps", "2", "-o", str(one)]) == 2
    assert "--as-log" in capsys.readouterr().err


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    changes = {"duration": 11.0, "name": "short"}
    path.write_text(find_scenario("fm_step-v1").override(changes).to_toml())
    return path


def test_the_printed_line_imports_the_log(short, tmp_path, capsys):
    log, rec = tmp_path / "a log.csv", tmp_path / "rec.nc"
    words = ["simulate", str(short), "--as-log", "csv", "--units", "deg,mA,ms,rpm"]
    assert main([*words, "-o", str(log), "--json"]) == 0
    printed = shlex.split(json.loads(capsys.readouterr().out)["import"])
    assert main([*printed[1:], "-o", str(rec)]) == 0
    back, true = load_record(rec), simulate(load_scenario(short), [0])[0]
    for name in ("time", "torque", "angle", "speed"):
        np.testing.assert_allclose(getattr(back, name), getattr(true, name), rtol=1e-6, atol=1e-6)


def test_logs_are_written_over_those_of_ours_only(short, tmp_path, capsys):
    log = tmp_path / "raw.csv"
    words = ["simulate", str(short), "--as-log", "csv", "-o", str(log)]
    assert main(words) == 0
    first = log.read_bytes()
    assert main(words) == 0
    assert log.read_bytes() == first
    log.write_text("time,torque,angle\n0,1,2\n")
    assert main(words) == 2
    assert "not written by flexaxis" in capsys.readouterr().err
    assert log.read_text() == "time,torque,angle\n0,1,2\n"


def test_a_record_is_not_written_over_a_log(short, tmp_path, capsys):
    log = tmp_path / "raw.nc"
    with h5py.File(log, "w") as file:
        file["torque"] = [1.0, 2.0]
    before = log.read_bytes()
    assert main(["simulate", str(short), "-o", str(log)]) == 2
    assert "not written by flexaxis" in capsys.readouterr().err
    assert log.read_bytes() == before


@pytest.mark.parametrize("truth", [None, "{}", "[1]", "no json"])
def test_days_do_not_go_among_other_files(truth, tmp_path, capsys):
    mine = tmp_path / "2026-01-02.csv"
    mine.write_text("time,torque,angle\n0,1,2\n")
    if truth is not None:
        (tmp_path / "truth.json").write_text(truth)
    there = sorted(tmp_path.iterdir())
    assert main(["days", "--days", "3", "--duration", "2", "-o", str(tmp_path)]) == 2
    assert "no truth.json of `flexaxis days`" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == there
    assert mine.read_text() == "time,torque,angle\n0,1,2\n"


def test_days_are_written_again_but_not_over_a_log_that_was_put_there(tmp_path, capsys):
    folder = tmp_path / "days"
    words = ["days", "--days", "2", "--from-day", "1", "--duration", "2", "-o", str(folder)]
    assert main([*words, "--days", "3"]) == 0
    (folder / "notes.txt").write_text("mine")
    assert main(words) == 0  # of the earlier set nothing is left that a trend would read
    assert sorted(path.name for path in folder.iterdir()) == [
        "2026-01-01.csv", "2026-01-02.csv", "axis.toml", "notes.txt", "truth.json",
    ]  # fmt: skip
    mine = folder / "2026-01-02.csv"
    mine.write_text("time,torque,angle\n0,1,2\n")
    assert main(words) == 2
    assert "2026-01-02.csv" in capsys.readouterr().err
    assert mine.read_text() == "time,torque,angle\n0,1,2\n"


def test_days_follow_temperature_and_wear():
    scenario = without_faults(find_scenario("wg_fc_step-v1"), 5.0)
    days = Days(days=60, wear={"f_c": 0.2}, from_day=30, warm={"f_c": -0.01}, scatter=0.0)
    plan = calendar(scenario, days, 3)
    assert plan == calendar(scenario, days, 3)
    temperature = np.array([day.temperature for day in plan])
    assert np.ptp(temperature) == pytest.approx(25)
    assert (plan[0].date, plan[-1].date) == ("2026-01-01T06:00", "2026-03-01T06:00")
    factor = np.array([day.factors["f_c"] for day in plan]) / 0.99 ** (temperature - 25)
    np.testing.assert_allclose(factor[:30], 1.0)
    np.testing.assert_allclose(np.diff(factor[29:]), 0.2 / 30)
    same = calendar(scenario, Days(days=60, warm={"f_c": -0.01}, scatter=0.0), 3)
    assert same[:30] == plan[:30]  # so that sets with and without wear share their beginning


def test_days_are_logs_of_the_axis(tmp_path, capsys):
    folder = tmp_path / "days"
    words = ["days", "--days", "3", "--from-day", "1", "--wear", "f_c=+30%", "--duration", "2"]
    assert main([*words, "-o", str(folder), "--json"]) == 0
    assert sorted(p.name for p in folder.iterdir()) == [
        "2026-01-01.csv", "2026-01-02.csv", "2026-01-03.csv", "axis.toml", "truth.json",
    ]  # fmt: skip
    text = (folder / "2026-01-02.csv").read_text().splitlines()
    assert text[0] == "# written by flexaxis" and text[1].endswith(",temp")
    truth = json.loads((folder / "truth.json").read_text())["days"]
    temperatures = [float(line.rpartition(",")[2]) for line in text[2:]]
    assert np.mean(temperatures) == pytest.approx(truth[1]["temperature"] + 0.15, abs=0.05)
    axis = find_axis(str(folder / "axis.toml"))
    assert axis.known
    known = known_axis(find_scenario("wg_fc_step-v1")).model.nominal
    off = {name: axis.model.nominal[name] / value - 1 for name, value in known.items() if value}
    assert off["k_T"] == off["r"] == 0
    others = [abs(part) for name, part in off.items() if name not in {"k_T", "r"}]
    assert all(0 < part <= 0.05 for part in others)
    assert max(others) > 0.02  # of a dozen
    capsys.readouterr()
    assert main(["days", "--wear", "f_q=+12%", "-o", str(tmp_path / "x")]) == 2
    assert main(["days", "--wear", "f_c=12", "-o", str(tmp_path / "x")]) == 2
    assert "percentage" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_bristles_that_stand_for_coulomb_friction_are_no_parameter_of_the_axis():
    """They are a number of the law, so that nobody identifies them."""
    scenario = find_scenario("coulomb_fc_step-v1")
    for axis in (known_axis(scenario), told_axis(scenario, 0)):
        assert "f_c" in axis.model.parameters and "sigma_0" not in axis.model.parameters
        assert axis.model.laws[0].parameters["stiffness"] == 1e4
