"""The typical changes that CONTRIBUTING lists are small: a patch makes each, and it works."""

import csv
import json
import re
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
from scipy.linalg import expm

from flexaxis.sim.parameters import preset

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PATCHES = sorted(HERE.glob("*.patch"))
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (.*) \|$", CONTRIBUTING.split("## House style")[0], flags=re.MULTILINE)
ONE = ("--estimator", "frozen", "--seeds", "1", "--jobs", "1")
STEP = '[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 4.0\nfactor = 1.5'


def scenario(flexaxis, name, text):
    """Write a scenario file, and return its description."""
    head = f'name = "{name}"\nduration = 8.0\nburn_in = 1.0\n'
    (flexaxis.place / f"{name}.toml").write_text(head + text, encoding="utf-8")
    return flexaxis("show", f"{name}.toml")


def stored_rows(flexaxis, folder):
    """Return the rows of scores.csv in a results folder."""
    with (flexaxis.place / folder / "scores.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def ran(flexaxis, name):
    """Run a scenario; return its report, and its rows keyed by parameter."""
    flexaxis("run", name, *ONE, "-o", f"{name}.run")
    page = (flexaxis.place / f"{name}.run" / "report.html").read_text(encoding="utf-8")
    return page, {row["parameter"]: row for row in stored_rows(flexaxis, f"{name}.run")}


def simulated(flexaxis, name):
    """Simulate a scenario and return some signals of the record."""
    flexaxis("simulate", f"{name}.toml", "-o", f"{name}.nc")
    with h5netcdf.File(flexaxis.place / f"{name}.nc", decode_vlen_strings=True) as file:
        return {key: file[key][:] for key in ("torque", "angle", "speed", "true_speed")}


def test_fault(flexaxis):
    words = "f_m +50 % at 3 s for 1.5 s"
    table = '[[fault]]\nkind = "pulse"\nparameter = "f_m"\nat = 3.0\nlasts = 1.5\nfactor = 1.5'
    assert f"# happens: {words}\n" in scenario(flexaxis, "pulse", table)
    page, rows = ran(flexaxis, "pulse.toml")
    assert words.removeprefix("f_m ") in page  # the page typesets f_m
    # An estimator that never moves has the full error during the fault, and none afterwards.
    assert float(rows["f_m"]["lag"]) == pytest.approx((1.5 + 0.0) / 2)


def test_excitation(flexaxis):
    words = "chirp from 0.5 to 5 Hz in 4 s"
    table = f'{STEP}\n[excitation]\nkind = "chirp"\nhigh = 5.0\namplitude = 0.2\n'
    assert f"# excitation: {words}\n" in scenario(flexaxis, "chirp", table)
    page, rows = ran(flexaxis, "chirp.toml")
    assert words in page and float(rows["f_m"]["lag_bound"]) > 0
    spectrum = abs(np.fft.rfft(simulated(flexaxis, "chirp")["angle"][:800])) ** 2
    inside = spectrum[2:21].sum()  # lines from 0.5 to 5 Hz of a 4 s period
    assert inside > 0.9 * spectrum[1:].sum()


def test_sensor(flexaxis):
    card = scenario(flexaxis, "offset", f"offset.speed = 5.0\n{STEP}")
    words = "speed read 5 rad/s too high"
    assert f"# unmodelled: {words}\n" in card and "# bound: no score" in card
    page, rows = ran(flexaxis, "offset.toml")
    assert words in page and not rows["f_m"]["lag_bound"]
    record = simulated(flexaxis, "offset")
    error = record["speed"] - record["true_speed"]
    assert error.mean() == pytest.approx(5.0, abs=4 * 0.1 / np.sqrt(error.size))  # 4 σ


def test_signal(flexaxis):
    """An estimator that reads the speed without noise tracks the fault."""
    table = f'output = "true_speed"\n{STEP}'
    assert "true_speed" in scenario(flexaxis, "turned", table)
    names = ["--estimator", "ekf", "--estimator", "frozen", "--jobs", "1"]
    flexaxis("run", "turned.toml", *names, "--seeds", "2", "-o", "turned.run")
    summary = json.loads((flexaxis.place / "turned.run" / "summary.json").read_text("utf-8"))
    found = {row["estimator"]: row for row in summary["rows"] if row["parameter"] == "f_m"}
    assert found["ekf"]["lag"] < 0.25 * found["frozen"]["lag"]


def test_nonlinearity(flexaxis):
    moves = '[excitation]\nkind = "moves"\ndwell = 3.5\n'
    card = scenario(flexaxis, "spring", f"spring.stiffness = 0.05\n{STEP}\n{moves}")
    words = "return spring of 0.05 N m/rad"
    assert f"# unmodelled: {words}\n" in card and "# bound: no score" in card
    page, rows = ran(flexaxis, "spring.toml")
    assert words in page and float(rows["f_m"]["lag"]) == pytest.approx(4.0)
    record = simulated(flexaxis, "spring")
    rest = slice(760, 780)  # the axis stands still, and the motor torque balances the spring
    ratio = record["torque"][rest].mean() / record["angle"][rest].mean()
    assert preset("n1").k_T * ratio == pytest.approx(0.05, rel=0.01)


def test_scenario(flexaxis):
    line = "f_m 3-fold at 10 s"
    listed = flexaxis("list", "--group", "steps").splitlines()
    assert any("fm_triple-v1" in text and "three times as large" in text for text in listed)
    assert f"# happens: {line}\n" in flexaxis("show", "fm_triple-v1")
    assert "'fm_triple-v1'" in flexaxis("show", "faults")  # the suite includes the group
    page, rows = ran(flexaxis, "fm_triple-v1")
    assert "Motor friction becomes three times as large" in page
    assert float(rows["f_m"]["lag"]) == pytest.approx(5.0)


def test_estimator(flexaxis):
    listed = flexaxis("list", "estimators")
    assert re.search(r"constant-trace\s+constant trace of P", listed)
    assert "forgetting = 0.995" in flexaxis("show", "constant-trace")
    scenario(flexaxis, "traced", STEP)
    names = ["--estimator", "constant-trace", "--estimator", "frozen", "--jobs", "1"]
    flexaxis("run", "traced.toml", *names, "--seeds", "1", "-o", "traced.run")
    flexaxis("report", "traced.run")
    assert "constant-trace" in (flexaxis.place / "traced.run" / "report.html").read_text("utf-8")
    summary = json.loads((flexaxis.place / "traced.run" / "summary.json").read_text("utf-8"))
    lag = {row["estimator"]: row["lag"] for row in summary["rows"] if row["parameter"] == "f_m"}
    assert lag["constant-trace"] < 0.6 * lag["frozen"]
    flexaxis("check", "constant-trace")


def test_linear_model(flexaxis):
    """`identify` recovers the parameters from a log that is computed with the exact response."""
    J_m, f_m, k, T = 2e-3, 0.02, 0.3, 0.005
    step = expm(np.array([[0, 1, 0], [-k / J_m, -f_m / J_m, 1 / J_m], [0, 0, 0]]) * T)
    rng = np.random.default_rng(0)
    torque, x, lines = rng.standard_normal(4000), np.zeros(2), ["t,torque,speed"]
    for i, u in enumerate(torque):
        lines.append(f"{i * T:.3f},{u:.6f},{x[1] + 0.01 * rng.standard_normal():.6f}")
        x = (step @ np.r_[x, u])[:2]
    (flexaxis.place / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    columns = ["--time", "t", "--torque", "torque", "--speed", "speed", "--delay", "0"]
    words = ["identify", "log.csv", "--model", "sprung_mass", *columns, "--json"]
    found = json.loads(flexaxis(*words))["estimates"]
    for name, value in {"J_m": J_m, "f_m": f_m, "k": k}.items():
        assert found[name]["value"] == pytest.approx(value, abs=4 * found[name]["sd"])
        assert found[name]["sd"] < 0.01 * value


def test_law(flexaxis):
    """`track` finds the level of Dahl friction in a log that is integrated in small steps."""
    J_m, f_m, f_c, stiffness, T, parts = 2e-3, 0.02, 0.1, 20.0, 0.005, 50
    rng = np.random.default_rng(0)
    torque, v, p, lines = 0.4 * rng.standard_normal(4000), 0.0, 0.0, ["t,torque,speed"]
    for i, u in enumerate(torque):
        lines.append(f"{i * T:.3f},{u:.6f},{v + 0.05 * rng.standard_normal():.6f}")
        for _ in range(parts):
            before = v
            v += T / parts * (u - f_m * v - p) / J_m
            p += T / parts * stiffness * (before - abs(before) * p / f_c)
    (flexaxis.place / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    (flexaxis.place / "axis.toml").write_text(
        f"""
model = "one_mass"
nominal = {{ k_T = 1.0, J_m = {J_m}, f_m = {f_m}, f_c = 0.08, sigma = {stiffness} }}
[[law]]
kind = "dahl"
drive = {{ speed_motor = 1.0 }}
acts = {{ speed_motor = "-1/J_m" }}
parameters = {{ coulomb = "f_c", stiffness = "sigma" }}
""",
        encoding="utf-8",
    )
    columns = ["--time", "t", "--torque", "torque", "--speed", "speed"]
    words = ["track", "log.csv", "--model", "axis.toml", *columns, "--identify", "f_m"]
    found = json.loads(flexaxis(*words, "--json"))["last"]
    assert found["f_c"] == pytest.approx(f_c, rel=0.05)
    assert found["f_m"] == pytest.approx(f_m, rel=0.1)


def test_score(flexaxis):
    scenario(flexaxis, "short", STEP)
    names = ["--estimator", "frozen", "--estimator", "rpem-forgetting", "--jobs", "1"]
    shown = flexaxis("run", "short.toml", *names, "--seeds", "2", "-o", "run")
    assert "largest error [%]" in shown
    run = flexaxis.place / "run"
    row = stored_rows(flexaxis, "run")[-1]
    assert float(row["largest"]) >= float(row["std"]) > 0
    pooled = json.loads((run / "summary.json").read_text(encoding="utf-8"))["rows"]
    pooled = max(pooled, key=lambda row: row["largest"])
    assert pooled["largest"] > 0 and pooled["largest_interval"] is None  # two seeds are too few
    page = (run / "report.html").read_text(encoding="utf-8")
    assert 'data-name="largest error [%]"' in page and "Largest error before the fault." in page

    study = 'scenario = "short.toml"\nestimators = ["rpem-forgetting"]\nseeds = 1\n'
    (flexaxis.place / "small.toml").write_text(f"{study}[sweep]\nstart = [1.0, 1.1]", "utf-8")
    flexaxis("study", "small.toml", "--jobs", "1", "-o", "small")
    assert all(float(row["largest"]) > 0 for row in stored_rows(flexaxis, "small"))

    sides = ["--base", "rpem-forgetting", "--candidate", "rpem-forgetting[forgetting=0.9]"]
    more = ["--seeds", "6", "--margin", "largest=5%", "--jobs", "1", "--json", "-o", "compared"]
    found = json.loads(flexaxis("compare", *sides, "short.toml", *more, status=1))
    assert {row["metric"] for row in found["rows"]} >= {"largest", "lag", "std"}


def test_figure(flexaxis):
    scenario(flexaxis, "drawn", STEP)
    page, _ = ran(flexaxis, "drawn.toml")
    _, title, after = page.partition("<h3>Lag by lag</h3>")
    assert title and after.startswith('<svg role="img" aria-label="lag by lag"')


def test_command(flexaxis):
    printed = flexaxis("hash", "fm_step-v1").strip()
    assert re.fullmatch("[0-9a-f]{64}", printed)
    assert f"# content hash: {printed}\n" in flexaxis("show", "fm_step-v1")
    assert "\n    hash      Print the hash of a scenario's content" in flexaxis("--help")


def test_option(flexaxis):
    assert "--expected LEVEL" in flexaxis("list", "--help")
    listed = flexaxis("list", "--expected", "hard", "--json")
    names = {row["name"] for row in json.loads(listed)["scenarios"]}
    assert "lugre_stribeck_fm_step-v1" in names and "fm_step-v1" not in names


@pytest.mark.parametrize("patch", PATCHES, ids=lambda path: path.stem)
def test_a_change_is_one_or_two_files(patch):
    files = re.findall(r"^\+\+\+ b/(.*)$", patch.read_text(encoding="utf-8"), flags=re.MULTILINE)
    code = {file for file in files if not file.startswith(("tests/", "docs/"))}
    assert 1 <= len(code) <= 2
    (row,) = (row for row in ROWS if f"tests/changes/{patch.name}" in row)
    named = tuple(re.findall(r"`([\w./]+)`", row))
    assert all(file.startswith(named) for file in code)


def test_every_patch_is_tried():
    assert {f"test_{patch.stem}" for patch in PATCHES} <= set(globals())
