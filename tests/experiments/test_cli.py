"""The command line: what it prints, where, with which status; and wrong use in one clear line."""

import argparse
import errno
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import h5netcdf
import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import options
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import parser
from flexaxis.experiments.commands.options import COMMANDS, answer
from flexaxis.experiments.files import OutputError, check_not_input, write_json, write_text
from flexaxis.sim.simulate import simulate
from tests.experiments.command import flexaxis

TOP = parser()
SUBS = next(a for a in TOP._actions if isinstance(a, argparse._SubParsersAction)).choices
ONE = ("--jobs", "1", "--seeds", "2")


def typed(capsys, *words):
    """Status and output of a command that argparse itself may refuse."""
    try:
        return flexaxis(capsys, *words)
    except SystemExit as stop:
        return (stop.code, *capsys.readouterr())


# ---------------------------------------------------------------- help


def test_every_option_has_a_sentence_and_every_command_an_example():
    """With a default for what may be left out."""
    wrong = []
    for name, sub in {"": TOP, **SUBS}.items():
        assert not name or f"flexaxis {name}" in sub.description.split("example:")[1]
        for action in sub._actions:
            text = action.help or ""
            optional = not action.required and action.nargs != 0 and action.option_strings
            sentence = re.fullmatch(r"\S.*[\w).%]\.", text) and text.count("(") == text.count(")")
            if text == "show this help message and exit":
                continue
            if not sentence or (optional and "default" not in text and "such as" not in text):
                wrong.append((name, action.dest, text))
    assert not wrong


@pytest.mark.parametrize("name", REGISTRY)
def test_every_option_of_an_estimator_has_a_sentence(name):
    assert not [key for key, (_, text) in options(REGISTRY[name]).items() if not text.endswith(".")]


def test_the_help_has_every_command(capsys):
    assert len(COMMANDS) == 17 and typed(capsys)[:2] == (0, TOP.format_help())
    for name, (main, _) in COMMANDS.items():
        assert re.search(rf"^ +{name} +{main.__doc__[:20]}", TOP.format_help(), re.MULTILINE)


# ---------------------------------------------------------------- quick answers


def test_a_mistake_and_a_list_import_nothing_heavy():
    heavy = {"mujoco", "numba", "matplotlib", "control", "scipy", "pandas"}
    lines = [["list"], ["--help"], ["rnu"], ["run", "fm_stp"], ["run", "smoke", "--estimtor", "e"]]
    code = (
        "import sys\nfrom flexaxis.experiments.cli import main\n"
        f"for words in {lines!r}:\n"
        "    try: main(words)\n"
        "    except SystemExit: pass\n"
        f"print(sorted({heavy!r} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "[]"


MISTAKES = [
    (["rnu", "smoke"], "Did you mean 'run'?"),
    (["run", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["run", "smoke", "--estimtor", "glr"], "Did you mean '--estimator'?"),
    (["run", "fm_step", "--estimator", "ekf[nois=1]"], "Did you mean 'noise'?"),
    (["run", "fm_step", "--estimator", "rpem-forgetting[forgetting=1.2]"], "(0, 1]"),
    (["run", "fm_step", "--seeds", "5:5"], "give a number of seeds"),
    (["estimate", "ther.nc"], "Did you mean 'there.nc'?"),
    (["compare", "--base", "frozn", "--candidate", "ekf"], "Did you mean 'frozen'?"),
    (["compare", "--base", "ekf", "--candidate", "ekf", "--margin", "lagg=2%"], "mean 'lag'"),
    (
        ["study", "there.toml", "--seeds", "5"],
        "unknown argument '--seeds'. See flexaxis study --help",
    ),
    (["new", "sub/x.py"], "sub/x.py: cannot be written"),
    (["new", "my-estimator.py"], "letters, digits and underscores"),
    (["simulate", "fm_step", "--seed", "-1"], "seed -1: a seed must be an integer"),
    (["simulate", "fm_step", "--as-log", "csv", "--units", "deg,furlong"], "furlong"),
]


@pytest.mark.parametrize(("words", "hint"), MISTAKES, ids=lambda x: " ".join(x)[:50])
def test_a_mistake_is_one_line_with_what_was_meant(capsys, tmp_path, monkeypatch, words, hint):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "there.nc", "there.toml"):
        (tmp_path / name).touch()
    status, out, err = typed(capsys, *words)
    assert (status, out) == (2, "") and hint in err and "Traceback" not in err
    assert len(err.splitlines()) == 1 and len(list(tmp_path.iterdir())) == 3


BAD_TOML = """\
name = "bad"
duration = 20.0
durration = 3
noise.speed = "loud"
[[fault]]
kind = "stp"
"""


def test_all_errors_of_a_file_at_once(capsys, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(BAD_TOML, encoding="utf-8")
    status, out, err = flexaxis(capsys, "run", path, "-o", tmp_path / "out")
    assert (status, out) == (2, "")
    for words in ("durration", "duration", "noise.speed", "fault[0]"):
        assert words in err, err
    assert not (tmp_path / "out").exists()


def test_a_crash_is_one_line_and_status_70(capsys, tmp_path, short_toml, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text("class Mine:\n    def __init__(self, nominal, period): 1 / 0\n")
    status, out, err = flexaxis(capsys, "check", "own.py:Mine", "--json")
    told = json.loads(out)
    assert status == told["status"] == 70 and "ZeroDivisionError" in told["error"]

    def atomic(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("flexaxis.sim.record.atomic", atomic)
    status, _, err = flexaxis(capsys, "simulate", short_toml, "-o", "rec.nc")
    assert status == 70 and "rec.nc: cannot be written" in err and len(err.splitlines()) == 1


def test_ctrl_c_says_the_line_that_resumes(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def pressed(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("flexaxis.benchmark", pressed, raising=False)
    status, _, err = flexaxis(capsys, "run", "fm_step", "--overwrite", "-q")
    assert status == 130 and err.endswith("from the saved results, run flexaxis run fm_step\n")


# ---------------------------------------------------------------- look


def test_the_list_shows_groups_first_and_one_line_each(capsys):
    assert "one parameter jumps" in flexaxis(capsys, "list")[1]
    lines = flexaxis(capsys, "list", "--find", "friction")[1].splitlines()
    assert len(lines) == 61 and "--all" in lines[-1]
    names = [line.split()[0] for line in lines[:-1]]
    assert len(set(names)) == len(names) and not any(name.endswith("-v2") for name in names)
    assert (
        "no entry contains 'no such thing'"
        in flexaxis(capsys, "list", "--find", "no such thing")[1]
    )
    told = json.loads(flexaxis(capsys, "list", "--json")[1])
    assert "fm_step-v1" in {row["name"] for row in told["scenarios"]}
    assert "glr" in {row["name"] for row in told["estimators"]}


def test_the_list_of_faults_names_parameter_and_scenario(capsys):
    told = json.loads(flexaxis(capsys, "list", "faults", "--json")[1])["faults"]
    found = {row["parameter"]: row for row in told}
    assert "demagnetised" in found["k_T"]["fault"] and "kt_step" in found["k_T"]["scenarios"]
    for row in told:
        for name in row["scenarios"].split(", "):
            assert {fault.parameter for fault in find_scenario(name).fault} == {row["parameter"]}


def test_what_show_prints_can_be_run(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    mine = find_scenario("fm_step-v1").override({"name": "mine", "card": "two\nlines"})
    path.write_text(mine.to_toml(), encoding="utf-8")
    path.write_text(flexaxis(capsys, "show", path)[1], encoding="utf-8")
    assert find_scenario(str(path)).hash == mine.hash
    text = flexaxis(capsys, "show", "glr")[1]
    assert "walk = 0.0007" in text and "[s]" in text
    assert "fm_double-v1" in flexaxis(capsys, "show", "smoke")[1]


# ---------------------------------------------------------------- runs


def test_simulate_then_estimate(capsys, short_toml, tmp_path):
    record, estimates = tmp_path / "rec.nc", tmp_path / "est.nc"
    status, out, _ = flexaxis(capsys, "simulate", short_toml, "--seed", 3, "-o", record)
    assert (status, out.strip()) == (0, str(record))
    status, out, _ = flexaxis(capsys, "estimate", record, "-o", estimates, "--json")
    told = json.loads(out)
    assert status == 0 and told["truth"]["f_m"] == pytest.approx(0.075)
    with h5netcdf.File(estimates, decode_vlen_strings=True) as file:
        assert list(file["estimate"][:]) == ["k_T", "1/J_a", "f_m"]
        assert file["theta"].shape == (1600, 3) and file["covariance"].shape == (1600, 3, 3)
        assert told["last"]["k_T"] == file["theta"][-1, 0]
    status, out, _ = flexaxis(capsys, "estimate", record, "--estimator", "frozen")
    *_, sentence, path = out.splitlines()
    assert "Final error of frozen: " in sentence and "f_m -33.33 %" in sentence
    assert path == str(tmp_path / "rec-estimates.nc")
    record.write_bytes(record.read_bytes()[:5000])
    status, _, err = flexaxis(capsys, "estimate", record)
    assert status == 2 and str(record) in err and len(err.splitlines()) == 1


BOTH = ("--estimator", "frozen", "--estimator", "ekf", *ONE)


@pytest.mark.whole
@pytest.mark.usefixtures("recorded")
def test_a_benchmark_from_the_command_line_to_its_artefacts(capsys, short_toml, tmp_path):
    """Two estimators: a table, scores, a summary and a page."""
    status, out, err = flexaxis(capsys, "run", short_toml, *BOTH, "-o", tmp_path / "r", "-q")
    assert status == 0 and not err and "frozen" in out and "ekf" in out
    for name in ("scores.csv", "report.html", "summary.json"):
        assert (tmp_path / "r" / name).stat().st_size > 500
    rows = json.loads((tmp_path / "r" / "summary.json").read_text())["rows"]
    lag = {row["estimator"]: row["lag"] for row in rows if row["parameter"] == "f_m"}
    assert lag["frozen"] > lag["ekf"]


@pytest.mark.slow
def test_parts_together_are_the_whole_and_rerun_checks_them(capsys, short_toml, tmp_path):
    """A part that is missing and a number that was changed are reported."""
    parts, whole = [tmp_path / "1", tmp_path / "2"], tmp_path / "whole"
    for i, part in enumerate(parts, 1):
        words = ("run", short_toml, *BOTH, "--shard", f"{i}/2", "-o", part)
        assert flexaxis(capsys, *words)[0] == 0
    status, out, _ = flexaxis(capsys, "run", "--from", *parts, "-o", whole)
    assert status == 0 and out.splitlines()[-1] == f"report: {whole}/report.html"
    flexaxis(capsys, "run", short_toml, *BOTH, "-o", tmp_path / "r", "-q")
    rows = [json.loads((folder / "summary.json").read_text())["rows"]
            for folder in (whole, tmp_path / "r")]  # fmt: skip
    for one, other in zip(*rows, strict=True):
        assert one["lag"] == other["lag"] and one["std"] == other["std"]
    page = (whole / "report.html").read_bytes()
    told = json.loads(flexaxis(capsys, "report", whole, "--json")[1])
    assert told["report"] == f"{whole}/report.html"
    assert (whole / "report.html").read_bytes() == page
    status, out, _ = flexaxis(capsys, "run", "--from", parts[0], "-o", tmp_path / "half")
    assert status == 1 and "2 cases are missing, because no shard contains" in out
    status, out, _ = flexaxis(capsys, "rerun", whole, "--sample", 2, "--jobs", 1)
    assert status == 0 and "6 rows compared: the largest relative difference is 0 " in out
    with sqlite3.connect(whole / "scores.sqlite") as rows:
        rows.execute("UPDATE cases SET numbers = (SELECT numbers FROM cases WHERE seed = 1000)")
    status, out, _ = flexaxis(capsys, "rerun", whole, "--jobs", 1)
    assert status == 1 and "difference is 0 " not in out


@pytest.mark.slow
def test_a_sweep_is_a_table_a_sentence_and_a_figure(capsys, short_toml, monkeypatch, tmp_path):
    """Faster settings are noisier; the reference is beside any estimator."""
    monkeypatch.chdir(tmp_path)
    status, out, _ = flexaxis(capsys, "tune", "ekf", "--sweep", short_toml, *ONE)
    *table, sentence, path = out.splitlines()
    assert status == 0 and path == "figure: results/tune/sweep.svg"
    assert "too few for a ranking" in sentence and sum("ekf[" in line for line in table) >= 5
    told = json.loads(flexaxis(capsys, "tune", "ekf", "--sweep", short_toml, *ONE, "--json")[1])
    for name in ("ekf", "rpem-forgetting"):
        own = [row for row in told["tradeoff"]["points"] if row["estimator"] == name]
        own.sort(key=lambda row: row["factor"])
        assert len({row["std"] for row in own}) == len(own) >= 5
        assert own[0]["lag"] > own[-1]["lag"] and own[0]["std"] < own[-1]["std"]
    assert "lag [s]" in Path(path.removeprefix("figure: ")).read_text(encoding="utf-8")
    status, _, err = flexaxis(capsys, "rerun", "results/tune")
    assert status == 2 and "give the folder of a run or a study" in err


STUDY = """\
scenario = "short.toml"
estimators = ["frozen", "ekf"]
seeds = 2
[sweep]
"fault[0].factor" = [1.2, 2.0]
friction.coulomb = [0, 0.05]
"""


@pytest.fixture
def sizes(short, tmp_path, monkeypatch):
    """Define a study of four variants in the current folder."""
    monkeypatch.chdir(tmp_path)
    brief = short.override({"duration": 5.0, "burn_in": 0.5, "fault[0].at": 3.0})
    Path("short.toml").write_text(brief.to_toml(), encoding="utf-8")
    Path("sizes.toml").write_text(STUDY, encoding="utf-8")


@pytest.mark.slow
def test_the_plan_of_a_study_and_a_second_run_that_changes_nothing(capsys, sizes):
    status, out, _ = flexaxis(capsys, "study", "sizes.toml", "--dry-run")
    assert status == 0 and "4 variants, 16 cases: about" in out
    assert "fault[0].factor = 1.2, friction.coulomb = 0.05" in out and "MB in" in out
    assert not Path("results").exists()
    out = flexaxis(capsys, "study", "sizes.toml", "--jobs", 1)[1]
    before = Path("results/sizes/scores.csv").read_bytes()  # with the time of each case
    assert flexaxis(capsys, "study", "sizes.toml", "--jobs", 1)[1] == out
    assert Path("results/sizes/scores.csv").read_bytes() == before
    told = json.loads(flexaxis(capsys, "study", "sizes.toml", "--dry-run", "--json")[1])
    assert told["cases"] == 16 and told["seconds"] > 0


@pytest.mark.whole
def test_a_fault_study_from_the_command_line_to_its_artefacts(capsys, sizes):
    """A table of results and a page."""
    Path("sizes.toml").write_text(STUDY.replace("[0, 0.05]", "[0.05]"), encoding="utf-8")
    status, out, _ = flexaxis(capsys, "study", "sizes.toml", "--jobs", 1)
    *table, path = out.splitlines()
    assert status == 0 and path == "report: results/sizes/report.html"
    assert sum("frozen" in line for line in table) == sum("ekf" in line for line in table) == 2
    assert Path(path.removeprefix("report: ")).stat().st_size > 5000


# ---------------------------------------------------------------- json and files


def test_json_has_null_for_what_is_not_finite(capsys):
    args = argparse.Namespace(json=True, command="c", line="flexaxis c")
    content = {"a": np.float64("nan"), "b": np.arange(2), "c": (float("inf"), Path("x/y")), 1: True}
    assert answer(args, content, 1) == 1
    told = json.loads(capsys.readouterr().out)
    assert told.pop("flexaxis") and told == {
        "command": "c", "status": 1, "line": "flexaxis c", "a": None, "b": [0, 1],
        "c": [None, "x/y"], "1": True,
    }  # fmt: skip


def test_every_command_is_documented_with_its_json():
    text = (Path(__file__).parents[2] / "docs" / "json.md").read_text()
    for name in SUBS.keys() - {"demo"}:
        assert re.search(rf"^\| .*`{name}\b", text, re.MULTILINE), name


@pytest.fixture
def here(short, short_toml, tmp_path, monkeypatch):
    """One of everything that a command reads."""
    monkeypatch.chdir(tmp_path)
    simulate(short, [0])[0].save("rec.nc")
    Path("study.toml").write_text('scenario = "short.toml"\nestimators = ["frozen"]\nseeds = 2\n')
    shutil.copy(Path(__file__).parent / "wrong.py", "own.py")
    for name in ("map.toml", "axis.toml"):
        Path(name).touch()
    Path("part").mkdir()
    return tmp_path


REFUSED = [
    ["simulate", "short.toml", "-o", "short.toml"],
    ["estimate", "rec.nc", "-o", "nowhere/../rec.nc"],
    ["estimate", "rec.nc", "--estimator", "own.py:Own[a=1]", "-o", "own.py"],
    ["import", "rec.nc", "-o", "rec.nc"],
    ["import", "rec.nc", "--map", "map.toml", "-o", "map.toml"],
    ["identify", "rec.nc", "--model", "axis.toml", "-o", "axis.toml"],
    ["track", "rec.nc", "--identify", "k_T", "--model", "axis.toml", "-o", "axis.toml"],
    ["run", "--from", "part", "-o", "part"],
    ["study", "study.toml", "-o", "study.toml"],
    ["compare", "part", "part/../part", "-o", "part"],
]


@pytest.mark.parametrize("words", REFUSED, ids=" ".join)
def test_an_input_is_refused_as_output(here, capsys, words):
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    status, out, err = flexaxis(capsys, *words)
    assert (status, out, len(err.splitlines())) == (2, "", 1), err
    assert "is an input of this command" in err or ".nc" in words[-1] or "ends in" in err
    assert before == {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}


def test_what_cannot_be_written_is_one_line_and_leaves_the_old_file(tmp_path):
    check_not_input(["fm_step-v1", None, "", "x" * 5000], "fm_step-v1", None, "new.nc")
    with pytest.raises(OutputError, match="cannot be written: No such file or directory"):
        write_json(tmp_path / "missing" / "results.json", {})
    target = tmp_path / "results.json"
    write_json(target, {"k_T": 1.0})
    with pytest.raises(ValueError, match="JSON"):
        write_json(target, {"k_T": float("nan")})
    with pytest.raises(UnicodeEncodeError):
        write_text(target, "half a text, then \ud800")
    assert target.read_text() == '{\n "k_T": 1.0\n}\n'
