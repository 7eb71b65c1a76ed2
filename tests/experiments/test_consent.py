"""Text of a file is not run unasked: studies, stored rows and lessons that name code."""

import json
import shlex
import sys

import pytest

from flexaxis.experiments.building.code import CodeRefused, code_named, names_code, require
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.engine import run_study
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.studies.definition import load_study, study_from
from tests.experiments.kept_rows import change

PROGRAM = """\
import pathlib, struct, sys
pathlib.Path({mark!r}).touch()
take, give = sys.stdin.buffer.read, sys.stdout.buffer.write
version, mark = struct.unpack("<8xII", take(16))
period, output, values, names = struct.unpack("<dIII", take(20))
take(40 * values + 32 * names)
give(b"FLEXAXIS" + struct.pack("<IIII", version, mark, 1, output) + b"f_m".ljust(32, b"\\0"))
sys.stdout.flush()
while len(count := take(8)) == 8:
    n, = struct.unpack("<Q", count)
    take(16 * n)
    give(struct.pack("<d", 0.05) * n)
    sys.stdout.flush()
"""
MODULE = """\
import pathlib
pathlib.Path({mark!r}).touch()
class Mine:
    names, output = ("f_m",), "speed"
    def __init__(self, nominal, period, *, gain=1.0):
        self.theta = [nominal["f_m"]]
    def step(self, u, y):
        return self.theta
"""


@pytest.fixture(params=["file", pytest.param("module", marks=pytest.mark.slow), "pipe"])
def code(request, tmp_path, monkeypatch):
    """An estimator's text that names code, and the file that is there once the code has run."""
    mark = tmp_path / "mark"
    (tmp_path / "program.py").write_text(PROGRAM.format(mark=str(mark)))
    module = f"stranger_{request.param}_{tmp_path.name}".replace("-", "_")
    (tmp_path / f"{module}.py").write_text(MODULE.format(mark=str(mark)))
    monkeypatch.syspath_prepend(tmp_path)
    texts = {
        "file": f"{tmp_path / module}.py:Mine[gain=2.0]",
        "module": f"{module}:Mine",
        "pipe": shlex.join([sys.executable, str(tmp_path / "program.py")]),
    }
    text = texts[request.param]
    return ("pipe:" + text if request.param == "pipe" else text), mark


@pytest.fixture
def study_file(code, short_toml, tmp_path):
    path = tmp_path / "study.toml"
    content = ["scenario = 'short.toml'", "seeds = 2", "override.duration = 7.0"]
    content += [f"estimators = ['frozen', {json.dumps(code[0])}]"]
    path.write_text("\n".join(content))
    return path


def flexaxis(capsys, *words):
    status = main([str(word) for word in words])
    return (status, *capsys.readouterr())


def refused(status, err, text, *words):
    """Whether it was refused, with the text and with what to type, which is returned as words."""
    lines = [line.removeprefix("flexaxis: ") for line in err.splitlines()]
    assert status == 2 and f"  {text}" in lines
    command = lines[-1].partition("type: flexaxis ")[2]
    assert shlex.split(command) == [*map(str, words), "--run-code"]
    return shlex.split(command)


def test_a_study_that_names_code_is_refused_until_told(code, study_file, tmp_path, capsys):
    text, mark = code
    jobs = 2 if ".py:" in text else 1
    words = ["study", study_file, "-o", tmp_path / "out", "--jobs", jobs]
    status, out, err = flexaxis(capsys, *words)
    again = refused(status, err, text, *words)
    assert not out and not mark.exists() and not (tmp_path / "out").exists()
    # What is to be typed runs it; the workers are not asked again.
    status, out, _ = flexaxis(capsys, *again)
    assert status == 0 and mark.exists() and "4 of 4 cases done" in out


@pytest.mark.parametrize("consent", [(), ("--run-code",)])
def test_a_dry_run_runs_no_code(code, study_file, capsys, consent):
    text, mark = code
    status, out, err = flexaxis(capsys, "study", study_file, "--dry-run", *consent)
    assert "4 cases on 2 records" in out and not mark.exists()
    if consent:
        assert status == 0
    else:
        refused(status, err, text, "study", study_file)


def test_a_sweep_over_options_of_code_runs_none(code, study_file, capsys):
    text, mark = code
    swept = "start" if text.startswith("pipe:") else f"{text.partition('[')[0]}.gain"
    with study_file.open("a") as file:
        file.write(f'\nsweep."{swept}" = [1.0, 2.0]\n')
    study_file.write_text(study_file.read_text().replace("'frozen', ", ""))
    status, out, _ = flexaxis(capsys, "study", study_file, "--dry-run")
    assert status == 2 and ": 4 cases on" in out and not mark.exists()


def test_programs_say_it_too(code, study_file, tmp_path):
    _, mark = code
    study = load_study(study_file)
    plan = make_plan(study)
    for what in (study, plan):
        with pytest.raises(CodeRefused, match="pass run_code=True"):
            run_study(what, tmp_path / "out")
    assert not mark.exists()
    assert run_study(study, tmp_path / "out", run_code=True).failed == 0
    assert mark.exists()


def test_rows_that_name_code_are_refused_until_told(code, study_file, tmp_path, capsys):
    """A stored run is somebody else's text: one row of it is enough."""
    text, mark = code
    folder = tmp_path / "out"
    run_study(study_from({"name": "s", "scenario": str(tmp_path / "short.toml"), "seeds": 3,
                          "estimators": ["frozen"]}), folder)  # fmt: skip
    change(folder, "INSERT INTO texts (text) VALUES (?)", text)
    last = "seed = (SELECT max(seed) FROM cells)"
    change(folder, f"UPDATE cells SET estimator = (SELECT max(id) FROM texts) WHERE {last}")
    status, out, err = flexaxis(capsys, "rerun", folder)
    again = refused(status, err, text, "rerun", folder)
    assert not out and not mark.exists()
    status, out, _ = flexaxis(capsys, *again)
    assert status == 1 and mark.exists() and "2 of 3 cases agree" in out


def test_a_lesson_that_names_code_is_refused_until_told(code, tmp_path, capsys):
    text, mark = code
    lesson, film = tmp_path / "lesson.toml", tmp_path / "film.gif"
    lesson.write_text(f"duration = 0.1\nestimators = ['frozen', {json.dumps(text)}]")
    words = ["demo", "--record", film, "--script", lesson]
    status, _, err = flexaxis(capsys, *words)
    again = refused(status, err, text, *words)
    assert not mark.exists()
    status, _, err = flexaxis(capsys, *again)
    assert mark.exists() and status == 2 and "the demo races k_T, 1/J_a, f_m" in err


@pytest.mark.slow
def test_what_is_registered_or_typed_needs_no_consent(capsys, short_toml, tmp_path, code):
    text, mark = code
    require(False, ["ekf", "rpem-forgetting[forgetting=0.99]"], source="here")
    status, *_ = flexaxis(capsys, "run", short_toml, "--estimator", text, "--seeds", 1,
                          "--jobs", 1, "-o", tmp_path / "run")  # fmt: skip
    assert status == 0 and mark.exists()


def test_every_way_to_name_code_is_seen():
    """In brackets a colon is text, before them it names code, however it is written."""
    code = ["a.py:B", " a.py:B", "a:b", ":", "pipe:x", " pipe:x", "pipe:x [a=1]", "a:b[x='c']"]
    assert code_named([*code, code[0]]) == code
    assert not any(map(names_code, ["ekf", "ekf[walk=0.1]", "ekf[a='b:c']", ""]))


def test_what_is_shown_plays_no_tricks_on_a_terminal():
    with pytest.raises(CodeRefused) as told:
        require(False, ["pipe:rm -r x\r\x1b[2Kekf"], source="s.toml")
    assert "\x1b" not in str(told.value) and "\r" not in str(told.value)
    assert "pipe:rm -r x" in str(told.value)
