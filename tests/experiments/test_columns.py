"""Rows as columns: the same numbers as in the file, pooled alike in whatever order they came."""

import csv
import gc
import json
import math
import sqlite3
import statistics
import sys

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.results import export, groups, source
from flexaxis.experiments.results.export import cube_of
from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import pseudo_values
from flexaxis.experiments.storage import schema
from flexaxis.experiments.storage.files import OutputError, StudyError
from flexaxis.experiments.storage.schema import COLUMNS, UNITS
from tests.experiments.kept_rows import change, lines_of

AXES = ("fault[0].factor", "fault[0].parameter", "told")


def some_rows(seed=0, *, points=3, seeds=6):
    """Rows of two estimators over three axes, with all that a row may hold."""
    rng, rows = np.random.default_rng(seed), []
    for point in range(points):
        swept = {
            "fault[0].factor": 1.0 + point,
            "fault[0].parameter": "f_m",
            "told": [1, f"p{point}"],
        }
        for method in ("frozen", "glr"):
            for k in range(seeds):
                found = {"alarms": 1, "false_alarms": k % 2, "false_alarms_per_1000_s": 0.5 * k,
                         "delay": None if k == 1 else 0.1 * k, "faults": 1, "missed": int(k == 1),
                         "isolated": None if k == 1 else 1.0}  # fmt: skip
                rows += [
                    {
                        "case": f"{point}{method[0]}{k}", "hash": f"h{point}", "seed": 1000 + k,
                        "scenario": f"s+{point}", "estimator": method, "method": method,
                        "axes": swept, "parameter": name, "changed": name == "f_m",
                        "lag": float(rng.lognormal()) if name == "f_m" else None,
                        "std": float(rng.lognormal()), "bias": float(rng.normal() / 9),
                        "lost_before": False, "diverged": k == 2 and point == 1,
                        "detection": found if method == "glr" else None,
                        "isolation": [] if method == "glr" else None,
                        "bound": {"20": 0.5, "100": 0.25} if name == "f_m" else None,
                        "cost": {"us_per_sample": 1.5, "host": "häuser\u0000\n"},
                    }
                    for name in ("k_T", "f_m")
                ]  # fmt: skip
    failed = {"case": "bad", "seed": 1000, "parameter": None, "changed": None, "diverged": None,
              "never_settled": None, "error": "EstimatorError: no\nluck", "estimator": "frozen",
              "method": "frozen", "axes": {"fault[0].factor": 2.0}}  # fmt: skip
    return [*rows, failed]


def by_hand(results):
    """Return the rows as anyone reads them, without any of our code."""
    for line in lines_of(results.folder):
        for name, kind in COLUMNS.items():
            if kind == "truth" and line[name] is not None:
                line[name] = bool(line[name])
        if line["told"] is not None:
            line["told"] = json.loads(line["told"])
        yield line


def test_columns_hold_what_is_in_the_file(stored, tmp_path):
    results = stored(tmp_path, some_rows(), AXES)
    lines = list(by_hand(results))
    assert list(results.rows) == lines and len(results.rows) == len(lines) == 73
    assert results.failures() == [line for line in lines if line["error"]]
    assert results.cases == 37
    kinds = {type(line["changed"]) for line in results.rows if not line["error"]}
    assert kinds == {bool}


@pytest.mark.parametrize(
    "where",
    [
        {"method": "glr"},
        {"fault[0].factor": [2, 3.0], "changed": True},
        {"seed": (1001, 1002), "parameter": "f_m"},
        {"told": [[1, "p2"]]},
        {"lag": None, "error": None},
        {"diverged": True},
        {"case": f"{int.from_bytes(b'0f1'):016x}"},
        {"fault[0].factor": 99.0},
    ],
)
@pytest.mark.parametrize("gaps", [False, True])
def test_what_is_selected_is_what_has_the_values(stored, tmp_path, where, gaps):
    results = stored(tmp_path, some_rows(), AXES)
    if gaps:
        change(tmp_path, "DELETE FROM cells WHERE seed = 1003")
    wanted = [
        line
        for line in by_hand(results)
        if all(line[k] in (v if isinstance(v, list | tuple) else [v]) for k, v in where.items())
    ]
    selected = results.select(where)
    assert list(selected.rows) == wanted
    stds = np.array([line["std"] for line in wanted], float)
    np.testing.assert_array_equal(selected.column("std"), stds)
    np.testing.assert_array_equal(selected.numbers("std", slice(1, None, 2)), stds[1::2])


def test_a_selection_reads_no_column_anew(stored, tmp_path, monkeypatch):
    results, reads = stored(tmp_path, some_rows(), AXES), []
    read = source.Source.arrays
    monkeypatch.setattr(
        source.Source, "arrays", lambda self, names: reads.append(names) or read(self, names)
    )
    for method in ("glr", "frozen"):
        results.select({"method": method}).pooled()
    names = [name for some in reads for name in some]
    assert len(names) == len(set(names))


def test_rows_that_nobody_holds_any_more_are_closed(stored, tmp_path, monkeypatch):
    """Else Python 3.13 warns of them, where and when it happens to find them."""
    results = stored(tmp_path, some_rows(), AXES)
    assert len(results.rows)
    gc.collect()
    closed = []
    monkeypatch.setattr(schema._Connection, "close", lambda self: closed.append(1))
    del results
    gc.collect()
    assert closed == [1]


def test_rows_that_cannot_be_opened_are_no_trouble_later(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    with pytest.raises(sqlite3.OperationalError, match="unable to open"):
        schema.connect(tmp_path / "none" / "scores.sqlite")
    gc.collect()
    assert not told


def test_pooled_is_what_a_loop_gives(stored, tmp_path):
    results = stored(tmp_path, some_rows(), AXES)
    found = results.pooled(["method", "fault[0].factor"])
    assert len(found) == 2 * 3 * 2
    for row in found:
        key = ("method", "fault[0].factor", "parameter")
        mine = (line for line in by_hand(results) if all(line[k] == row[k] for k in key))
        here = [line for line in mine if not line["error"]]
        assert row["runs"] == len(here) == 6 and row["hours"] == pytest.approx(6 * 20 / 3600)
        assert row["diverged"] == sum(line["diverged"] for line in here)
        square = statistics.fmean(line["std"] ** 2 for line in here)
        mean = statistics.fmean(line["bias"] for line in here)
        assert row["std"] == pytest.approx(math.sqrt(square - mean**2))
        assert row["bias"] == pytest.approx(mean)
        if row["changed"]:
            lag = statistics.geometric_mean(line["lag"] for line in here)
            assert row["lag"] == pytest.approx(lag)
            assert row["bound"] == {"20": 0.5, "100": 0.25}
        else:
            assert row["lag"] is None and row["bound"] is None
        if row["method"] == "glr":
            assert row["detection"]["missed"] == pytest.approx(1 / 6)
            assert row["detection"]["delay"] == pytest.approx((0 + 0.2 + 0.3 + 0.4 + 0.5) / 5)
            assert row["false_alarms_per_hour"] == pytest.approx(3 / row["hours"])
        else:
            assert row["detection"] is None and row["false_alarms_per_hour"] is None


def test_pooled_does_not_depend_on_the_order_in_which_rows_came(stored, tmp_path):
    rows = some_rows(seeds=40)
    whole = stored(tmp_path / "1", rows, AXES, estimators=["glr", "frozen"])
    blocks = {}
    for row in rows:
        blocks.setdefault(row["case"], []).append(row)
    mixed = [blocks[name] for name in np.random.default_rng(1).permutation(list(blocks))]
    other = stored(tmp_path / "2", [row for block in mixed for row in block], AXES,
                   estimators=["glr", "frozen"])  # fmt: skip
    for by in (None, ["method"], ["fault[0].factor"], []):
        assert whole.pooled(by) == other.pooled(by)  # to the last bit, and in the same order
    assert [row["method"] for row in whole.pooled(["method"])][::2] == ["glr", "frozen"]
    names = [row["parameter"] for row in whole.pooled(["method"])]
    assert names == ["k_T", "f_m"] * 2  # as in the model, and not in the alphabet
    bins = {"fault[0].factor": [1.0, 2.5, 3.0]}
    both = whole.pooled(["fault[0].factor"], bins=bins)
    assert [(row["fault[0].factor"], row["runs"]) for row in both] == [
        (1.75, 160), (1.75, 160), (2.75, 80), (2.75, 80)
    ]  # fmt: skip


# The file and its columns ---------------------------------------------------------------------


@pytest.fixture
def large(monkeypatch):
    """Parts are small, and few columns are in memory."""
    monkeypatch.setattr(source, "PART", 16)
    monkeypatch.setattr(source, "ROOM", 8 * 100 * 3)


def again(results):
    return type(results)(results.folder, results.study)


def test_what_is_added_is_not_in_a_table_that_was_opened(stored, tmp_path, large):
    results = stored(tmp_path, some_rows(), AXES)
    lines = list(results.rows)
    assert lines == list(by_hand(results))
    more = [row | {"seed": row["seed"] + 100} for row in some_rows()]
    stored(tmp_path, more, AXES)
    assert list(results.rows) == lines
    np.testing.assert_array_equal(results.column("std"), [r["std"] or np.nan for r in lines])
    assert len(again(results).rows) == 2 * len(lines)


def test_rows_that_go_while_they_are_read_are_told(stored, tmp_path):
    results = stored(tmp_path, some_rows(), AXES)
    assert len(results)
    change(tmp_path, "DELETE FROM cells WHERE seed = 1001")
    with pytest.raises(StudyError, match="rows were removed while they were read"):
        list(results.rows)
    assert list(again(results).rows) == list(by_hand(results))


def test_a_folder_that_cannot_be_written_is_read(stored, tmp_path):
    results = stored(tmp_path / "run", some_rows(), AXES)
    (tmp_path / "run").chmod(0o500)
    assert list(results.rows) == list(by_hand(results))
    assert [p.name for p in (tmp_path / "run").iterdir()] == ["scores.sqlite"]


@pytest.mark.parametrize("damage", ["cut", "text", "id", "axes"])
def test_a_damaged_file_is_told(stored, tmp_path, damage):
    results = stored(tmp_path, some_rows(), AXES)
    path = tmp_path / "scores.sqlite"
    if damage == "cut":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    elif damage == "text":
        change(tmp_path, "UPDATE cells SET std = 'much' WHERE rowid = 2")
    elif damage == "id":
        change(tmp_path, "UPDATE cells SET scenario = 999 WHERE rowid = 2")
    else:
        change(tmp_path, "UPDATE texts SET text = '{' || id WHERE text LIKE '{%'")
    with pytest.raises((StudyError, OutputError), match=r"scores\.sqlite"):
        list(results.rows)


def test_rows_with_other_columns_are_of_another_version(stored, tmp_path):
    results = stored(tmp_path, some_rows(), AXES)
    change(tmp_path, "ALTER TABLE cells RENAME COLUMN std TO deviation")
    with pytest.raises(StudyError, match=r"another version of flexaxis.*std"):
        list(results.rows)


def test_a_row_is_there_once_and_the_first_stays(stored, tmp_path):
    rows = some_rows()
    results = stored(tmp_path, rows, AXES)
    before = list(results.rows)
    stored(tmp_path, [row | {"std": 7.0} for row in rows], AXES)
    assert list(again(results).rows) == before


@pytest.mark.parametrize(
    ("name", "value"),
    [("scenario", None), ("estimator", None), ("seed", None), ("seed", -1), ("std", "much"),
     ("std", float("nan")), ("lag", float("inf")), ("diverged", 1), ("error", 3)],
)  # fmt: skip
def test_a_row_that_is_none_is_refused_and_none_with_it_is_there(stored, tmp_path, name, value):
    stored(tmp_path, some_rows()[:2])
    with pytest.raises(ValueError, match=f"{name} is "):
        stored(tmp_path, [*some_rows()[2:6], some_rows()[6] | {name: value}])
    assert len(lines_of(tmp_path)) == 2


# Pools ----------------------------------------------------------------------------------------


def test_the_jackknife_of_the_excess_error_is_that_of_leaving_out_one_by_one():
    rng = np.random.default_rng(0)
    each, biases = rng.lognormal(size=9), rng.normal(size=(9, 3))
    root = rng.normal(size=(3, 3))
    none = np.zeros(9, bool)
    slow = pseudo_values(
        lambda i: pooling.excess(each[i], none[i], biases[i], root @ root.T), len(each)
    )
    np.testing.assert_allclose(pooling.excess_values(each, biases, root @ root.T), slow, rtol=1e-12)


def test_the_excess_error_is_pooled_over_the_runs_on_one_scenario(stored, tmp_path):
    """Without that of the common bias of all its parameters; of two scenarios there is none."""
    base, rng = find_scenario("fm_step-v1"), np.random.default_rng(0)
    points = [base.override({"fault[0].factor": f}, inherit=True) for f in (1.5, 2.0)]
    rows, wanted = [], []
    for scenario, factor in zip(points, (1.5, 2.0), strict=True):
        biases = rng.normal(0.2, 0.1, (6, 2))  # of k_T and f_m; 1/J_a is not estimated
        each = rng.lognormal(size=6)
        common = np.array([biases[:, 0].mean(), 0.0, biases[:, 1].mean()])
        assert scenario.identify == ("k_T", "1/J_a", "f_m")
        wanted.append(each.mean() - common @ information(scenario) @ common)
        rows += [
            {"case": f"{factor}{k}", "hash": scenario.hash, "base": base.name, "seed": 1000 + k,
             "scenario": scenario.name, "parameter": name, "changed": name == "f_m",
             "axes": {"fault[0].factor": factor}, "std": 1.0, "bias": float(biases[k, i]),
             "excess": float(each[k]), "lost_before": False}
            for k in range(6) for i, name in enumerate(("k_T", "f_m"))
        ]  # fmt: skip
    study = [{"hash": base.hash, "definition": base.resolved()}]
    results = stored(tmp_path, rows, ["fault[0].factor"], scenarios=study)
    found = [row["excess"] for row in results.pooled(scores=["excess"])]
    assert found == pytest.approx([wanted[0]] * 2 + [wanted[1]] * 2)
    assert min(wanted) > 0
    assert {row["excess"] for row in results.pooled(["method"], scores=["excess"])} == {None}


def test_a_pool_of_ones_own_is_one_line(stored, tmp_path):
    groups = stored(tmp_path, some_rows(), AXES).grouped(["method"])
    std = [line["std"] for line in stored(tmp_path, some_rows(), AXES).rows
           if (line["method"], line["parameter"]) == ("frozen", "f_m")]  # fmt: skip
    pool = pooling.by(np.max)
    key = {"method": "frozen", "parameter": "f_m", "changed": True}
    assert pool(groups.columns(groups.keys.index(key)), "std") == {"std": max(std)}


# The cube -------------------------------------------------------------------------------------


def test_a_product_is_a_cube_with_coordinates_and_units(stored, tmp_path):
    pytest.importorskip("xarray", reason="an optional package")
    rows = [row | {"axes": {"start": row["axes"]["fault[0].factor"]}} for row in some_rows()]
    results = stored(tmp_path, rows, ["start"], points=3)
    found = results.to_xarray()
    assert found["lag"].dims == ("scenario", "estimator", "start", "seed", "parameter")
    assert found["lag"].attrs["units"] == "s" and found["std"].attrs["units"] == "%"
    assert found["excess"].attrs["units"] == "1" and found["cross_talk"].attrs["description"]
    for line in results.rows:
        if line["error"] is None:
            there = found.sel(scenario="s", estimator=line["estimator"], start=line["start"],
                              seed=line["seed"], parameter=line["parameter"])  # fmt: skip
            lag = np.nan if line["lag"] is None else line["lag"]
            np.testing.assert_equal(float(there["lag"]), lag)
            assert bool(there["diverged"]) == line["diverged"]
    assert int(found["std"].notnull().sum()) == 72


def test_a_list_of_points_has_a_dimension_point(stored, tmp_path):
    """Two axes in step: three points, and not nine of which six were never asked for."""
    pytest.importorskip("xarray", reason="an optional package")
    rows = some_rows()
    for row in rows:
        at = row["axes"]["fault[0].factor"]
        row["axes"] = {"start": 1.0 + at, "frozen.gain": at if row["method"] == "frozen" else None}
        if row["method"] == "frozen":
            row["estimator"] = f"frozen[gain={at:g}]"
    results = stored(
        tmp_path, rows, ["start", "frozen.gain"], points=3, estimators=["frozen", "glr"]
    )
    cube = cube_of(results)
    assert list(cube.dimensions) == ["scenario", "method", "point", "seed", "parameter"]
    along, starts = cube.frame.coords, cube.frame["start"].values
    assert along["start"].dims == ("point",) and sorted(set(starts)) == [2.0, 3.0, 4.0]
    std = cube.values("std")
    assert np.isfinite(std).sum() == 72
    seeds, names = list(along["seed"].values), list(along["parameter"].values)
    for line in results.rows:
        if line["error"] is None:
            point = [
                k for k, start in enumerate(starts)
                if start == line["start"] and (line["frozen.gain"] is None)
                == np.isnan(along["frozen.gain"].values[k])
            ]  # fmt: skip
            method = list(along["method"].values).index(line["method"])
            place = (0, method, point[0], seeds.index(line["seed"]), names.index(line["parameter"]))
            assert len(point) == 1 and std[place] == line["std"]


def test_the_cube_of_nothing_is_refused(stored, tmp_path):
    results = stored(tmp_path, some_rows()[-1:], ["fault[0].factor"])
    with pytest.raises(StudyError, match="no rows of a case that could be run"):
        cube_of(results)


def test_every_column_of_numbers_has_a_unit():
    missing = [name for name, kind in COLUMNS.items() if kind == "number" and name not in UNITS]
    assert not missing, f"give them a unit in `schema.UNITS`, '' for a plain number: {missing}"


# Exports --------------------------------------------------------------------------------------


def test_a_csv_is_the_rows_as_text(stored, tmp_path):
    results = stored(tmp_path, some_rows(), AXES)
    assert export.export_csv(results, tmp_path / "rows.csv") == 73
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    for there, line in zip(table, results.rows, strict=True):
        line["told"] = json.dumps(line["told"]) if line["told"] else None
        assert there == {k: "" if v is None else str(v) for k, v in line.items()}


def test_what_cannot_be_written_leaves_nothing(stored, tmp_path):
    results = stored(tmp_path / "run", some_rows(), AXES)
    for write in (export.export_csv, export.export_parquet):
        with pytest.raises(ValueError, match="cannot be written"):
            write(results, tmp_path / "nowhere" / "file")
        assert not (tmp_path / "nowhere").exists()
        (tmp_path / "taken").mkdir(exist_ok=True)
        with pytest.raises(ValueError, match="cannot be written"):
            write(results, tmp_path / "taken")
        assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "taken"]


def test_a_data_frame_has_types(stored, tmp_path):
    pytest.importorskip("pandas", reason="an optional package")
    frame = stored(tmp_path, some_rows(), AXES).to_dataframe()
    assert str(frame["diverged"].dtype) == "boolean" and frame["diverged"].sum() == 4
    assert frame["lag"].dtype == np.float64 and str(frame["seed"].dtype) == "Int64"
    assert frame.groupby(["method", "parameter"])["std"].count().sum() == 72


def test_a_seed_is_one_draw_however_many_points_it_is_at(stored, tmp_path):
    """Five nearly equal points × 8 seeds: an interval of eight draws, not of forty."""
    rng = np.random.default_rng(3)
    shared, own = rng.normal(0, 0.1, 8), rng.normal(0, 0.01, (5, 8))
    logs = shared + own + 0.02 * np.arange(5)[:, None]
    rows = [
        {
            "case": f"{k}{point}", "hash": f"h{point}", "seed": 1000 + k, "scenario": f"s+{point}",
            "axes": {"fault[0].factor": 1.1 + point / 100}, "lag": float(np.exp(logs[point, k])),
            "std": 1.0, "bias": float(logs[point, k]), "lost_before": False,
        }
        for k in range(8)
        for point in range(5)
    ]  # fmt: skip
    results = stored(tmp_path, rows, ("fault[0].factor",))
    (row,) = results.pooled(["method"])
    assert (row["runs"], row["seeds"], row["failed"]) == (40, 8, 0)
    mean = logs.mean(axis=0)
    half = 2.364624 * mean.std(ddof=1) / math.sqrt(8)  # Student's t with 7
    assert np.log(row["lag_interval"]) == pytest.approx([mean.mean() - half, mean.mean() + half])
    low, high = row["bias_interval"]
    assert high - low > 0.9 * 2 * half
    alone = results.pooled(["fault[0].factor"])
    assert {r["runs"] for r in alone} == {r["seeds"] for r in alone} == {8}


def test_false_alarms_an_hour_are_of_calm_hours():
    """Seconds after a fault, in which a move is an answer, are none of them."""
    columns = {"seconds": np.full(8, 900.0), "detection.calm": np.full(8, 450.0),
               "detection.false_alarms": np.ones(8), "seed": np.arange(8.0)}  # fmt: skip
    found = groups._alarms(columns, {"detection": 1.0})
    assert found["hours"] == 2.0 and found["false_alarms_per_hour"] == 8.0
