"""Other sampling periods from the command line: run, study, record and estimate."""

import subprocess
import sys

import numpy as np
import pytest

from flexaxis.experiments.running.results import Results
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.sim.record import load_record
from tests.experiments.command import flexaxis

STUDY = """\
scenario = "short.toml"
estimators = ["frozen", "rpem-forgetting", "ekf"]
seeds = 2
[override]
controller.Kv = 0.1
[sweep]
period = [0.001, 0.002, 0.005, 0.01]
""".replace("\ncontroller.Kv", '\n"controller.Kv"')


@pytest.mark.slow
def test_a_study_sweeps_the_period(short_toml, tmp_path, capsys):
    (tmp_path / "sweep.toml").write_text(STUDY, encoding="utf-8")
    words = ["study", tmp_path / "sweep.toml", "-o", tmp_path / "out", "--jobs", 1]
    status, _, err = flexaxis(capsys, *words)
    assert status == 0, err
    rows = Results.load(tmp_path / "out").frame.to_dict("records")
    assert rows
    bounds = {}
    for row in rows:
        if row["parameter"] != "f_m":
            continue
        period = row["period"]
        if row["estimator"] == "frozen":
            # as long as it is from the fault at 6 s to the end at 8 s
            assert [row["lag"], row["lag_null"]] == pytest.approx([2.0, 2.0], rel=1e-9)
        else:
            # λ and walks are those of the estimators; that they follow at all is ours
            assert not row["diverged"] and row["lag"] < 1.9
        bounds.setdefault(period, []).append(row["lag_bound"])
    means = [np.mean(bounds[period]) for period in (0.001, 0.002, 0.005, 0.01)]
    # the noise of a sample stays, so that more samples tell more: the bound goes about as √T
    assert means == sorted(means)
    ratio = means[3] / means[0]
    assert 10**0.25 < ratio < 10**0.75, ratio


def test_a_file_with_a_period_runs_and_its_record_has_it(short, tmp_path, capsys):
    file = tmp_path / "fine.toml"
    content = short.override({"name": "fine", "period": 0.002}).to_toml()
    file.write_text(content, encoding="utf-8")
    status, _, err = flexaxis(capsys, "simulate", file, "-o", tmp_path / "rec.nc")
    assert status == 0, err
    record = load_record(tmp_path / "rec.nc")
    assert record.period == 0.002 and len(record.time) == 4000
    status, _, err = flexaxis(
        capsys, "estimate", tmp_path / "rec.nc", "--estimator", "rpem-forgetting",
        "-o", tmp_path / "est.nc",
    )  # fmt: skip
    assert status == 0, err
    assert flexaxis(capsys, "show", file)[1].count("every 2 ms") == 1


def test_an_unstable_loop_is_a_wrong_use(short, tmp_path):
    file = tmp_path / "wild.toml"
    text = short.override({"name": "wild"}).to_toml().replace("Kv = 0.22", "Kv = 0.3")
    file.write_text(text.replace("period = 0.005", "period = 0.01"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "flexaxis.experiments", "run", file, "--estimator", "frozen"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert "controller.Kv: the loop is unstable on the nominal axis with Kv = 0.3" in done.stderr
    assert "Kv up to 0.23" in done.stderr and "Traceback" not in done.stderr


def test_the_recipe_runs_at_the_period_of_the_scenario(short):
    assert len(nominal_torque(short.override({"period": 0.002}))) == 20_000
