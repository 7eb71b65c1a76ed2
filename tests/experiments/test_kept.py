"""Into a folder rows are added: nothing goes without --overwrite, and that is said."""

import json
import re
import sqlite3
from contextlib import closing
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.results.pooled import load
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark


def wanted(*scenarios, estimators=("rpem-forgetting",), seeds=(0, 1)):
    study = Study("s", scenarios, tuple(estimators), tuple(seeds))
    return Benchmark(study, "t", "flexaxis run short")


def rows_of(folder):
    """Return what a folder holds, by all that tells rows apart."""
    rows = Results.load(folder, whole=True).rows
    return {(r["hash"], r["estimator"], r["seed"], r["parameter"]): r for r in rows}


def test_what_ctrl_c_has_left_is_kept_by_another_question(short, tmp_path, capsys):
    landed = count(1)

    def stop(outcome):
        if next(landed) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        benchmark(wanted(short, seeds=range(40)), tmp_path, Means(advance=stop))
    before = rows_of(tmp_path)
    assert len(before) == 2 * 2 * 3  # units of two seeds
    capsys.readouterr()
    found = benchmark(wanted(short, estimators=["frozen"]), tmp_path)
    assert (
        "4 cases there, and kept; 2 of those asked for are still to be run"
        in capsys.readouterr().err
    )
    after = rows_of(tmp_path)
    assert {key: after[key] for key in before} == before
    assert len(after) == len(before) + 2 * 3
    assert {row["estimator"] for row in found.summary["rows"]} == {"frozen"}


def test_the_summary_is_of_what_was_asked_for(short, tmp_path):
    """Whatever else the folder holds: scenarios of one name, estimators, seeds."""
    other = short.override({"duration": 7.0})
    benchmark(wanted(other, seeds=range(3)), tmp_path / "one")
    benchmark(
        wanted(short, estimators=["frozen", "rpem-forgetting"], seeds=range(5)), tmp_path / "one"
    )
    found = benchmark(wanted(short), tmp_path / "one").summary
    alone = benchmark(wanted(short), tmp_path / "two").summary

    def timeless(summary):
        return [{k: v for k, v in row.items() if k != "cost"} for row in summary["rows"]]

    assert timeless(found) == timeless(alone) and found["seeds"] == [0, 1]
    assert list(found["scenarios"]) == ["short"] and list(found["estimators"]) == [
        "rpem-forgetting"
    ]
    assert Results.load(tmp_path / "one").cases == 2
    assert Results.load(tmp_path / "one", whole=True).cases == 3 + 10
    assert load(tmp_path / "one").summary == found
    both = [load(tmp_path / name).curves for name in ("one", "two")]
    np.testing.assert_array_equal(both[0][0].high, both[1][0].high)


def test_a_run_again_runs_nothing_and_says_so(short_toml, tmp_path, capsys):
    words = ["run", str(short_toml), "--estimator", "frozen", "--seeds", "3", "--jobs", "1"]
    assert main([*words, "-o", str(tmp_path / "out")]) == 0
    kept = rows_of(tmp_path / "out")
    first = json.loads((tmp_path / "out" / "summary.json").read_text())["rows"]
    capsys.readouterr()
    assert main([*words, "-o", str(tmp_path / "out")]) == 0
    assert (
        "3 cases there, and kept; 0 of those asked for are still to be run"
        in capsys.readouterr().err
    )
    assert rows_of(tmp_path / "out") == kept
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["rows"] == first


@pytest.mark.parametrize("words", [[], ["--resume"]])
def test_only_overwrite_removes(short_toml, tmp_path, words):
    def run(estimator, *more):
        line = ["run", short_toml, "--estimator", estimator, "--seeds", 2, "--jobs", 1]
        return main([str(word) for word in [*line, "-o", tmp_path / "out", *more]])

    own = tmp_path / "out" / "mine.txt"
    assert run("frozen") == 0
    own.write_text("not of a result")
    assert run("rpem-forgetting", *words) == 0
    assert len(rows_of(tmp_path / "out")) == 2 * 2 * 3
    assert run("rpem-forgetting", "--overwrite") == 0
    assert {key[1] for key in rows_of(tmp_path / "out")} == {"rpem-forgetting"}
    assert own.read_text() == "not of a result"
    with pytest.raises(SystemExit):
        run("frozen", "--overwrite", "--resume")


def test_a_comparison_and_a_run_are_side_by_side(short, tmp_path):
    run_study(wanted(short).study, tmp_path)
    before = rows_of(tmp_path)
    with Bench([short], tmp_path) as bench:
        bench.runs([short], ["frozen", "rpem-forgetting"], [0, 1, 2])
    after = rows_of(tmp_path)
    assert {key: after[key] for key in before} == before and len(after) == 6 * 3


def test_the_documented_lines_read_a_folder(short, tmp_path):
    """Those of docs/running.md, as they stand there."""
    run_study(wanted(short).study, tmp_path / "results")
    text = (Path(__file__).parents[2] / "docs/running.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^(pandas\.read_sql.*)$", text, re.MULTILINE)
    with closing(sqlite3.connect(tmp_path / "results" / "scores.sqlite")) as db:
        given = SimpleNamespace(connect={f"{tmp_path}/results/scores.sqlite": db}.get)
        names = {"pandas": pandas, "sqlite3": given}
        frame = eval(line.replace("results/smoke", str(tmp_path / "results")), names)
    assert len(frame) == 2 * 3 and set(frame["parameter"]) == {"k_T", "1/J_a", "f_m"}
    whole = Results.load(tmp_path / "results").to_dataframe()
    pandas.testing.assert_series_equal(frame["std"], whole["std"])
