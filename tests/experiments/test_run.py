"""Runs on worker processes: the same rows however they are run, and nothing lost on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest
from engine_cases import short, small_study, user_file

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.runner import Runner
from flexaxis.experiments.running.store import ROWS, Store
from flexaxis.experiments.running.study import Study

pytestmark = pytest.mark.slow
COST = ["cost.us_per_sample", "cost.seconds"]


@pytest.fixture(scope="module")
def alone():
    with Runner() as runner:
        yield runner.run(small_study("frozen", "rpem-forgetting", seeds=4)).frame


def same(one, other):
    pd.testing.assert_frame_equal(one.drop(columns=COST), other.drop(columns=COST))


def test_two_workers_give_the_same_rows(alone):
    with Runner(jobs=2) as runner:
        same(runner.run(small_study("frozen", "rpem-forgetting", seeds=4)).frame, alone)


def test_a_dask_cluster_gives_the_same_rows(alone):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as here,
        distributed.Client(here) as client,
        Runner(executor=client.get_executor()) as runner,
    ):
        same(runner.run(small_study("frozen", "rpem-forgetting", seeds=4)).frame, alone)


def test_a_session_class_runs_in_a_worker():
    class Here:
        names, output = ("k_T",), "speed"

        def __init__(self, nominal, period):
            self.theta = [nominal["k_T"]]

        def step(self, u, y):
            return self.theta

    from flexaxis.experiments.running.estimators import text_of

    with Runner() as runner:
        frame = runner.rows([short()], [text_of(Here)], [0])
    assert frame["error"].isna().all()


def test_a_worker_that_dies_or_never_ends_loses_one_case(tmp_path):
    path = user_file(tmp_path)
    names = tuple(f"{path}:{name}" for name in ("Mine", "Dies", "Loops"))
    with Runner(time_limit=2.0) as runner:
        frame = runner.run(Study("bad", (short(),), names, (0, 1))).frame
    errors = frame.groupby("estimator")["error"].first()
    assert pd.isna(errors[names[0]])
    assert "the worker process died" in errors[names[1]]
    assert "not finished within 2 s" in errors[names[2]]
    assert "mine.py:" in errors[names[2]]
    assert len(frame) == 3 * 2 * 3


def test_an_estimator_that_cannot_be_made_stops_the_run_before_it_begins():
    with Runner() as runner:
        with pytest.raises(EstimatorError, match="forgetting"):
            names = ("frozen", "rpem-forgetting[forgetting=2.0]")
            runner.run(Study("wrong", (short(),), names, (0,)))
        assert not runner.store.done()


SCRIPT = """
from pathlib import Path
from engine_cases import small_study
from flexaxis.experiments.running.runner import Runner
with Runner(Path("rows")) as runner:
    print("begun", flush=True)
    runner.run(small_study("{file}:Slow", seeds=8), about={{}})
"""


def stored(folder):
    """Return how many cases a folder has."""
    return len(Store.read(folder).done()) if (folder / ROWS).exists() else 0


def test_a_run_that_is_killed_or_stopped_resumes_with_every_row_once(tmp_path):
    code = SCRIPT.format(file=user_file(tmp_path))
    paths = os.path.dirname(__file__)
    for kind in (signal.SIGKILL, signal.SIGINT, None):
        process = subprocess.Popen(
            [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths},
            stdout=subprocess.PIPE,
        )  # fmt: skip
        assert process.stdout is not None
        process.stdout.readline()
        before = stored(tmp_path / "rows")
        if kind is not None:
            while stored(tmp_path / "rows") == before:
                time.sleep(0.2)
            process.send_signal(kind)
        process.wait()
        process.stdout.close()
    frame = Results.load(tmp_path / "rows").frame
    assert len(frame) == 2 * 8 * 3
    assert not frame.duplicated(["case", "parameter"]).any()
