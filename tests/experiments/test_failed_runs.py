"""A case that failed is a run lost at its first sample, wherever it is counted."""

import numpy as np
import pytest

from flexaxis.experiments.comparison.ranking import leaders
from flexaxis.experiments.reporting.terminal import default_table
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.scoring.summary import columns_of, pool_columns
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark

COWARD = """
from flexaxis.estimators.registry import REGISTRY


class Plain:
    output = "speed"

    def __init__(self, nominal, period):
        self._of = REGISTRY["rpem-forgetting"].factory(nominal, period)
        self.names = self._of.names
        self.k = 0

    def step(self, u, y):
        return self._of.step(u, y)


class Coward(Plain):
    def step(self, u, y):
        self.k += 1
        if self.k == 1500 and y > 0:
            raise ArithmeticError("not sure")
        return self._of.step(u, y)
"""


def test_who_raises_is_lost_from_the_first_sample_on(short, tmp_path):
    path = tmp_path / "own.py"
    path.write_text(COWARD)
    plain, coward = (f"{path}:{name}" for name in ("Plain", "Coward"))
    study = Study("t", (short,), (plain, coward), tuple(range(1000, 1008)))
    found = benchmark(Benchmark(study, title="t", command="flexaxis run"), tmp_path / "out")
    rows = list(Results.load(tmp_path / "out").rows)
    failed = [row for row in rows if row["error"]]
    seeds = {row["seed"] for row in failed}
    assert 0 < len(seeds) < 8 and {row["estimator"] for row in failed} == {coward}
    assert [r["parameter"] for r in failed] == ["k_T", "1/J_a", "f_m"] * len(seeds)
    assert {r["rows"] for r in failed} == {3} and {r["lost_at"] for r in failed} == {0.0}
    assert all(r["diverged"] and r["failed"] and r["lost_before"] for r in failed)
    # The farther edge of the box is 10 × nominal; f_m is 1.5 × nominal after the fault, for 2 s.
    assert [r["std"] for r in failed] == pytest.approx([900.0] * len(failed))
    assert [r["lag"] for r in failed if r["changed"]] == pytest.approx([2 * 8.5 / 0.5] * len(seeds))
    assert {r["lag"] for r in failed if not r["changed"]} == {None}
    others = {(r["seed"], r["parameter"]): r for r in rows if r["estimator"] == plain}
    for row in rows:  # where it did not raise the two are the same
        other = others[row["seed"], row["parameter"]]
        assert row["lag_bound"] == other["lag_bound"]
        assert row["bound.100"] == other["bound.100"]
        if not row["error"]:
            assert (row["lag"], row["std"], row["failed"]) == (other["lag"], other["std"], False)
    first, second = (
        next(r for r in found.summary["rows"] if r["estimator"] == name and r["changed"])
        for name in (plain, coward)
    )
    counts = [(r["runs"], r["seeds"], r["failed"], r["diverged"]) for r in (first, second)]
    assert counts == [(8, 8, 0, 0), (8, 8, len(seeds), len(seeds))]
    assert second["lag"] > first["lag"] and second["std"] > first["std"]
    assert second["score"] < first["score"] and second["rmse"]["200"] > 5 * first["rmse"]["200"]
    as_set = {row["estimator"]: row for row in found.summary["as_set"]}
    assert as_set[coward]["diverged"] == len(seeds) and None not in as_set[coward]["values"]["lag"]
    assert leaders({name: row["values"]["lag"] for name, row in as_set.items()})[0] == plain
    assert default_table(found.summary["rows"]).row_count == 3


def test_who_is_slower_on_every_seed_and_leaves_the_hard_ones_out_does_not_lead():
    rng = np.random.default_rng(5)
    hard = np.arange(12) >= 8
    lag = np.where(hard, 2.0, 1.0) * np.exp(0.02 * rng.standard_normal(12))
    brave = np.log(lag).tolist()
    coward = [None if gone else x + 0.1 for gone, x in zip(hard, brave, strict=True)]
    assert np.mean(brave) > np.mean([x for x in coward if x is not None])
    assert leaders({"coward": coward, "brave": brave}) == ["brave"]
    upside_down = {
        name: [None if x is None else -x for x in each]
        for name, each in (("coward", coward), ("brave", brave))
    }
    assert leaders(upside_down, most=True) == ["brave"]


def test_who_ran_on_two_seeds_is_never_the_best():
    runs = {"some": [-9.0, -9.0, *[None] * 10], "all": np.linspace(0, 1, 12).tolist()}
    assert leaders(runs)[0] == "all"


def test_a_run_that_failed_has_missed_its_fault():
    one = {"alarms": 1, "false_alarms": 0, "false_alarms_per_1000_s": 0.0, "delay": 0.1,
           "faults": 1, "missed": 0, "isolated": 1.0}  # fmt: skip
    rows = [{"detection": one, "failed": False}] * 3 + [{"detection": None, "failed": True}]
    found = pool_columns(columns_of(rows), ["detection"])["detection"]
    assert (found["missed"], found["alarms"]) == (0.25, 1.0)
