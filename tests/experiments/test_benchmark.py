"""Runs with their summary and report."""

import json
from contextlib import contextmanager

import pytest
from engine_cases import runner_here, user_file

from flexaxis.experiments.files import summary_of
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.studies.benchmark import run


def benchmark(scenario, runner, *, estimators=("rpem-forgetting", "frozen"), **swept):
    return run(Study("t", (scenario,), tuple(estimators), (1000, 1001, 1002)), runner, **swept)


@pytest.mark.slow
def test_a_swept_knob_is_matched_at_equal_noise(short, tmp_path, monkeypatch):
    names = ["rpem-forgetting", "rpem-drift"]
    done, swept = [], ([short], names)

    @contextmanager
    def progress(what, total):
        yield done.append

    monkeypatch.setattr("flexaxis.experiments.running.runner.progress", progress)
    results = benchmark(short, runner_here(tmp_path), swept=swept)
    assert sum(done) >= 3 * (2 + 5 + 1)  # the reference is among the settings
    assert [row["estimator"] for row in summary_of(results.folder)["tradeoff"]["matched"]] == names
    assert set(Results.load(tmp_path).frame["estimator"]) == {"rpem-forgetting", "frozen"}
    done.clear()
    benchmark(short, runner_here(tmp_path), swept=swept)
    assert not done


@pytest.mark.usefixtures("recorded")
def test_an_estimator_that_fails_is_lost_and_the_others_are_reported(short, tmp_path):
    text = f"{user_file(tmp_path)}:Raises"
    results = benchmark(short, runner_here(tmp_path / "out"), estimators=["frozen", text])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert {row["estimator"] for row in summary["failures"]} == {text}
    lost = [row for row in summary["rows"] if row["estimator"] == text]
    assert all(row["diverged"] == row["failed"] == 3 for row in lost)
    assert len(results.failures) == 3
