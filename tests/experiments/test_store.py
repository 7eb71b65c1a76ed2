"""Rows in SQLite: whole units, each case once, and tables that say what was stored."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from engine_cases import small_study

from flexaxis.experiments.files import NotRun, OutputError, StudyError
from flexaxis.experiments.running import store as module
from flexaxis.experiments.running.case import Done, Options, run_unit
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.store import ROWS, Store
from flexaxis.experiments.running.study import describe, units
from flexaxis.experiments.scoring.summary import NUMBERS

STUDY = small_study("frozen", "rpem-forgetting", seeds=3)


@pytest.fixture(scope="module")
def outcomes():
    return [run_unit(unit, Options(traces=True)) for unit in units(STUDY)]


def filled(folder, outcomes):
    store = Store(folder)
    store.tell(study=describe(STUDY, units(STUDY)))
    for outcome in outcomes:
        store.add(outcome)
    return store


def test_a_case_is_there_once_and_the_first_one_stays(tmp_path, outcomes):
    store = filled(tmp_path, outcomes)
    done = outcomes[0][0]
    store.add([Done(done.id, done.about, done.seed, done.numbers + 1.0, None, None)])
    frame = Results.load(tmp_path).frame
    assert len(frame) == 2 * 2 * 3 * 3
    rows = frame[frame["case"] == done.id]
    for name in ("lag", "lag_null", "std", "seconds"):
        if name in NUMBERS:
            np.testing.assert_array_equal(rows[name], done.numbers[:, NUMBERS.index(name)])
    assert np.isfinite(done.numbers[:, NUMBERS.index("std")]).all()


def test_a_unit_is_stored_whole_or_not_at_all(tmp_path, outcomes):
    def cases():
        yield from outcomes[0]
        raise KeyError

    with pytest.raises(KeyError):
        Store(tmp_path).add(cases())
    assert not Store(tmp_path).done()


def test_two_stores_fill_one_folder(tmp_path, outcomes):
    one, other = Store(tmp_path), Store(tmp_path)
    one.add(outcomes[0])
    other.add(outcomes[0] + outcomes[1])
    assert one.done() == other.done() == {c.id for o in outcomes[:2] for c in o}


def test_shards_put_together_are_the_whole(tmp_path, outcomes):
    filled(tmp_path / "whole", outcomes)
    for i in range(2):
        filled(tmp_path / str(i), outcomes[i::2])
    store = Store(tmp_path / "together")
    for i in (0, 1, 0):
        store.take(tmp_path / str(i))
    pd.testing.assert_frame_equal(
        Results.load(tmp_path / "together").frame, Results.load(tmp_path / "whole").frame
    )


def test_rows_of_other_code_are_refused_with_both_ways_out(tmp_path, outcomes, monkeypatch):
    filled(tmp_path, outcomes)
    monkeypatch.setattr(module, "made_with", lambda: {"mujoco": "9", "code": "other"})
    with pytest.raises(StudyError, match=r"code .*, now other.*-o .*, or --overwrite"):
        Store(tmp_path).check()
    Store(tmp_path, overwrite=True).check()


def test_a_full_disk_is_said_and_keeps_what_is_there(tmp_path, outcomes):
    store = filled(tmp_path, outcomes[:1])
    kept = store.done()
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count = {pages}")
    large = Done("big", "{}", 0, np.zeros((2000, 50)), None, None)
    with pytest.raises(NotRun, match=r"full.*Free some space"):
        store.add([large])
    assert Store(tmp_path).done() == kept


def test_what_is_no_store_is_refused(tmp_path):
    with pytest.raises(StudyError, match="is not the folder of a run"):
        Results.load(tmp_path)
    (tmp_path / ROWS).write_text("no database" * 1000)
    with pytest.raises(StudyError, match="damaged"):
        Results.load(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written: File exists"):
        Store(tmp_path / "file")


def test_files_for_others(tmp_path, outcomes):
    results = Results(filled(None, outcomes), describe(STUDY, units(STUDY)))
    results.to_csv(tmp_path / "rows.csv")
    results.to_parquet(tmp_path / "rows.parquet")
    back = pd.read_csv(tmp_path / "rows.csv")
    np.testing.assert_allclose(back["lag"], results.frame["lag"])
    back = pd.read_parquet(tmp_path / "rows.parquet")
    assert back["setting"].tolist() == results.frame["setting"].tolist()
    cube = results.to_xarray().set_index(point="fault[0].factor")
    key = {"estimator": "frozen", "point": 1.2, "seed": 2, "parameter": "f_m"}
    row = results.frame.query(
        "estimator == 'frozen' and `fault[0].factor` == 1.2 and seed == 2 and parameter == 'f_m'"
    )
    assert cube["lag"].sel(key).item() == row["lag"].item()


def test_traces_are_found_by_scenario_and_setting(outcomes):
    results = Results(filled(None, outcomes), describe(STUDY, units(STUDY)))
    row = results.frame.iloc[0]
    traces = results.traces(row["hash"], row["setting"])
    assert sorted(traces) == [0, 1, 2]
    assert traces[0].curve.shape == (80, 3)


def test_the_scenario_of_a_row_is_that_of_its_point(outcomes):
    results = Results(filled(None, outcomes), describe(STUDY, units(STUDY)))
    for _, row in results.frame.drop_duplicates("hash").iterrows():
        assert results.scenario(row).hash == row["hash"]
