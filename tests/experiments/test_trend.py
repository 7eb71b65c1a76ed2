"""A trend over logs of an axis that is integrated here: one mass with friction, exactly."""

import json
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from identify_axes import VALUES
from log_health_tables import record_of
from page_data import text_of

from flexaxis.estimators.models.axes import MODELS
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import Axis, find_axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import find_logs
from flexaxis.experiments.logs.trend import estimates as trend
from flexaxis.experiments.logs.trend.covariates import dated, found_in
from flexaxis.experiments.logs.trend.refit import refit
from flexaxis.experiments.logs.trend.trend import ailments, common
from flexaxis.sim.record import Record

T, N = 0.002, 1500
J, F = 4e-3, 0.05
AXIS = 'model = "one_mass"\n[nominal]\nk_T = 1.0\nJ_m = 4e-3\nf_m = 0.05\n'


def kept(folder):
    """Return the rows of a trend, in the order in which they came."""
    with closing(sqlite3.connect(folder / "rows.sqlite")) as db:
        lines = db.execute("SELECT line FROM lines ORDER BY rowid").fetchall()
    return [json.loads(line) for (line,) in lines]


def change(folder, query, *given):
    with closing(sqlite3.connect(folder / "rows.sqlite")) as db, db:
        db.execute(query, given)


def driven(friction, *, seed=0, offset=0.0, speed=0.0, inertia=J):
    """One mass with a held torque, by its closed solution; speed with noise of .05 rad/s."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(N // 10), 10)
    keep = np.exp(-friction * T / inertia)
    y = np.empty(N)
    for k in range(N):
        y[k] = speed
        speed = keep * speed + (1 - keep) / friction * (u[k] + offset)
    return Record(time=T * np.arange(N), torque=u, speed=y + 0.05 * rng.standard_normal(N))


def write(path, record, temperature, date=None):
    rows = np.column_stack([record.time, record.torque, record.speed])
    head = f"# date: {date}\n" if date else ""
    lines = "\n".join(",".join(map(repr, [*row, float(temperature)])) for row in rows.tolist())
    path.write_text(f"{head}time [s],torque [Nm],speed [rad/s],temp\n{lines}\n")


def alike(folder, odd=None):
    """Write twelve logs of one axis; the seventh may be another one."""
    for day in range(12):
        record = odd if odd is not None and day == 6 else driven(F, seed=50 + day)
        write(folder / f"2026-05-{day + 1:02}.csv", record, day)


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    """24 days: friction falls by 1 % a kelvin, and rises by 15 % on the 13th; a log is broken."""
    folder, rng = tmp_path_factory.mktemp("logs"), np.random.default_rng(1)
    (folder / "axis.toml").write_text(AXIS)
    for day in range(24):
        warm = 20 + 8 * np.sin(day / 2) + rng.standard_normal()
        friction = F * np.exp(-0.01 * (warm - 20)) * (1.15 if day >= 12 else 1.0)
        write(folder / f"2026-05-{day + 1:02}.csv", driven(friction, seed=day), warm)
    (folder / "2026-05-25.csv").write_text("time,torque,speed\n0,1,2\n1,2\n")
    return folder


def words(of, axis, output):
    return ["trend", *map(str, of), "--model", str(axis), "-o", str(output), "--torque-is", "held"]


@pytest.fixture(scope="module")
def done(days, tmp_path_factory):
    """A trend of the days, the rows of which need not be made again."""
    folder = tmp_path_factory.mktemp("done") / "t"
    main(words([days], days / "axis.toml", folder))
    return folder


@pytest.fixture
def trended(days, done, tmp_path, capsys):
    """`flexaxis trend` of the days, or of other logs: status, and what it printed."""

    def run(*more, of=(days,), output=tmp_path / "t", axis=days / "axis.toml"):
        usual = (of, output, axis) == ((days,), tmp_path / "t", days / "axis.toml")
        if usual and not output.exists():
            shutil.copytree(done, output)
        return main([*words(of, axis, output), *map(str, more)]), *capsys.readouterr()

    return run


@pytest.mark.slow
def test_wear_is_found_beside_the_temperature(trended, tmp_path):
    status, out, _ = trended("--covariate", "temp", "--json")
    assert status == 1
    said = json.loads(out)
    friction = said["parameters"]["f_m"]
    assert friction["verdict"] == "changed"
    (change,) = friction["changes"]
    assert (change["shape"], change["since"]) == ("step", "2026-05-13")
    assert abs(change["size"] - 0.15) < 3 * change["sd"] < 0.06
    slope = friction["covariates"]["temp"]
    assert abs(slope["slope"] + 0.01) < 3 * slope["sd"] < 0.006
    assert said["parameters"]["J_m"]["verdict"] == "steady"
    ((log, problem),) = said["problems"].items()
    assert log == "2026-05-25.csv"
    assert "unexpected" not in problem
    page = text_of((tmp_path / "t" / "report.html").read_text())
    assert "f_m rose at once by 15" in page
    rows = [row for row in kept(tmp_path / "t") if not row["problem"]]
    assert all(abs(row["offset"]["value"]) < 4 * row["offset"]["sd"] for row in rows)
    assert "2026-05-25.csv" in page


def test_without_a_covariate_it_says_so(trended):
    status, out, _ = trended()
    assert status in {0, 1}
    assert "cannot be told apart" in out or "cannot be told without" in out


def test_nothing_is_computed_twice(trended, tmp_path, monkeypatch):
    output = tmp_path / "t"
    trended()
    before = kept(output)
    assert len(before) == 25
    change(output, "DELETE FROM lines WHERE rowid > 23")
    calls = []
    monkeypatch.setattr(trend, "refit", lambda *a: calls.append(a) or refit(*a))
    trended("--covariate", "temp")
    assert len(calls) <= 2
    assert kept(output) == before
    calls.clear()
    trended("--covariate", "temp")
    assert not calls


@pytest.mark.slow
def test_other_processes_give_the_same_rows(trended, tmp_path):
    trended(output=tmp_path / "one")
    trended("--jobs", "2", output=tmp_path / "two")
    one, two = ({row["case"]: row for row in kept(tmp_path / name)} for name in ("one", "two"))
    assert one == two


def test_a_file_of_covariates(trended, tmp_path):
    trended()
    rows = [row for row in kept(tmp_path / "t") if not row["problem"]]
    table = tmp_path / "air.csv"
    lines = [f"{row['log'].removesuffix('.csv')},{row['columns']['temp']}" for row in rows]
    table.write_text("\n".join(["log,air", *lines]) + "\n")
    _, out, _ = trended("--covariate", table, "--json")
    slope = json.loads(out)["parameters"]["f_m"]["covariates"]["air"]["slope"]
    assert slope == pytest.approx(-0.01, abs=0.002)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--covariate", "temperature"), "There are speed, temp, time, torque"),
        (("--free", "f_q"), "f_m"),
        (("--false-alarms", "5"), "probability"),
        (("--jobs", "0"), "1 to 64"),
    ],
)
def test_wrong_use_is_told(trended, more, said):
    status, _, err = trended(*more)
    assert status == 2
    assert said in err
    assert "Traceback" not in err


def test_a_covariate_that_there_is_not_is_told_before_anything_is_estimated(days, tmp_path, capsys):
    line = words([days], days / "axis.toml", tmp_path / "new")
    assert main([*line, "--covariate", str(tmp_path / "nowhere.csv")]) == 2
    assert "nowhere.csv: cannot be read" in capsys.readouterr().err
    assert main([*line, "--covariate", "tem"]) == 2
    said = capsys.readouterr().err
    assert "--covariate tem: no log has it as a column. Did you mean 'temp'?" in said
    assert "such as 2026-05-01.csv" in said and not (tmp_path / "new").exists()


def test_of_logs_that_cannot_be_read_the_first_is_named(tmp_path, capsys):
    alike(tmp_path)
    for path in tmp_path.glob("*.csv"):
        path.write_text(path.read_text().replace("torque [Nm]", "I"))
    (tmp_path / "axis.toml").write_text(AXIS)
    assert main(words([tmp_path], tmp_path / "axis.toml", tmp_path / "t")) == 2
    assert "2026-05-01.csv: " in capsys.readouterr().err


def test_it_does_not_write_among_the_logs(trended, days, tmp_path):
    status, _, err = trended(output=days)
    assert status == 2
    assert "the logs are there" in err
    other = tmp_path / "other"
    other.mkdir()
    (other / "report.html").write_text("mine")
    assert trended(output=other)[0] == 2
    assert (other / "report.html").read_text() == "mine"


@pytest.mark.parametrize(
    ("logs", "said"),
    [
        (slice(3), "3 logs; a trend needs 8"),
        ([*range(7), 24], "7 logs have estimates; a trend needs 8: 2026-05-25.csv: "),
    ],
)
def test_too_few_logs(trended, days, logs, said):
    status, _, err = trended(of=list(np.array(sorted(days.glob("*.csv")))[logs]))
    assert status == 2 and said in err


@pytest.mark.slow
def test_what_was_made_of_a_log_is_no_further_log(days, tmp_path, capsys):
    for day in (1, 2):
        name = f"2026-05-0{day}.csv"
        (tmp_path / name).write_bytes((days / name).read_bytes())
    log = tmp_path / "2026-05-01.csv"
    assert main(["import", str(log), "--torque-is", "held"]) == 0
    words = ["--model", str(days / "axis.toml"), "--identify", "f_m", "--torque-is", "held"]
    assert main(["track", str(log), *words]) in {0, 1}
    assert len([*tmp_path.glob("*.nc")]) == 2
    assert [p.name for p in find_logs([tmp_path])] == ["2026-05-01.csv", "2026-05-02.csv"]
    log.unlink()  # of which the record is all there is now
    assert [p.name for p in find_logs([tmp_path])] == ["2026-05-01.nc", "2026-05-02.csv"]


def test_a_folder_a_day_is_a_set_of_logs(trended, days, tmp_path):
    """All logs have one name: they are told apart by their folders, and dated by them."""
    at = [f"2026-05-{day:02}" for day in range(1, 13)]
    for name in at:
        (tmp_path / "set" / name).mkdir(parents=True)
        (tmp_path / "set" / name / "log.csv").write_bytes((days / f"{name}.csv").read_bytes())
    found = find_logs([tmp_path / "set"])
    assert [p.parent.name for p in found] == at
    assert dated(found[0]) == datetime(2026, 5, 1)
    copy = tmp_path / "set" / at[0] / "copy.csv"
    copy.write_bytes(found[0].read_bytes())
    table = tmp_path / "air.csv"
    read_in = [f"{name};{20 + k % 5},5" for k, name in enumerate(at)]
    table.write_text("\n".join(["log;air", *read_in]) + "\n")
    _, out, err = trended("--covariate", table, of=[tmp_path / "set"])
    assert "dates: 12 of their names, or of their folders" in out, err
    assert "2026-05-01/copy.csv is 2026-05-01/log.csv" in out.replace("\n", " ") or (
        "2026-05-01/log.csv is 2026-05-01/copy.csv" in out
    )
    rows = json.loads((tmp_path / "t" / "trend.json").read_text())
    assert rows["logs"] == 12


def test_a_parameter_that_is_zero_is_refused(trended, tmp_path):
    (tmp_path / "zero.toml").write_text(AXIS.replace("f_m = 0.05", "f_m = 0.0"))
    status, _, err = trended("--free", "f_m", axis=tmp_path / "zero.toml")
    assert status == 2
    assert "--free f_m: is 0 in the axis" in err


def test_a_date_in_a_name_is_read_anew(trended, days, tmp_path):
    """The same content under another name: nothing is computed, and it is another day."""
    names = [f"2026-05-{day:02}.csv" for day in range(1, 13)]
    for name in names:
        (tmp_path / name).write_bytes((days / name).read_bytes())
    _, out, _ = trended(of=[tmp_path])
    assert "dates: 12 of their names" in out
    (tmp_path / names[0]).rename(tmp_path / "axis 2026-04-01.csv")
    rows = kept(tmp_path / "t")
    trended(of=[tmp_path])
    assert kept(tmp_path / "t") == rows
    _, out, _ = trended("--json", of=[tmp_path])
    assert json.loads(out)["logs"] == 12
    assert dated(tmp_path / "axis 2026-04-01.csv") == datetime(2026, 4, 1)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda r: replace(r, torque=np.append(r.torque[1:], 0.0)), "later than in others"),
        (lambda r: replace(r, speed=r.speed + 2 * np.sin(40 * r.time)), "is fitted by"),
    ],
)
def test_a_log_unlike_the_others_is_told(trended, tmp_path, spoil, said):
    alike(tmp_path, spoil(driven(F, seed=56)))
    status, out, _ = trended(of=[tmp_path])
    assert status == 1
    (line,) = [line for line in out.splitlines() if said in line]
    assert line.startswith("✗ 2026-05-07.csv")
    page = (tmp_path / "t" / "report.html").read_text()
    assert "Logs that are not like the others" in page


@pytest.mark.parametrize(
    ("late", "said"),
    [
        (0.0, ""),
        (0.3, ""),
        (0.7, "about 0.7 samples later than the axis has it in most logs: identify it again"),
        (-1.2, "about 1 samples earlier"),
    ],
)
def test_a_delay_that_most_logs_have_is_the_axis_own(late, said):
    """It is no ailment of a log, and said once; a log without it is none of the others."""
    rng = np.random.default_rng(0)
    rows = [
        {"log": f"{i}.csv", "problem": "", "fit": 95.0 + 0.1 * rng.standard_normal(),
         "late": {"value": T * (late + 0.02 * rng.standard_normal()), "sd": 0.02 * T},
         "period": T, "left": 0.1, "error": 0.05}
        for i in range(12)
    ]  # fmt: skip
    assert not ailments(rows)
    slow = rows[0] | {"log": "slow.csv", "fit": 80.0}  # it moves less, and no error is larger
    assert not ailments([*rows, slow])
    assert [*ailments([*rows, slow | {"error": 0.2}])] == ["slow.csv"]
    text = "".join(common(rows))
    assert said in text and bool(said) == bool(text)
    rows.append(rows[0] | {"log": "other.csv", "late": {"value": T * (late + 1), "sd": 0.02 * T}})
    assert [*ailments(rows)] == ["other.csv"]


def test_logs_alike_are_no_problem(trended, tmp_path):
    alike(tmp_path)
    status, out, _ = trended(of=[tmp_path])
    assert status == 0
    assert "✗" not in out


def test_a_change_may_be_too_small_for_a_word(trended):
    status, out, _ = trended("--covariate", "temp", "--smallest", "20")
    assert status == 0
    assert "which is less than 20 %" in out


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis") / "axis.toml"
    path.write_text(AXIS)
    return find_axis(str(path))


def test_a_log_may_begin_in_motion_and_with_an_offset(axis):
    record = driven(0.06, speed=8.0, offset=0.1)
    found = refit(record, axis, ["J_m", "f_m"])
    assert np.all(abs(found.theta - [J, 0.06]) < 3 * found.deviations)
    assert abs(found.offset[0] - 0.1) < 3 * found.offset[1] < 0.03
    assert found.fit == pytest.approx(100 * (1 - 0.05 / np.std(record.speed)), abs=0.3)


def test_estimates_settle_with_the_noise_that_they_end_with():
    """A beginning that is told last makes the residual another one: a step of 1.5 σ was left."""
    rng = np.random.default_rng([0, 1])
    values = {n: v * (1 + 0.03 * rng.uniform(-1, 1) * (n != "k_T")) for n, v in VALUES[1].items()}
    axis = Axis(MODELS["one_mass"].factory(values), {"model": "one_mass"}, known=True)
    friction = (np.linspace(1.0, 0.9, 20) * np.exp(0.01 * rng.standard_normal(20)))[4]
    record = record_of(1, 1000.0, 3.0, 0.02, friction=friction, seed=[0, 4, 1])
    assert refit(record, axis, ["J_m", "f_m"]).left < 0.2


def test_a_beginning_that_is_forgotten_does_no_harm(axis):
    """After a second, 15 time constants, nothing tells how the log began."""
    found = refit(replace(driven(0.06, speed=8.0), burn_in=1.0), axis, ["J_m", "f_m"])
    assert np.all(abs(found.theta - [J, 0.06]) < 3 * found.deviations)
    assert np.all(found.deviations < [0.05 * J, 0.05 * 0.06])


@pytest.mark.parametrize("samples", [0.0, 1.0])
def test_a_torque_that_is_late_is_seen(axis, samples):
    """Logged a sample early, it acts one later; to first order, so to a third of it."""
    record = driven(0.06)
    if samples:
        record = replace(record, torque=np.append(record.torque[1:], 0.0))
    found = refit(record, axis, ["J_m", "f_m"])
    assert found.late[0] / T == pytest.approx(samples, abs=0.3)
    assert found.late[1] < 0.1 * T


def test_a_high_pass_of_the_axis_keeps_a_drift_out(axis):
    """A slow disturbance of the speed, four times what the torque does: below the corner."""
    record = driven(0.06)
    drift = 40 * np.sin(2 * np.pi * 0.2 * record.time)
    drifting = replace(record, speed=record.speed + drift)
    found = refit(drifting, replace(axis, highpass=1.0), ["J_m", "f_m"])
    assert np.all(abs(found.theta - [J, 0.06]) < 3 * found.deviations)
    assert found.fit > 80


@pytest.mark.parametrize(
    "change", [{"torque_is": "smooth"}, {"highpass": 1.0}, {"delay": 0.001}], ids=str
)
def test_rows_are_those_of_the_whole_axis(axis, change):
    source = trend.Source({}, {})
    plan = trend.Plan(axis, ("J_m",), source)
    assert trend.Plan(replace(axis, **change), ("J_m",), source).text != plan.text


def test_intervals_are_the_spread_of_estimates(axis):
    """40 logs: the rms claim over the spread within what 40 values tell, and a little wide."""
    every = [refit(driven(0.06, seed=seed), axis, ["J_m", "f_m"]) for seed in range(100, 140)]
    spread = np.std([one.theta for one in every], axis=0)
    claimed = np.sqrt(np.mean([one.deviations**2 for one in every], axis=0))
    assert np.all((claimed / spread > 0.75) & (claimed / spread < 1.9))


def test_a_log_of_another_axis_is_a_problem(trended, tmp_path):
    alike(tmp_path, driven(F, seed=56, inertia=40 * J))
    status, out, _ = trended(of=[tmp_path])
    assert status == 1
    assert "✗ 2026-05-07.csv" in out


def test_another_axis_is_refused(axis):
    with pytest.raises(LogError, match="of this axis"):
        refit(driven(0.05, inertia=40 * J), axis, ["J_m", "f_m"])


@pytest.mark.parametrize(
    ("text", "date"),
    [
        ("2026-03-01", datetime(2026, 3, 1)),
        ("axis1_20260301T063000", datetime(2026, 3, 1, 6, 30)),
        ("2026.03.01 06:30", datetime(2026, 3, 1, 6, 30)),
        ("run 20269901", None),
        ("log_123456789012", None),
        ("2026-02-31 then 2026-03-02", datetime(2026, 3, 2)),
        ("sn20190101_2026-03-01", datetime(2026, 3, 1)),
        ("2026/03/01", datetime(2026, 3, 1)),
        ("02/05/2026", None),
    ],
)
def test_dates(text, date):
    assert found_in(text) == date
