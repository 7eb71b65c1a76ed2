"""Onsets drawn by seed: what moves with them, who is told, and what is scored."""

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running import estimators
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.estimators import parse
from flexaxis.experiments.scoring.curves import later, shifted
from flexaxis.experiments.scoring.parameter_names import started_nominal
from flexaxis.experiments.scoring.windows import claimed_at, quiet, windows
from flexaxis.sim.record import load_record
from flexaxis.sim.scenario import scenario_from
from flexaxis.sim.simulate import simulate

SHORT = {"duration": 6.0, "fault[0].at": 4.0, "onset_spread": 1.0, "burn_in": 1.0}


@pytest.fixture(scope="module")
def short():
    return find_scenario("fm_step-v1").override(SHORT)


def test_onsets_are_even_on_the_grid_from_7_to_13_s():
    scenario = find_scenario("fm_step-v2")
    drawn = np.array([scenario.drawn(seed).events()[0].index for seed in range(1000)])
    assert drawn.min() >= 1400 and drawn.max() <= 2600
    # four standard errors of the mean of an even distribution, and of the share of each third
    assert abs(drawn.mean() - 2000) < 4 * 1200 / np.sqrt(12 * 1000)
    thirds = np.histogram(drawn, [1400, 1800, 2200, 2601])[0] / 1000
    assert abs(thirds - 1 / 3).max() < 4 * np.sqrt(2 / 9 / 1000)
    assert len({int(k) % 5 for k in drawn}) == 5
    assert [scenario.drawn(s).fault[0].at for s in range(3)] == [8.555, 11.81, 12.51]


def test_a_record_is_that_of_its_own_scenario_whatever_the_batch(tmp_path):
    """Several law and axis parameters change at other times in each run of a batch."""
    both = {"friction.coulomb": 0.1, "fault": [
        {"kind": "step", "parameter": "f_c", "at": 0.4, "factor": 2.0},
        {"kind": "step", "parameter": "J_a", "at": 0.5, "factor": 1.2}]}  # fmt: skip
    scenario = find_scenario("fm_step-v1").override(both | {"duration": 1.0, "onset_spread": 0.3})
    batch = simulate(scenario, range(3))
    assert len({record.scenario["fault"][0]["at"] for record in batch}) == 3
    for seed, record in enumerate(batch):
        own = scenario_from(record.scenario, source="record")
        assert own.hash == scenario.drawn(seed).hash and record.hash == scenario.hash
        for again in (simulate(scenario, [seed])[0], simulate(own, [seed])[0]):
            for name in ("torque", "speed", "true_angle_a", "true_parameters"):
                assert np.array_equal(getattr(record, name), getattr(again, name)), name
        changes = np.flatnonzero(np.diff(record.true_parameters, axis=0).any(axis=1)) + 1
        assert list(changes) == [event.index for event in own.events()]
    store = RecordCache(tmp_path)
    for _ in range(2):  # simulated, and from the cache
        (kept,) = records(scenario, [2], store)
        assert kept.scenario == batch[2].scenario
        assert np.array_equal(kept.true_parameters, batch[2].true_parameters)
    path = batch[1].save(tmp_path / "record.nc")
    assert load_record(path).scenario["fault"][0]["at"] == scenario.drawn(1).fault[0].at


def test_no_estimator_is_told_the_onset(short):
    """What a constructor gets is the same whenever the fault comes."""
    drawn = [short.drawn(seed) for seed in range(2)]
    nominal = [started_nominal(each) for each in drawn]
    assert nominal[0] == nominal[1]
    known = [estimators._known(parse("glr"), each, nominal[0]) for each in drawn]
    assert known[0].keys() == known[1].keys()
    for name, value in known[0].items():
        assert np.array_equal(value, known[1][name])


def test_windows_and_quiet_times_follow_the_onset(short):
    for seed in range(3):
        run = short.drawn(seed)
        onset = run.events()[0].index
        assert windows(run, run.identify)[0].start == onset and quiet(run)[-1] == onset - 1
        assert onset - 200 <= claimed_at(run) + 1 <= onset and (claimed_at(run) + 1) % 200 == 0
        assert later(run, short) == onset - 800
    assert shifted(np.arange(5), 2).tolist() == [2, 3, 4, 4, 4]
