"""Other sampling periods from the command line: run, study, record and estimate."""

import numpy as np
import pytest

from flexaxis.experiments.running.results import Results
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
