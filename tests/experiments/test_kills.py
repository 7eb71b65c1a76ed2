"""Whatever ends a command, and whenever: what was there is there, and going on gives the same."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import pytest

from flexaxis.experiments.building.interrupts import one_stage
from flexaxis.experiments.building.processes import spread
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.studies.definition import study_from
from tests.experiments.kept_rows import cases_of

HERE = Path(__file__).parent
posix = pytest.mark.skipif(os.name == "nt", reason="no fork, and other signals, on Windows")


def study(seeds):
    return study_from(
        {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen"], "seeds": seeds}
    )


# ------------------------------------------------------------- random moments


@posix
@pytest.mark.slow
@pytest.mark.parametrize("name", ["run", "compare", "tune", "study", "merge", "export"])
def test_a_few_kills(name):
    """`make kill` goes on for as long as one likes."""
    pytest.importorskip("pyarrow", reason="the extra `parquet`")
    words = [sys.executable, str(HERE / "kills.py"), name, "--kills", "2"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


class Killed(BaseException):
    """Stands in for a kill: nothing catches it."""


def test_what_was_killed_before_its_first_row_binds_nobody(stubs, tmp_path):
    def dies(unit):
        raise Killed

    with pytest.raises(Killed):
        run_study(study(2), tmp_path, Means(work=dies))
    assert (tmp_path / "study.json").exists()
    other = {"name": "o", "scenario": "kt_step-v1", "estimators": ["ekf"], "seeds": 3}
    run_study(study_from(other), tmp_path, Means(work=stubs.quick))
    there = json.loads((tmp_path / "study.json").read_text())
    assert (there["estimators"], cases_of(tmp_path)) == (["ekf"], 3)
    run_study(study(2), tmp_path, Means(work=stubs.quick))
    assert cases_of(tmp_path) == 5


# --------------------------------------------------------------- who reads, who asks


@posix
def test_a_verdict_keeps_its_status_when_its_reader_goes(short_toml, tmp_path, monkeypatch):
    words = ["compare", str(short_toml), "--base", "rpem-forgetting", "--candidate", "frozen",
             "--seeds", "8", "--jobs", "1", "-o", str(tmp_path / "out")]  # fmt: skip
    assert main(words) == 1
    for name in ("stdout", "stderr"):
        ours, theirs = os.pipe()
        os.close(ours)
        with monkeypatch.context() as patch, open(theirs, "w", encoding="utf-8") as stream:
            patch.setattr(sys, name, stream)
            assert main([*words, "--resume"]) == 1
            assert getattr(sys, name) is stream


@posix
def test_ctrl_c_tells_what_is_under_way_and_not_what_waits(capfd, monkeypatch):
    begun, out, told, done = Event(), Event(), Event(), []

    def tasks():
        yield from "abc"
        out.set()

    def work(task):
        begun.set()
        told.wait(10) if task == "a" else time.sleep(2.0)  # for who is slow to give "c" up
        return task

    def write(file, text, usual=os.write):
        written = usual(file, text)
        if b"Ctrl-C again" in text:
            told.set()
        return written

    def interrupt():
        begun.wait()
        out.wait()
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    monkeypatch.setattr(os, "write", write)
    with ThreadPoolExecutor(1) as executor:
        asking = threading.Thread(target=interrupt)
        asking.start()
        with pytest.raises(KeyboardInterrupt):
            for result in spread(tasks(), work, executor=executor, in_flight=4):
                done.append(result)
        asking.join()
    assert done in (["a"], ["a", "b"])  # the next may begin just then
    assert "what is done is kept. Ctrl-C again ends at once" in capfd.readouterr().err


TERMINATED = """\
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as for what a script starts in the background
from flexaxis.experiments.cli import main
sys.exit(main())
"""


@posix
@pytest.mark.slow
@pytest.mark.parametrize("name", ["run", "study", "compare"])
def test_a_queue_that_ends_a_command_is_as_ctrl_c(name, tmp_path, short_toml):
    toml = tmp_path / "s.toml"
    toml.write_text(
        "name = 'long'\nscenario = 'fm_step-v1'\nestimators = ['literal-rpem']\nseeds = 400\n"
    )
    lines = {
        "run": ["run", str(short_toml), "--estimator", "literal-rpem", "--seeds", "400"],
        "study": ["study", str(toml)],
        "compare": ["compare", str(short_toml), "--base", "literal-rpem", "--candidate", "frozen",
                    "--seeds", "400"],
    }  # fmt: skip
    words = [*lines[name], "--jobs", "2", "-o", str(tmp_path / "out")]
    done = subprocess.Popen(
        [sys.executable, "-c", TERMINATED, *words],
        stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=tmp_path,
    )  # fmt: skip
    rows_file = tmp_path / "out" / "scores.sqlite"
    until = time.monotonic() + 120
    while not (rows_file.exists() and cases_of(tmp_path / "out")) and time.monotonic() < until:
        time.sleep(0.1)
    done.send_signal(signal.SIGTERM)
    _, said = done.communicate(timeout=60)
    assert done.returncode == 130
    assert "done just now; go on with: flexaxis " in said and "--resume" in said
    assert "leaked" not in said and "Traceback" not in said
    assert cases_of(tmp_path / "out")


@posix
def test_the_line_to_go_on_with_is_told_before_anything_is_run(tmp_path, capsys, monkeypatch):
    from flexaxis.experiments.commands.runs import study

    def stop(*args):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(study, "_announced", stop)
    toml = tmp_path / "s.toml"
    toml.write_text("name = 's'\nscenario = 'fm_step-v1'\nestimators = ['frozen']\nseeds = 2\n")
    words = ["study", str(toml), "-o", str(tmp_path / "out")]
    assert main(words) == 130
    line = f"0 cases done just now; go on with: flexaxis {' '.join(words)} --resume"
    assert line in capsys.readouterr().err


@posix
@pytest.mark.parametrize("usual", [signal.default_int_handler, signal.SIG_IGN])
def test_a_signal_to_terminate_is_as_ctrl_c(capfd, monkeypatch, usual):
    """Also in the background, where Ctrl-C is ignored."""
    done, before = [], signal.signal(signal.SIGINT, usual)

    def work(task):
        if task == "b":
            signal.raise_signal(signal.SIGTERM)
        return task

    try:
        with pytest.raises(KeyboardInterrupt):
            done.extend(spread("abc", work))
    finally:
        signal.signal(signal.SIGINT, before)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL and done == ["a", "b"]
    assert "stopping after the cases that are under way" in capfd.readouterr().err


def _type_in_compiled_code(raised):
    def _numba_unpickle():
        raised()

    _numba_unpickle()


class _Finalized:
    def __init__(self, raised):
        weakref.finalize(self, raised)


class _Deleted:
    def __init__(self, raised):
        self.raised = raised

    def __del__(self):
        self.raised()


@posix
@pytest.mark.parametrize("unheard", [_type_in_compiled_code, _Finalized, _Deleted])
def test_ctrl_c_is_not_raised_where_it_is_not_heard(unheard):
    """In compiled code it would crash, where an object ends be forgotten; nested however deep."""
    seen = []

    def raised():
        list(map(signal.raise_signal, [signal.SIGINT]))
        seen.append("went on")

    with pytest.raises(KeyboardInterrupt), one_stage():
        unheard(raised)
        threading.Event().wait(60)  # which nothing but a signal to this thread ends
        seen.append("too late")
    assert seen == ["went on"]


@posix
def test_ctrl_c_that_was_put_off_is_heard_at_the_end_of_the_block():
    with pytest.raises(KeyboardInterrupt), one_stage():
        _type_in_compiled_code(lambda: signal.raise_signal(signal.SIGTERM))
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
