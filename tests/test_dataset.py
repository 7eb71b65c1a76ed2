"""The scenarios of a board as a data set: the runs of `simulate`, described to the last column."""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.record import load_record
from flexaxis.sim.simulate import simulate

sys.path.append(str(Path(__file__).parents[1] / "docs"))
import dataset


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("dataset")
    dataset.main(["fm_step-v1", "--seeds", "7:9", "-o", str(place)])
    return place


def test_rows_are_the_samples_of_the_runs(folder):
    rows = pd.read_parquet(folder / "samples.parquet")
    scenario = find_scenario("fm_step-v1")
    assert rows.groupby("seed").size().to_dict() == {7: scenario.samples, 8: scenario.samples}
    record = simulate(scenario, [8])[0]
    mine = rows[rows.seed == 8]
    for name in ("time", "torque", "speed", "true_speed"):
        np.testing.assert_array_equal(mine[name], getattr(record, name))
    change = mine.true_f_m.to_numpy()[[0, -1]]
    assert change[1] == pytest.approx(1.5 * change[0])
    again = load_record(folder / "records" / "fm_step-v1-8.nc")
    np.testing.assert_array_equal(again.torque, record.torque)


def test_metadata_say_what_is_there(folder):
    told = json.loads((folder / "croissant.json").read_text())
    table, files = told["distribution"]
    assert table["sha256"] == hashlib.sha256((folder / table["@id"]).read_bytes()).hexdigest()
    assert {path.name for path in folder.glob(files["includes"])} == {
        "fm_step-v1-7.nc", "fm_step-v1-8.nc"}  # fmt: skip
    columns = {f["source"]["extract"]["column"]: f for f in told["recordSet"][0]["field"]}
    rows = pd.read_parquet(folder / table["@id"])
    assert set(columns) == set(rows.columns)
    assert columns["true_k_g"]["description"] == "true k_g in this sample [N m/rad]"
    assert columns["torque"]["dataType"] == "sc:Float"


def test_the_library_of_croissant_takes_it(folder):
    croissant = pytest.importorskip("mlcroissant")
    read = croissant.Dataset(jsonld=str(folder / "croissant.json"))
    assert next(iter(read.records("samples")))["samples/seed"] == 7
