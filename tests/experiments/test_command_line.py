"""The command line answers: a wrong word at once and with the right one, as much as is wanted."""

import json
import os
import subprocess
import sys

import pytest

from flexaxis.experiments.cli import main

HEAVY = {"mujoco", "matplotlib", "control", "scipy.stats", "scipy.signal", "jinja2"}
MISTAKES = [
    (["rnu", "smoke"], "Did you mean 'run'?"),
    (["run", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["run", "smoke", "--estimtor", "glr"], "Did you mean '--estimator'?"),
    (["run", "smoke", "--estimator", "rpem-drft"], "Did you mean 'rpem-drift'?"),
    (["run", "smoke", "--estimator", "ekf[nois=1]"], "Did you mean 'noise'?"),
    (["run", "smoke", "--jobs", "0"], "--jobs 0"),
    (["estimate", "there.nc", "--estimator", "mien.py:Mine"], "Did you mean 'mine.py'?"),
    (["compare", "--base", "frozn", "--candidate", "ekf"], "Did you mean 'frozen'?"),
    (["list", "--group", "step"], "Did you mean 'steps'?"),
    (["study", "ther.toml"], "Did you mean 'there.toml'?"),
    (["import", "nothing.csv"], "nothing.csv"),
]


def refused(capsys, *words):
    """Status and message of a command that is typed wrong."""
    try:
        status = main(list(words))
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert not out and "Traceback" not in err
    return status, err


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "there.nc", "there.toml"):
        (tmp_path / name).touch()


@pytest.mark.parametrize(("words", "hint"), MISTAKES, ids=lambda x: " ".join(x)[:50])
def test_a_mistake_is_told_with_what_was_meant(capsys, place, words, hint):
    status, err = refused(capsys, *words)
    assert status == 2 and hint in err


def test_nothing_heavy_is_imported_for_the_list_or_before_a_mistake_is_told(place):
    lines = [words for words, _ in MISTAKES]
    code = (
        "import sys\n"
        "from flexaxis.experiments.cli import main\n"
        f"for words in {[['list'], *lines]!r}:\n"
        "    try: main(words)\n"
        "    except SystemExit: pass\n"
        f"print(sorted({HEAVY!r} & set(sys.modules)), file=sys.stderr)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stderr.splitlines()[-1] == "[]"


def listed(capsys, *words):
    assert main(["list", *words, "--json"]) == 0
    return {
        kind: [row["name"] for row in rows]
        for kind, rows in json.loads(capsys.readouterr().out).items()
        if isinstance(rows, list)
    }


def test_the_list_is_filtered(capsys):
    assert "fm_step-v1" in listed(capsys, "--group", "steps")["scenarios"]
    assert set(listed(capsys, "--group", "steps")) == {"scenarios"}
    found = listed(capsys, "--find", "KALMAN")
    assert "ekf" in found["estimators"] and "frozen" not in found["estimators"]
    assert main(["list", "--find", "no such thing"]) == 0
    assert "nothing has 'no such thing'" in capsys.readouterr().out
    assert main(["list", "--group", "wear"]) == 0
    assert "one parameter jumps to and fro" not in capsys.readouterr().out


def test_quiet_says_results_only(capsys, short_toml, tmp_path):
    words = ["run", str(short_toml), "--estimator", "frozen", "--seeds", "1", "--jobs", "1"]
    assert main([*words, "-o", str(tmp_path / "a"), "-q"]) == 0
    out, err = capsys.readouterr()
    assert not err and "frozen" in out
    assert main(["-q", "run", "fm_stp-v1"]) == 2
    assert "Did you mean" in capsys.readouterr().err
    assert main([*words, "-o", str(tmp_path / "b")]) == 0
    assert "records simulated" in capsys.readouterr().err


def test_verbose_says_with_what_and_how_long(capsys, tmp_path):
    assert main(["show", "smoke", "-v"]) == 0
    err = capsys.readouterr().err
    assert "numpy" in err and "took" in err and str(tmp_path) in err


def test_what_is_repeated_has_neither(capsys, short_toml, tmp_path):
    words = ["run", str(short_toml), "--estimator", "frozen", "--seeds", "1", "--jobs", "1"]
    assert main(["-v", *words, "-q", "-o", str(tmp_path / "out"), "--json"]) == 0
    command = json.loads(capsys.readouterr().out)["command"]
    assert "run" in command and " -q" not in command and " -v" not in command


def test_processes_and_a_cluster_exclude_each_other(capsys, place):
    """Also where the number of processes is that of the default."""
    jobs = str(os.cpu_count() or 1)
    status, err = refused(capsys, "run", "smoke", "--dask", "localhost:1", "--jobs", jobs)
    assert status == 2 and "not allowed with" in err
