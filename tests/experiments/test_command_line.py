"""The command line answers: a wrong word at once and with the right one, as much as is wanted."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.cli import main
from flexaxis.experiments.commands.answers import say

HEAVY = {"mujoco", "matplotlib", "control", "scipy.stats", "scipy.signal", "jinja2"}


def refused(capsys, *words):
    """Status and message of a command that is typed wrong."""
    try:
        status = main(list(words))
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert not out and "Traceback" not in err
    return status, err


MISTAKES = [
    (["rnu", "smoke"], "Did you mean 'run'?"),
    (["run", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["run", "smok"], "Did you mean 'smoke'?"),
    (["run", "smoke", "--estimtor", "glr"], "Did you mean '--estimator'?"),
    (["run", "smoke", "--estimator", "cusum-rset"], "Did you mean 'cusum-reset'?"),
    (["run", "smoke", "--estimator", "ekf[nois=1]"], "Did you mean 'noise'?"),
    (["run", "smoke", "--seeds", "abc"], "--seeds 'abc'"),
    (["run", "smoke", "--jobs", "0"], "--jobs 0"),
    (["run", "mien.toml"], "mien.toml"),
    (["simulate", "smoke"], "flexaxis show smoke"),
    (["estimate", "nothing.nc"], "nothing.nc"),
    (["estimate", "there.nc", "--estimator", "mien.py:Mine"], "Did you mean 'mine.py'?"),
    (["compare", "--base", "frozn", "--candidate", "ekf"], "Did you mean 'frozen'?"),
    (["compare", "fm_stp-v1", "--base", "frozen", "--candidate", "ekf"], "'fm_step-v1'"),
    (["tune", "rpem-forgeting"], "Did you mean 'rpem-forgetting'?"),
    (["tradeoff", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["check", "cusum-rset"], "Did you mean 'cusum-reset'?"),
    (["show", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["view", "fm_stp-v1"], "Did you mean 'fm_step-v1'?"),
    (["view", "ther.nc"], "Did you mean 'there.nc'?"),
    (["list", "scenario"], "Did you mean 'scenarios'?"),
    (["list", "--group", "step"], "Did you mean 'steps'?"),
    (["list", "estimators", "--group", "steps"], "--group"),
    (["study", "ther.toml"], "Did you mean 'there.toml'?"),
    (["report", "nowhere"], "nowhere is not the folder"),
    (["export", "nowhere", "--csv", "a.csv"], "nowhere is not the folder"),
    (["import", "nothing.csv"], "nothing.csv"),
    (["identify", "nothing.csv"], "nothing.csv"),
    (["demo", "--estimator", "cusum-rset"], "Did you mean 'cusum-reset'?"),
]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "there.nc", "there.toml"):
        (tmp_path / name).touch()


@pytest.mark.parametrize(("words", "hint"), MISTAKES, ids=lambda x: " ".join(x)[:50])
def test_a_mistake_is_told_with_what_was_meant(capsys, place, words, hint):
    status, err = refused(capsys, *words)
    assert status == 2 and hint in err


def test_nothing_heavy_is_imported_before_a_mistake_is_told(place):
    code = (
        "import json, sys\n"
        "from flexaxis.experiments.cli import main\n"
        f"for words in {[words for words, _ in MISTAKES]!r}:\n"
        "    try: assert main(words) == 2, words\n"
        "    except SystemExit: pass\n"
        f"    print(json.dumps([words, sorted({HEAVY!r} & set(sys.modules))]))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    answers = [json.loads(line) for line in told.stdout.splitlines()]
    assert len(answers) == len(MISTAKES)
    assert [(words, heavy) for words, heavy in answers if heavy] == []


def test_the_list_imports_nothing_heavy():
    code = (
        "import sys; from flexaxis.experiments.cli import main; main(['list']);"
        f"print(sorted({HEAVY!r} & set(sys.modules)), file=sys.stderr)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stderr.strip() == "[]"


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


@pytest.mark.parametrize(("more", "times"), [(["--jobs", "2"], 1), (["--jobs", "1", "-q"], 0)])
def test_a_warning_of_an_estimator_is_told_once_in_words(tmp_path, more, times):
    words = ["run", "light_ja_step-v1", "--estimator", "moving-horizon", "--seeds", "2", *more]
    found = subprocess.run(
        [sys.executable, "-m", "flexaxis.experiments", *words, "-o", str(tmp_path / "out")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert found.stderr.count("remembers 1 s") == times
    assert found.stderr.count("flexaxis: moving-horizon remembers 1 s") == times
    assert "UserWarning" not in found.stderr and "self.factor" not in found.stderr


def test_verbose_says_with_what_and_how_long(capsys, tmp_path):
    assert main(["show", "smoke", "-v"]) == 0
    err = capsys.readouterr().err
    assert "numpy" in err and "took" in err and str(tmp_path) in err


def test_what_is_repeated_has_neither(capsys, short_toml, tmp_path):
    words = ["run", str(short_toml), "--estimator", "frozen", "--seeds", "1", "--jobs", "1"]
    assert main(["-v", *words, "-q", "-o", str(tmp_path / "out"), "--json"]) == 0
    command = json.loads(capsys.readouterr().out)["command"]
    assert "run" in command and " -q" not in command and " -v" not in command


def test_no_colour_where_none_is_wanted(tmp_path):
    environment = os.environ | {"FORCE_COLOR": "1", "NO_COLOR": "1"}
    words = [sys.executable, "-m", "flexaxis.experiments", "check", "frozen"]
    told = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert "\x1b[3" not in told.stdout  # the colours; bold is none


def completed(line, tmp_path):
    """What the shell is told when Tab is pressed behind a line."""
    answer = tmp_path / "answer"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }
    words = [sys.executable, "-m", "flexaxis.experiments"]
    subprocess.run(words, env=environment, cwd=tmp_path, check=False, capture_output=True)
    return {word.strip() for word in answer.read_text().splitlines()}


def test_words_are_completed(tmp_path):
    (tmp_path / "fm_mine.toml").touch()
    assert {"tune", "tradeoff", "track"} <= completed("flexaxis t", tmp_path)
    assert {"fm_step-v1", "fm_mine.toml"} <= completed("flexaxis run fm_", tmp_path)
    assert completed("flexaxis run smoke --estimator relo", tmp_path) == {
        name for name in REGISTRY if name.startswith("relo")
    }
    assert "--estimator" in completed("flexaxis run --est", tmp_path)
    assert completed("flexaxis list --group s", tmp_path) == {"steps", "several", "sensors"}


@pytest.mark.slow
def test_parameters_are_completed_from_the_model_that_is_typed(tmp_path):
    line = "flexaxis identify rec.nc --model one_mass"
    assert completed(f"{line} --fix f_", tmp_path) == {"f_m", "f_c", "f_s"}
    assert completed(f"{line} --free J", tmp_path) == {"J_m"}
    assert "J_l" in completed("flexaxis identify rec.nc --start J_", tmp_path)
    track = "flexaxis track rec.nc --model two_mass --identify"
    assert completed(f"{track} 1/J_", tmp_path) == {"1/J_m", "1/J_l"}
    assert not completed("flexaxis track rec.nc --model no.toml --identify J", tmp_path)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_lines_of_a_shell_are_code_of_that_shell(capsys, tmp_path, shell):
    assert main(["completion", shell]) == 0
    path = tmp_path / "lines"
    path.write_text(capsys.readouterr().out)
    assert "flexaxis" in path.read_text()
    if shutil.which(shell):
        subprocess.run([shell, "-n", str(path)], check=True)


@pytest.mark.slow
def test_forty_mistakes(tmp_path, monkeypatch):
    """Each as somebody types it, with Python's start; beside `import numpy`, which is 0.1 s where
    nothing else runs: ten times that for what is found before anything is run."""
    monkeypatch.syspath_prepend(os.path.dirname(__file__))
    import mistakes

    found = mistakes.answers(tmp_path)
    assert len(found) == 40
    assert not {each.mistake.line: each.wrong for each in found if each.wrong}
    typed = [each for each in found if not each.mistake.running]
    assert not {each.mistake.line: each.seconds for each in typed if each.seconds > 10 * each.unit}


def test_processes_and_a_cluster_exclude_each_other(capsys, place):
    """Also where the number of processes is that of the default."""
    jobs = str(os.cpu_count() or 1)
    status, err = refused(capsys, "run", "smoke", "--dask", "localhost:1", "--jobs", jobs)
    assert status == 2 and "not allowed with" in err


COMPLETED = [
    ("flexaxis ru", "run"),
    ("flexaxis run fm_st", "fm_step-v1"),
    ("flexaxis run smoke --estimator cusum", "cusum-reset"),
    ("flexaxis list --gr", "--group"),
]


@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
def test_fish_completes(tmp_path):
    where = str(Path(sys.executable).parent)
    asked = "; ".join(f"complete -C '{typed}'" for typed, _ in COMPLETED[:2])
    code = f"fish_add_path -P {where}; flexaxis completion fish | source; {asked}"
    done = subprocess.run(["fish", "--no-config", "-c", code], capture_output=True, text=True,
                          check=True, env=os.environ | {"HOME": str(tmp_path)})  # fmt: skip
    words = [line.partition("\t")[0] for line in done.stdout.splitlines()]
    assert words == [meant for _, meant in COMPLETED[:2]], done.stderr


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not installed")
@pytest.mark.parametrize("begun", [True, False])
def test_zsh_completes(tmp_path, begun):
    """In a terminal of its own, with and without what most people have in their ~/.zshrc."""
    import pty
    import select
    import signal

    child, terminal = pty.fork()
    if not child:
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        own = {"PATH": path, "HOME": str(tmp_path), "PS1": "> ", "TERM": "dumb"}
        os.execvpe("zsh", ["zsh", "-f", "-i"], own)

    def heard(until, patience=60.0):
        end, text = time.monotonic() + patience, ""
        while until not in text and time.monotonic() < end:
            if select.select([terminal], [], [], 0.05)[0]:
                text += os.read(terminal, 65536).decode(errors="replace")
        assert until in text, text
        return text

    def typed(text):
        os.write(terminal, text.encode())

    try:
        heard("> ")
        typed("autoload -U compinit; compinit -u\n" if begun else "true\n")
        typed('eval "$(flexaxis completion zsh)"; print re""ady\n')
        heard("ready")
        for word, meant in COMPLETED:
            typed(f"{word}\t")
            heard(f"{meant}")
            typed("\x15")  # the line is taken back
    finally:
        os.close(terminal)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_what_somebody_else_has_named_drives_no_terminal(capsys):
    """A message shows a name as it stands in a file, but for what a terminal would obey."""
    say("ab \x1b]0;title\x07\x1b[2J \u202e é f_m²\nanother")
    assert capsys.readouterr().err == (
        r"flexaxis: ab \x1b]0;title\x07\x1b[2J \u202e é f_m²" + "\nflexaxis: another\n"
    )
