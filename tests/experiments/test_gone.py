"""Estimators that are gone: what is said where one is typed or stored, and rows of theirs."""

from pathlib import Path

import pytest

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import GONE, REGISTRY
from flexaxis.experiments.cli import main
from flexaxis.experiments.commands.words import GONE as GONE_OPTIONS

OLD = Path(__file__).parent / "folder_0_1"
STUDY = 'scenario = "fm_step-v1"\nestimators = ["ekf", "relocate"]\nseeds = 1\n'
LESSON = 'title = "old"\nduration = 5.0\nestimators = ["ekf", "relocate"]\n'
SAID = "estimator 'relocate' is gone: it is 'glr' now; the last commit with it is d318435"


def test_what_is_gone_has_a_successor_that_is_not():
    assert {now for now, _ in GONE.values()} <= set(REGISTRY)
    assert not set(GONE) & set(REGISTRY)


@pytest.mark.parametrize(
    "words",
    [
        ["run", "fm_step-v1", "--estimator", "relocate"],
        ["run", "fm_step-v1", "--estimator", "relocate[deadline=0.001]"],
        ["compare", "--base", "relocate", "--candidate", "ekf"],
        ["tradeoff", "fm_step-v1", "--estimator", "relocate"],
        ["tune", "relocate"],
        ["check", "relocate"],
        ["show", "relocate"],
        ["submit", "relocate", "-o", "entry"],
        ["study", "study.toml"],
        ["demo", "lesson.toml", "--no-browser"],
    ],
    ids=lambda words: " ".join(words)[:40],
)
def test_what_is_gone_is_answered_in_a_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(STUDY)
    Path("lesson.toml").write_text(LESSON)
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(SAID)


@pytest.mark.parametrize("command, option", GONE_OPTIONS)
def test_an_option_that_is_gone_says_what_does_its_work(command, option, capsys):
    with pytest.raises(SystemExit, match="2"):
        main([command, f"{option}=1"])
    said = capsys.readouterr().err
    assert f"{option} is gone: {GONE_OPTIONS[command, option]}" in said
    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert option not in capsys.readouterr().out.split()


def test_python_is_told_the_same():
    with pytest.raises(EstimatorError, match=f"^{SAID}$"):
        REGISTRY["relocate"]
    assert REGISTRY.get("relocate") is None and "relocate" not in REGISTRY
    with pytest.raises(ValueError, match=SAID):
        fx.benchmark(["relocate"], scenarios="fm_step-v1", seeds=1)


def test_stored_rows_are_read_and_not_run_again(tmp_path, capsys):
    new = tmp_path / "new"
    assert main(["merge", str(OLD), "-o", str(new)]) == 0
    assert main(["report", str(new)]) == 0
    assert "relocate" in capsys.readouterr().out
    assert main(["rerun", str(new)]) == 2
    assert capsys.readouterr().err.splitlines() == [f"flexaxis: {new}: {SAID}"]
