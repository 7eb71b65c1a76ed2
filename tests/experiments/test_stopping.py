"""Ctrl-C, and processes that die: what is done is kept, one killer loses one, nothing is left."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest

from flexaxis.experiments.building import interrupts as stopping
from flexaxis.experiments.building.interrupts import one_stage, two_stage
from flexaxis.experiments.building.processes import spread
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.work import run_unit
from flexaxis.experiments.storage.files import NotRun
from tests.experiments.kept_rows import lines_of, scores_of

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")

# Does what it is told at sample 700 of the run that is counted.
OWN = """
import os, signal, sys
class Mine:
    names, output, runs = ("f_m",), "speed", 0
    def __init__(self, nominal, period): self.f_m, self.k = nominal["f_m"], 0
    def step(self, u, y):
        self.k += 1
        Mine.runs += self.k == 700
        if self.k == 700:
            WHAT
        return [self.f_m]
"""


def code(folder, what):
    folder.mkdir(exist_ok=True)
    (folder / "own.py").write_text(OWN.replace("WHAT", what))
    return f"{folder}/own.py:Mine"


def unit(short, estimator):
    """Five seeds that are run in one go."""
    study = Study("s", (short,), (estimator,), range(5))
    first, *_ = make_plan(study, run_code=True).units()
    return replace(first, seeds=tuple(study.seeds))


@pytest.fixture
def usual():
    """Ctrl-C as in a terminal, whoever has started these tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
    stopping.begin()


def test_the_case_under_ctrl_c_is_done_and_no_other_is_begun(short, tmp_path, usual):
    press = "if Mine.runs == 2: os.kill(os.getppid(), signal.SIGINT)"
    work = unit(short, code(tmp_path, press))
    every, found = run_unit(unit(short, code(tmp_path / "b", "pass"))), []
    with pytest.raises(KeyboardInterrupt):
        for outcome in spread([work, work], run_unit):
            found.append(outcome)
    (outcome,) = found
    assert outcome.cases == 2 and not outcome.missing
    lags = [[row["lag"] for row in each.rows] for each in (outcome, every)]
    assert lags[0] == lags[1][:2]


def test_another_process_is_asked_to_end_what_it_does(stubs, tmp_path, usual):
    mark, found = tmp_path / "begun", []

    def press():
        while not mark.exists():
            time.sleep(0.01)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        for asked in spread([mark], stubs.until_asked, jobs=1):
            found.append(asked)
    assert found == [True]


def test_twice_ends_at_once(usual):
    began = time.monotonic()

    def work(task):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        time.sleep(60)

    with pytest.raises(KeyboardInterrupt):
        list(spread("ab", work))
    assert time.monotonic() - began < 30


def test_work_that_is_told_to_end_does_not_begin(short, tmp_path):
    stopping.ask()
    assert run_unit(unit(short, "frozen")).cases == 0
    stopping.begin()
    assert run_unit(unit(short, "frozen")).cases == 5


def test_what_has_ended_asks_nothing_of_what_comes_after_it(short, usual):
    with pytest.raises(KeyboardInterrupt), two_stage() as interrupts:
        signal.raise_signal(signal.SIGINT)
        interrupts.tell()
    with two_stage():
        assert run_unit(unit(short, "frozen")).cases == 5


def test_one_stage_ends_what_goes_on(usual):
    with pytest.raises(KeyboardInterrupt), one_stage():
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it goes on")


PRESSING = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from flexaxis.experiments import cli
def pressed(done):
    def before(*words):
        os.kill(os.getpid(), signal.SIGINT)
        return done(*words)
    return before
for name in ("check_words", *sys.argv.pop().split("+")):
    setattr(cli, name, pressed(getattr(cli, name)))
sys.exit(cli.main())
"""


@pytest.mark.parametrize("when", ["_ended", "no_answer", "leave", "_ended+_ended"])
def test_ctrl_c_once_more_changes_nothing_while_a_command_ends(when):
    """Before it says why, then before who reads JSON is told, and when handling it is over.

    Twice more, and it ends before it has said anything.
    """
    line = [sys.executable, "-c", PRESSING, "list", "--json", when]
    done = subprocess.run(line, check=False, timeout=100, capture_output=True, text=True)
    assert done.returncode == 130
    if "+" in when:
        assert not done.stderr and not done.stdout
    else:
        assert done.stderr == "flexaxis: interrupted\n"
        assert json.loads(done.stdout)["status"] == 130


def test_a_command_that_is_stopped_waits_for_no_process_of_a_users_code(short_toml, tmp_path):
    own = code(tmp_path, "if Mine.runs == 2: os.kill(os.getppid(), signal.SIGTERM)")
    line = [sys.executable, "-m", "flexaxis", "run", str(short_toml), "--estimator", own]
    line += ["--seeds", "5", "--jobs", "1", "-o", str(tmp_path / "out")]
    done = subprocess.run(line, check=False, timeout=100, capture_output=True, text=True)
    assert done.returncode == 130 and "2 cases done" in done.stderr
    assert "leaked" not in done.stderr


# ------------------------------------------------------------------ processes that die

KILLED = "os.kill(os.getpid(), signal.SIGKILL)"  # as the system does where memory runs out


@pytest.mark.parametrize("jobs", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_one_killer_among_many_loses_one(short, tmp_path, jobs):
    """Also in one process, and whatever runs beside it."""
    killer = code(tmp_path, f"if abs(u - {torque(short, 1007)!r}) < 1e-12: {KILLED}")
    study = Study("s", (short,), (killer, "frozen"), tuple(range(1000, 1008)))
    finished = run_study(study, tmp_path / "out", Means(jobs=jobs), run_code=True)
    assert (finished.cases, finished.failed) == (16, 1)
    failed = {(r["seed"], r["estimator"]): r["error"] for r in lines_of(tmp_path / "out")
              if r["error"]}  # fmt: skip
    assert [*failed] == [(1007, killer)]
    assert "its process died" in failed[1007, killer] and "seed 1007" in failed[1007, killer]
    alone = Study("s", (short,), (killer, "frozen"), (1006,))
    run_study(alone, tmp_path / "alone", Means(), run_code=True)
    both = [scores_of(tmp_path / name) for name in ("out", "alone")]
    assert {k: v for k, v in both[0].items() if k[3] == 1006} == both[1]


def torque(scenario, seed):
    """Return what the motor is told at sample 699 of a record, by which its seed is known."""
    from flexaxis.sim.simulate import simulate

    return float(simulate(scenario, [seed])[0].torque[699])


@pytest.mark.slow
def test_a_death_that_does_not_come_again_is_no_failure(short, tmp_path):
    mark = str(tmp_path / "mark")
    once = f"if not os.path.exists({mark!r}): open({mark!r}, 'w').close(); {KILLED}"
    study = Study("s", (short,), (code(tmp_path, once),), (0, 1, 2))
    finished = run_study(study, tmp_path / "out", Means(), run_code=True)
    assert (finished.cases, finished.failed) == (3, 0) and (tmp_path / "mark").exists()


REASONS = {
    "memory": ("raise MemoryError('no more')", "MemoryError: no more"),
    "disk": ("raise OSError(28, 'No space left on device')", "No space left on device"),
    "package": ("import not_installed_anywhere", "No module named 'not_installed_anywhere'"),
}


@pytest.mark.parametrize(
    "why", ["memory", *(pytest.param(why, marks=pytest.mark.slow) for why in ("disk", "package"))]
)
def test_what_is_no_fault_of_the_estimator_has_no_row(short_toml, tmp_path, capsys, why):
    what, said = REASONS[why]
    mark = tmp_path / "repaired"
    own = code(tmp_path, f"if Mine.runs == 2 and not os.path.exists({str(mark)!r}): {what}")
    words = ["run", str(short_toml), "--estimator", own, "--seeds", "3", "--jobs", "1"]
    words += ["-o", str(tmp_path / "out")]
    assert main(words) == 70
    told = capsys.readouterr().err
    assert "1 of 3 cases were not run" in told and said in told and "same line goes on" in told
    rows = lines_of(tmp_path / "out")
    assert len(rows) == 2 and not any(row["error"] for row in rows)
    mark.touch()
    assert main(words) == 0
    assert len(lines_of(tmp_path / "out")) == 3


def test_a_shipped_estimator_whose_process_dies_is_not_run(stubs, tmp_path):
    """Nothing but the system can have ended it."""
    from functools import partial

    from flexaxis.experiments.studies.definition import study_from

    study = study_from(
        {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen"], "seeds": 6}
    )
    with pytest.raises(NotRun, match=r"seeds 1005.*its process died"):
        run_study(study, tmp_path, Means(jobs=2, work=partial(stubs.dies_on, 1005)))
    assert len(scores_of(tmp_path)) == 5 * 3


# ------------------------------------------------------------------ in a terminal

# A program that hears nothing once it has its first sample, not even that nobody asks any more.
DEAF = """
import struct, sys, time
take = sys.stdin.buffer.read
take(16)
_, _, values, names = struct.unpack("<dIII", take(20))
take(40 * values + 32 * names)
sys.stdout.buffer.write(b"FLEXAXIS" + struct.pack("<IIII", 1, 0x01020304, 1, 0))
sys.stdout.buffer.write(b"f_m".ljust(32, b"\\0"))
sys.stdout.flush()
take(24)
print("no more", file=open("/dev/tty", "w"))
while True: time.sleep(1)
"""


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_program_that_hears_nothing_ends_with_its_run(
    tmp_path, short_toml, monkeypatch, times, jobs
):
    monkeypatch.syspath_prepend(os.path.dirname(__file__))
    import ctrl_c

    (tmp_path / "deaf.py").write_text(DEAF)
    words = ["run", str(short_toml), "--estimator", f"pipe:{sys.executable} {tmp_path}/deaf.py"]
    words += ["--seeds", "4", "--jobs", str(jobs), "-o", str(tmp_path / "out")]
    ended = ctrl_c.press(words, times, 1.0, "no more")
    assert ended.status == 130 and not ended.orphans, ctrl_c.last_lines(ended.said)
    assert "Traceback" not in ended.said


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize(
    "name", ["run", "study", "compare", "tune", "tradeoff", "paper", "record", "demo"]
)
def test_ctrl_c_in_a_terminal(name, times, tmp_path, monkeypatch):
    """Not killed, and nothing of it stays; that it ends with a case is shown without a clock."""
    if name in ("record", "demo"):
        pytest.importorskip("mjviser")
    monkeypatch.syspath_prepend(os.path.dirname(__file__))
    import ctrl_c

    words = ctrl_c.commands(tmp_path)[name]
    begun = ctrl_c.BEGUN.get(name, ctrl_c.BAR)
    ended = ctrl_c.press(words, times, 8.0, begun)
    assert begun in ended.said
    # The demo ends by it: a second one comes to a Python that is at its end, which is 130 too.
    right = {(True, 1): {0}, (True, 2): {0, 130, -signal.SIGINT}}.get(
        (name == "demo", times), {130}
    )
    assert ended.status in right, ctrl_c.last_lines(ended.said)
    assert not ended.orphans
    assert "Traceback" not in ended.said
    if name in ("run", "study", "compare", "tune", "tradeoff"):
        assert "go on with: flexaxis" in ended.said and "--resume" in ended.said
    left = [path for path in tmp_path.rglob(".*") if path.is_file() and path.name != ".lock"]
    assert not left
