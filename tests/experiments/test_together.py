"""Cases of a unit that fit together run side by side, and their rows are as from each alone."""

import json
from dataclasses import replace
from time import thread_time
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError
from flexaxis.estimators.methods import beside
from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running import together, work
from flexaxis.experiments.running.units import Entry, Unit, Variant
from flexaxis.experiments.scoring.spending import OTHER, ledger, shared, spent
from flexaxis.sim.simulate import simulate

TEXTS = [
    "rpem-forgetting",
    "rpem-forgetting[forgetting=0.99]",
    "rpem-drift-mu",
    "rpem-corrected",
    "frozen",
    "ekf",
    "rpem-drift[scale=-1]",
]
SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def unit():
    scenario = find_scenario("fm_step-v1").override({"duration": 14.0})
    entries = tuple(Entry(text, text, {}) for text in TEXTS)
    variant = Variant(scenario, {}, scenario.hash, scenario.duration, entries)
    return Unit((variant,), SEEDS)


def rows(outcome):
    """Return the rows without what they cost, and what they cost."""
    found = [json.loads(line) for line in outcome.lines.splitlines()]
    return found, [row.pop("cost") for row in found]


def test_rows_are_those_of_each_alone(unit, monkeypatch):
    monkeypatch.setattr(together, "worth_together", lambda each, *_, **__: [False] * len(each))
    alone, _ = rows(work.run_unit(unit))
    monkeypatch.undo()
    monkeypatch.setattr(beside, "PAYS", dict.fromkeys(beside.PAYS, 0))
    blocks = []
    take = together.run_together
    monkeypatch.setattr(
        together,
        "run_together",
        lambda each, *given: blocks.append(len(each)) or take(each, *given),
    )
    clock = SimpleNamespace(perf_counter=iter([1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 20.0, 24.0]).__next__)
    monkeypatch.setattr(together, "time", clock)
    outcome = work.run_unit(unit)
    found, cost = rows(outcome)
    assert found == alone
    assert blocks == [12, 12]  # four methods, three seeds; before the fault and after
    seconds = {
        row["case"]: each["seconds"]
        for row, each in zip(found, cost, strict=True)
        if row["estimator"] in TEXTS[:4]
    }
    assert sorted(seconds.values()) == sorted([1.0, 2.0, 3.0, 4.0] * 3)  # of each by itself
    accounts = [outcome.spent[f"estimator {name}"] for name in ("rpem-drift-mu", "rpem-corrected")]
    assert min(accounts) > 0


def test_what_fails_together_is_run_alone(unit, monkeypatch):
    def fail(*_):
        raise EstimatorError("no")

    expected, _ = rows(work.run_unit(unit))
    monkeypatch.setattr(beside, "PAYS", dict.fromkeys(beside.PAYS, 0))
    monkeypatch.setattr(together, "run_together", fail)
    assert rows(work.run_unit(unit))[0] == expected


@pytest.mark.parametrize("output", ["speed", "increment"])
def test_one_estimator_on_four_records_reads_what_it_asks_for_with_the_gaps_of_each(
    monkeypatch, output
):
    scenario = find_scenario("fm_step-v1").override({"duration": 11.0, "output": output})
    found = list(simulate(scenario, range(4)))
    for k in (1, 2):
        valid = np.ones(scenario.samples, bool)
        valid[300 * k : 300 * k + 200] = False
        found[k] = replace(found[k], valid=valid)
    monkeypatch.setattr(beside, "PAYS", dict.fromkeys(beside.PAYS, 0))
    text = "rpem-forgetting"
    together_ = together.ran_together(scenario, [text], found)
    assert set(together_) == {(text, place) for place in range(4)}
    for place, record in enumerate(found):
        alone = build(parse(text), scenario).run(
            record.torque, getattr(record, output), record.valid
        )
        np.testing.assert_array_equal(together_[text, place].theta, alone)


def test_what_is_shared_goes_on_each_account():
    with ledger() as seconds, spent("outer"), shared(["a", "b", "b"]):
        np.linalg.inv(np.random.default_rng(0).random((200, 200)))
    assert seconds["b"] == pytest.approx(2 * seconds["a"]) and seconds["a"] > 0
    assert set(seconds) == {"a", "b", "outer", OTHER}
    with ledger() as again:
        start = thread_time()
        with shared(["a", "b"]):
            np.linalg.inv(np.random.default_rng(0).random((200, 200)))
        whole = thread_time() - start
    assert again["a"] + again["b"] <= whole
