"""Cases as a worker runs them: scores of good runs, and a failed run for each way to fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from engine_cases import short, small_study, user_file

from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.case import Options, run_unit
from flexaxis.experiments.running.study import Study, units
from flexaxis.experiments.scoring.summary import NUMBERS
from flexaxis.sim.simulate import simulate


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return RecordCache(tmp_path_factory.mktemp("records"))


def outcome_of(text, cache, **options):
    study = Study("one", (short(),), (text,), (0,))
    (unit,) = units(study)
    return run_unit(unit, Options(cache, **options))


@pytest.mark.parametrize(
    ("name", "words"),
    [("Raises", "KeyError"), ("Exits", "SystemExit: 3"), ("Shape", "2 values|3 are")],
)
def test_a_failed_case_names_estimator_scenario_seed_and_sample(name, words, tmp_path, cache):
    text = f"{user_file(tmp_path)}:{name}"
    (done,) = outcome_of(text, cache)
    assert all(part in done.error for part in (text, short().name, "seed 0", "sample 200"))
    if name != "Shape":
        assert words in done.error
        assert "mine.py:" in done.error.partition(words)[2]


def test_a_failed_case_is_a_run_lost_at_its_first_sample(tmp_path, cache):
    (done,) = outcome_of(f"{user_file(tmp_path)}:Raises", cache)
    scores = dict(zip(NUMBERS, done.numbers.T, strict=True))
    assert scores["failed"].all()
    assert scores["diverged"].all()
    assert (scores["lost_at"] == 0).all()


def test_nan_is_a_diverged_run(tmp_path, cache):
    found = outcome_of(f"{user_file(tmp_path)}:Nan", cache)
    scores = dict(zip(NUMBERS, found[0].numbers.T, strict=True))
    assert scores["diverged"].all()
    assert not scores["failed"].any()


def test_a_missing_package_leaves_no_row(tmp_path, cache):
    path = tmp_path / "lacks.py"
    path.write_text("import no_such_package_at_all\nclass Mine: pass\n")
    found = outcome_of(f"{path}:Mine", cache)
    assert isinstance(found[0], str) and "no_such_package_at_all" in found[0]


def test_records_are_simulated_once_and_shared(tmp_path):
    first = units(small_study("frozen", "rpem-forgetting", seeds=2))[0]
    run_unit(first, Options(RecordCache(tmp_path)))
    before = {path: path.stat().st_ino for path in tmp_path.iterdir()}  # written anew, another one
    run_unit(first, Options(RecordCache(tmp_path)))
    assert {path: path.stat().st_ino for path in tmp_path.iterdir()} == before
    assert len(before) >= len(first.seeds)


def test_a_kept_record_is_the_simulated_one(cache):
    record = simulate(short(), [7])[0]
    cache.put(short(), record)
    kept = cache.get(short(), 7)
    for name in ("torque", "speed", "true_speed", "true_parameters"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(record, name))
    assert cache.get(short(), 8) is None
    assert cache.get(short().override({"noise.speed": 0.3}), 7) is None


def test_the_least_recently_used_records_go_first(tmp_path):
    small, record = RecordCache(tmp_path), simulate(short(), [0])[0]
    for seed in range(3):
        small.put(short(), replace(record, seed=seed))
    small.get(short(), 0)
    assert small.evict(sum(path.stat().st_size for path in tmp_path.iterdir()) - 1) == 1
    assert small.get(short(), 1) is None
    assert small.evict(0) == 2


def test_a_damaged_record_is_simulated_again(tmp_path):
    small = RecordCache(tmp_path)
    small.put(short(), simulate(short(), [0])[0])
    small.entries()[0].write_bytes(b"no NetCDF")
    assert small.get(short(), 0) is None
    assert not small.entries()
