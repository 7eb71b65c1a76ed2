"""The front door where what is told, given or run in a batch is not what was recorded."""

import json
from dataclasses import replace

import numpy as np
import pytest

import flexaxis as fx
from flexaxis.sim.errors import RecordError

BATCH = """
import numpy as np

class Alone:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.theta, self.covariance, self.findings = nominal["f_m"], np.eye(1) * 1e-6, []
        self._k, self._rms = 0, 0.0

    def step(self, u, y):
        self._k += 1
        if self._k == 900:
            self.findings.append(type("Found", (), {"alarm": 899, "parameters": ("f_m",)}))
        return [self.theta]

    def run(self, u, y):
        self.innovations = np.column_stack([y, np.ones(len(y))])
        return np.array([self.step(*pair) for pair in zip(u, y)])

class Batch(Alone):
    def run_batch(self, u, y):
        return np.full((*u.shape, 1), self.theta)
"""


def test_faults_are_those_of_the_record_whatever_was_told(short):
    record = fx.simulate(short, seed=1000)
    elsewhere = short.override({"fault[0].at": 2.0, "name": "early"})
    plain, told = (fx.score(fx.estimate(record, "glr", **more))
                   for more in ({}, {"scenario": elsewhere}))  # fmt: skip
    for one, other in zip(plain, told, strict=True):
        assert {**one} == {**other}


def test_a_score_needs_the_truth_of_what_was_estimated(short):
    record = fx.simulate(short)
    found = fx.estimate(record, "frozen")
    with pytest.raises(RecordError, match="truth of none"):
        fx.score(replace(found, names=("f_c", "f_s", "sigma_0")))
    columns = record.parameter_names[::-1]
    with pytest.raises(RecordError, match="that the record was made of"):
        fx.score(replace(found, record=fx.Recording.of(replace(record, parameter_names=columns))))


def test_a_batch_hides_nothing_that_is_scored(tmp_path, monkeypatch, short):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hides.py").write_text(BATCH)
    names = ["hides.py:Alone", "hides.py:Batch"]
    rows = fx.benchmark(names, scenarios=short, seeds=2).frame.to_dict("records")
    own = ("case", "estimator", "setting", "cost")
    alone, batch = (
        [
            {k: v for k, v in row.items() if not k.startswith(own)}
            for row in rows
            if row["estimator"] == name
        ]
        for name in names
    )
    assert json.dumps(alone, default=str) == json.dumps(batch, default=str)
    assert all(row["nees"] >= 0 and row["nis"] >= 0 for row in batch)


def test_a_truth_of_zero_is_shown(short):
    found = fx.estimate(fx.simulate(short), "frozen")
    found.__dict__["truth"] = {"f_m": np.zeros(len(found.time))}
    line = next(text for text in repr(found).splitlines() if text.startswith("f_m"))
    assert line.split()[2:] == ["0"]
