"""A study from file to folder: what is wrong is told first, what is there is not run again."""

import csv
import itertools
import json
import platform

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.engine import run_study
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.storage.schema import COLUMNS, row_files
from flexaxis.experiments.storage.store import rows_in
from flexaxis.experiments.studies.definition import load_study, study_from
from flexaxis.sim.scenario import Scenario
from tests.experiments.command import flexaxis
from tests.experiments.kept_rows import change

FILE = """\
scenario = "short.toml"
estimators = ["rpem-forgetting", "frozen"]
seeds = 2
twins = false
[override]
duration = 4.0
"fault[0].at" = 2.5
[sweep]
fault[0].factor = [1.5, 2.0]
rpem-forgetting.forgetting = [0.99, 0.995]
""".replace("\nfault[0].factor", '\n"fault[0].factor"')


@pytest.fixture
def study_toml(short_toml, tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


def rows_of(folder):
    """Return all rows by case and parameter, without what may differ; none may be there twice."""
    found = {}
    for row in (row for path in row_files(folder) for row in rows_in(path)):
        key = row["case"], row["parameter"]
        assert key not in found
        found[key] = {k: v for k, v in row.items() if k != "cost"}
    return found


# ---------------------------------------------------------------- the file


def test_all_problems_of_a_file_at_once(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(
        'scenario = "fm_stp-v1"\nestimators = ["rpem-forgeting"]\nseeds = 4\n'
        '[sweep]\n"start" = 1.2\n"fault[0].factor" = {low = 1.0, high = 2.0}\n'
    )
    with pytest.raises(StudyError) as caught:
        load_study(path)
    text = str(caught.value)
    assert all(line.startswith(str(path)) for line in text.splitlines())
    for words in ("'fm_step-v1'", "'rpem-forgetting'", "sweep.start: must be an array",
                  "sweep.fault[0].factor: a table of low and high goes with design"):  # fmt: skip
        assert words in text, text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sweeps": {}}, "unknown key 'sweeps'"),
        ({"seeds": "9:3"}, "seeds: give a number of seeds"),
        ({"seeds": 0}, "seeds: give a number of seeds"),
        ({"design": "random"}, "design: must be 'product', 'list' or 'sobol'"),
        ({"design": "list"}, "needs at least one axis"),
        ({"design": "list", "sweep": {"start": [1.0], "burn_in": [1.0, 2.0]}}, "of one length"),
        ({"samples": 4}, 'goes with design = "sobol"'),
        ({"design": "sobol", "samples": 4, "sweep": {"start": [1.0]}}, "must be { low = …"),
        ({"design": "sobol", "samples": 4, "sweep": {"start": {"low": 2.0, "high": 1.0}}},
         "must be below high"),
        ({"design": "sobol", "samples": 4, "sweep": {"start": {"low": 0.0, "high": 1.0,
          "log": True}}}, "needs low above 0"),
        ({"override": {"fault[3].factor": 2.0}}, "no such key"),
        ({"sweep": {"frozn.gain": [1.0]}}, "Did you mean 'frozen.gain'"),
        ({"sweep": {"falt[0].factor": [1.0]}}, "Did you mean 'fault'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(changes, words):
    given = {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen"], "seeds": 1}
    with pytest.raises(StudyError) as caught:
        study_from(given | changes)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ({"fault[0].factor": [1.5, -2.0]}, "fault[0].factor = -2.0: fault[0].factor: must be"),
        ({"fault[0].fctor": [1.5]}, "Did you mean 'factor'"),
        ({"estimator.forgeting": [0.9]}, "forgeting = 0.9: rpem-forgetting has no option"),
        ({"rpem-forgetting.forgetting": [0.9, 1.5]}, "rpem-forgetting.forgetting = 1.5: "),
        ({"duration": [20.0, 8.0]}, "duration = 8.0: fault[0].at: the onset at 10 s is not before"),
    ],
)  # fmt: skip
def test_a_point_that_cannot_be_run_names_key_and_value(sweep, words):
    study = study_from(
        {"name": "s", "scenario": "fm_step-v1", "estimators": ["rpem-forgetting"], "seeds": 1}
        | {"sweep": sweep}
    )
    with pytest.raises(StudyError) as caught:
        make_plan(study)
    assert words in str(caught.value)


# ---------------------------------------------------------------- the plan


def plan(sweep, *, estimators=("rpem-forgetting",), seeds=3, shard=(1, 1), **more):
    table = {"name": "s", "scenario": "fm_step-v1", "estimators": list(estimators), "seeds": seeds}
    return make_plan(study_from(table | {"sweep": sweep} | more), shard=shard)


def cases(made):
    return [
        (variant.scenario().hash, entry.text, seed)
        for unit in made.units()
        for variant in unit.variants
        for entry in variant.entries
        for seed in unit.seeds
    ]


def test_an_option_of_one_estimator_does_not_multiply_the_others():
    made = plan({"start": [1.0, 1.2], "rpem-forgetting.forgetting": [0.9, 0.95, 0.99]},
                estimators=["rpem-forgetting", "frozen"])  # fmt: skip
    found = cases(made)
    assert len(found) == len(set(found)) == 2 * (3 + 1) * 3
    assert "rpem-forgetting[forgetting=0.95]" in {text for _, text, _ in found}
    # where estimates start is nothing to the axis: both values share their records
    assert made.work().cases == len(found) and made.work().records == 3


def test_points_that_define_the_same_run_are_one():
    assert len(plan({"fault[0].factor": [1.5, 2.0, 1.5]}).variants) == 3  # and the twin


def test_quotes_around_dotted_keys_are_optional(tmp_path):
    table = "scenario = 'fm_step-v1'\nestimators = ['frozen']\nseeds = 1\n"
    for number, sweep in enumerate(
        ("excitation.low = [0.1, 0.2]", '"excitation.low" = [0.1, 0.2]')
    ):
        (tmp_path / f"{number}.toml").write_text(table + "[sweep]\n" + sweep)
    one, two = (load_study(tmp_path / f"{number}.toml") for number in (0, 1))
    assert one.points == two.points


@pytest.mark.parametrize("shares", [2, 7, 100])
def test_shares_are_the_whole_and_do_not_overlap(shares):
    sweep = {"fault[0].factor": [1.1, 1.5, 2.0]}
    parts = [cases(plan(sweep, seeds=20, shard=(i, shares))) for i in range(1, shares + 1)]
    assert sorted(itertools.chain(*parts)) == sorted(cases(plan(sweep, seeds=20)))


def test_a_list_is_taken_in_step_and_sobol_fills_the_space():
    made = plan(
        {"fault[0].parameter": ["f_m", "k_T"], "fault[0].factor": [1.5, 0.9]}, design="list"
    )
    assert [v.axes["fault[0].factor"] for v in made.variants] == [1.5, 0.9]
    axes = {"fault[0].factor": {"low": 1.0, "high": 3.0},
            "estimator.forgetting": {"low": 0.9, "high": 0.999, "log": True}}  # fmt: skip
    points = study_from(
        {"name": "s", "scenario": "fm_step-v1", "estimators": ["rpem-forgetting"], "seeds": 1,
         "design": "sobol", "samples": 64, "design_seed": 3, "sweep": axes}
    ).points  # fmt: skip
    factors = np.array([p["fault[0].factor"] for p in points])
    # A (0, m, s)-net: of 64 points one lies in each 64th of an axis (rounding to 6 digits aside).
    assert sorted(np.floor((factors - 1.0) / 2.0 * 64 + 1e-4).astype(int)) == list(range(64))
    first = study_from(
        {"name": "s", "scenario": "fm_step-v1", "estimators": ["rpem-forgetting"], "seeds": 1,
         "design": "sobol", "samples": 5, "design_seed": 3, "sweep": axes}
    ).points  # fmt: skip
    assert first == points[:5]


# ---------------------------------------------------------------- the folder


@pytest.fixture(scope="module")
def finished(short, tmp_path_factory):
    """A study that was run with the command line, and its exit status."""
    home = tmp_path_factory.mktemp("study")
    (home / "short.toml").write_text(short.to_toml(), encoding="utf-8")
    (home / "sweep.toml").write_text(FILE, encoding="utf-8")
    words = ["study", home / "sweep.toml", "-o", home / "out", "--jobs", "1", "--keep", "all"]
    return home / "out", main([str(word) for word in words])


def test_the_folder_of_a_study(finished):
    folder, status = finished
    assert status == 0
    rows = rows_of(folder)
    assert len(rows) == 2 * 2 * (2 + 1) * 3
    assert [f.name for f in folder.glob("scores*")] == ["scores.sqlite"]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count('<figure class="chart"') >= 2 and " src=" not in page
    assert page.count('data-name="Lag over ') == 1
    assert "rpem-forgetting" in page
    one = next(row for row in rows.values() if row["method"] == "rpem-forgetting")
    assert set(one["axes"]) == {"fault[0].factor", "rpem-forgetting.forgetting"}


def test_rows_are_those_of_a_run(finished, short):
    """The study adds columns; the scores are those of the same definition by itself."""
    from flexaxis.experiments.building.estimator_text import parse
    from flexaxis.experiments.running.case import run_case
    from flexaxis.sim.simulate import simulate

    base = short.override({"duration": 4.0, "fault[0].at": 2.5})
    scenario = base.override({"fault[0].factor": 2.0}, inherit=True)
    spec = parse("rpem-forgetting[forgetting=0.99]")
    case = run_case(scenario, simulate(scenario, [1001])[0], spec)
    rows = rows_of(finished[0])
    for row in json.loads(json.dumps(case.rows)):
        there = rows[row["case"], row["parameter"]]
        assert {k: there[k] for k in row if k != "cost"} == {
            k: v for k, v in row.items() if k != "cost"
        }


def test_nothing_is_run_twice_and_what_is_added_is(finished, capsys, tmp_path):
    import shutil

    folder = tmp_path / "out"
    shutil.copytree(finished[0], folder)
    source = folder.parent / "sweep.toml"
    for name in ("short.toml", "sweep.toml"):
        shutil.copy(finished[0].parent / name, folder.parent / name)
    status, out, err = flexaxis(capsys, "study", source, "-o", folder, "--resume", "--json")
    told = json.loads(out)
    assert "12 cases there, and kept; 0 of those asked for" in err
    assert (status, told["run"], told["cases"]) == (0, 0, 12)
    source.write_text(FILE.replace("seeds = 2", 'seeds = "1000:1003"'), encoding="utf-8")
    _, out, _ = flexaxis(capsys, "study", source, "-o", folder, "--resume", "--json", "--jobs", 1)
    assert json.loads(out)["run"] == 6
    assert len(rows_of(folder)) == 18 * 3
    source.write_text(FILE.replace("fault[0].factor", "burn_in"), encoding="utf-8")
    status, _, err = flexaxis(capsys, "study", source, "-o", folder, "--resume")
    assert status == 2 and "this is over burn_in" in err


def test_a_dry_run_leaves_nothing(study_toml, capsys, tmp_path):
    folder = tmp_path / "out"
    status, out, _ = flexaxis(capsys, "study", study_toml, "-o", folder, "--dry-run", "--jobs", 2)
    assert status == 0 and not folder.exists()
    assert "12 cases on 4 records" in out


def test_another_folder_is_left_alone(study_toml, capsys, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "scores.sqlite").write_text('{"case": 1}\n')
    status, _, err = flexaxis(capsys, "study", study_toml, "-o", tmp_path / "out", "--resume")
    assert status == 2 and "is damaged, or no file of rows" in err
    (tmp_path / "out" / "scores.sqlite").rename(tmp_path / "out" / "scores.jsonl")
    status, _, err = flexaxis(capsys, "study", study_toml, "-o", tmp_path / "out")
    assert status == 2 and "is of flexaxis 0.1: type flexaxis merge" in err
    status, _, err = flexaxis(capsys, "rerun", tmp_path)
    assert status == 2 and "is not the folder of a run or a study" in err


def test_trajectories_are_those_of_all_cases(finished):
    import h5netcdf

    folder, _ = finished
    files = {path.stem: path for path in (folder / "trajectories").glob("*.nc")}
    assert files.keys() == {case for case, _ in rows_of(folder)}
    with h5netcdf.File(files.popitem()[1]) as file:
        assert file["theta"].shape == (800, 3)


def test_shares_merge_to_what_one_process_gives(finished, capsys, tmp_path):
    folder, _ = finished
    source, parts = folder.parent / "sweep.toml", [tmp_path / "1", tmp_path / "2"]
    words = ("study", source, "-o", parts[0], "--shard", "1/2", "--jobs", 1)
    status, out, _ = flexaxis(capsys, *words)
    assert status == 0 and out.splitlines()[-1] == str(parts[0])
    run_study(make_plan(load_study(source), shard=(2, 2)), parts[1])
    assert [f.name for f in parts[1].glob("scores*")] == ["scores-2-of-2.sqlite"]
    whole = ("-o", tmp_path / "all")
    status, out, _ = flexaxis(capsys, "study", "--from", *parts, parts[0], *whole, "--json")
    assert json.loads(out)["doubles"] == len(rows_of(parts[0])) // 3
    assert rows_of(tmp_path / "all") == rows_of(folder)
    assert flexaxis(capsys, "study", "--from", *parts, *whole)[0] == 0  # the same again
    assert flexaxis(capsys, "study", "--from", parts[0], *whole)[0] == 0
    assert rows_of(tmp_path / "all") == rows_of(folder)


def test_rerun_finds_a_row_that_was_changed(finished, capsys, tmp_path):
    import shutil

    folder = tmp_path / "out"
    shutil.copytree(finished[0], folder)
    status, out, _ = flexaxis(capsys, "rerun", folder, "--sample", 2)
    assert status == 0 and "2 of 2 cases agree; 2 had to be identical" in out
    change(folder, "UPDATE cells SET std = std * ?", 1 + 1e-12)  # less than another machine may
    status, out, _ = flexaxis(capsys, "rerun", folder, "--sample", 5)  # of 12, 4 of them frozen
    assert status == 1 and "k_T: std was" in out
    assert any(r["case"] in out for r in rows_of(folder).values() if r["method"] != "frozen")
    change(folder, "UPDATE texts SET text = 'elsewhere' WHERE text = ?", platform.node())
    assert flexaxis(capsys, "rerun", folder, "--sample", 5)[0] == 0


# ---------------------------------------------------------------- results


def test_results_in_python(finished):
    results = Results.load(finished[0])
    some = results.select({"method": "rpem-forgetting", "fault[0].factor": [2.0], "changed": True})
    lags = [row["lag"] for row in some.rows]
    assert len(lags) == len(some.rows) == 2 * 2
    pooled = some.pooled(["method"])
    assert len(pooled) == 1 and pooled[0]["lag"] == pytest.approx(
        np.exp(np.log(lags).mean()), rel=1e-12
    )
    assert pooled[0]["lag_interval"] is None  # of four nothing is said
    (both,) = results.select({"method": "rpem-forgetting", "changed": True}).pooled(["method"])
    assert both["lag_interval"] is None and both["runs"] > 4 > both["seeds"]  # nor of two seeds
    assert pooled[0]["hours"] == pytest.approx(4 * 4 / 3600)
    assert results.values()["fault[0].factor"] == [1.5, 2.0]
    assert not results.failures()
    with pytest.raises(StudyError, match="Did you mean 'method'"):
        results.select({"metod": "x"})
    with pytest.raises(StudyError, match="Did you mean 'lag'"):
        results.pooled(scores=["lagg"])


def test_tables_hold_the_same_numbers(finished):
    pandas = pytest.importorskip("pandas", reason="an optional package")
    pytest.importorskip("xarray", reason="an optional package")
    results = Results.load(finished[0])
    table = results.to_dataframe()
    assert list(table.columns) == [*COLUMNS, "fault[0].factor", "rpem-forgetting.forgetting"]
    found = results.to_xarray()
    for line in table[table["changed"].astype(bool)].to_dict("records"):
        there = found.sel(
            {key: line[key] for key in ("estimator", "seed", "parameter", "fault[0].factor")}
            | {"scenario": line["base"]}
        )
        assert float(there["lag"]) == line["lag"]
        option = float(there["rpem-forgetting.forgetting"])
        assert option == line["rpem-forgetting.forgetting"] or pandas.isna(option)


def test_exports_hold_the_same_rows(finished, tmp_path):
    folder, _ = finished
    lines = list(Results.load(folder).rows)
    target = tmp_path / "rows.csv"
    assert Results.load(folder).to_csv(target) == len(lines)
    with target.open(newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [float(row["std"]) for row in table] == [line["std"] for line in lines]
    assert {row["rpem-forgetting.forgetting"] for row in table} == {"", "0.99", "0.995"}
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra `parquet`")
    target = tmp_path / "rows.parquet"
    assert Results.load(folder).to_parquet(target) == len(lines)
    assert parquet.read_table(target)["lag"].to_pylist() == [line["lag"] for line in lines]


def test_a_missing_package_is_named_with_the_line_that_installs_it(finished, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "xarray", None)  # import then fails
    with pytest.raises(StudyError, match="pip install xarray"):
        Results.load(finished[0]).to_xarray()


def test_no_axis_can_take_the_name_of_a_column():
    assert not {column.split(".")[0] for column in COLUMNS} & set(Scenario.model_fields)


def test_the_documentation_has_every_column():
    from pathlib import Path

    text = (Path(__file__).parents[2] / "docs" / "studies.md").read_text(encoding="utf-8")
    missing = [c for c in COLUMNS if f"`{c}`" not in text and f"`{c.split('.')[0]}.N`" not in text]
    assert not missing


def test_the_examples_can_be_run():
    from pathlib import Path

    examples = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.toml"))
    assert examples
    for path in examples:
        assert make_plan(load_study(path)).work().cases > 0
