"""Ctrl-C in the middle of work: what is done is kept, and nothing is left."""

import json
import os
import signal
import sys
import threading
import time
from dataclasses import replace

import pytest

from flexaxis.experiments.building.inherited import STOP
from flexaxis.experiments.running import stopping
from flexaxis.experiments.running.dispatch import spread
from flexaxis.experiments.running.interrupts import one_stage, two_stage
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.work import run_unit

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")

# Presses Ctrl-C itself in the middle of a run, and may go on whatever is raised.
OWN = """
import signal
class Mine:
    names, output, runs = ("f_m",), "speed", 0
    def __init__(self, nominal, period): self.f_m, self.k = nominal["f_m"], 0
    def step(self, u, y):
        self.k += 1
        Mine.runs += self.k == 700
        if Mine.runs == PRESS and self.k == 700:
            try: signal.raise_signal(signal.SIGINT)
            except BaseException: SWALLOW
        return [self.f_m]
"""


def unit(short, folder, press_at, swallow):
    """Five seeds that are run in one go."""
    folder.mkdir()
    code = OWN.replace("PRESS", str(press_at)).replace("SWALLOW", swallow)
    (folder / "own.py").write_text(code)
    study = Study("s", (short,), (f"{folder}/own.py:Mine",), range(5))
    first, *_ = make_plan(study, run_code=True).units()
    return replace(first, seeds=tuple(study.seeds))


@pytest.fixture
def usual():
    """Ctrl-C as in a terminal, whoever has started these tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
    stopping.begin(lambda: False)


@pytest.mark.parametrize(("swallow", "whole"), [("raise", 2), ("pass", 3)])
def test_the_cases_before_ctrl_c_are_kept(  # noqa: PLR0917
    short, tmp_path, usual, monkeypatch, swallow, whole
):
    """Also where a user's code takes the stop for an error of its own: then after that case."""
    monkeypatch.setattr(stopping, "LOST", 60.0)  # long after that case
    every = run_unit(unit(short, tmp_path / "a", 0, "raise"))
    expected = [json.loads(line) for line in every.lines.splitlines()]
    outcomes = []
    with pytest.raises(KeyboardInterrupt):
        for outcome in spread([unit(short, tmp_path / "b", 3, swallow)], run_unit):
            outcomes.append(outcome)
    rows = [json.loads(line) for outcome in outcomes for line in outcome.lines.splitlines()]
    assert sum(outcome.cases for outcome in outcomes) == len(rows) == whole
    scores = {"lag", "std", "bias", "seed", "parameter"}
    for row, other in zip(rows, expected, strict=False):
        assert {key: row[key] for key in scores} == {key: other[key] for key in scores}


def test_work_that_is_told_to_stop_does_not_begin(short, tmp_path, usual):
    stopping.begin()
    stopping.ask()
    work = unit(short, tmp_path / "a", 0, "raise")
    assert run_unit(work).cases == 0
    stopping.begin()
    assert run_unit(work).cases == work.cases


def slow(task):
    """Work that knows of no stop."""
    (task / "begun").touch()
    time.sleep(60)


def test_a_stop_of_work_that_cannot_say_how_far_it_came(tmp_path, usual):
    """It takes sixty seconds, and none of its signals is its own."""

    def interrupt():
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    asking = threading.Thread(target=interrupt)
    asking.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        list(spread([tmp_path], slow))
    asking.join()
    assert time.monotonic() - began < 30


class Deaf:
    """Drops what is raised while it goes, as weak references and finalisers do."""

    def __init__(self, number):
        self.number = number

    def __del__(self):
        signal.raise_signal(self.number)


@pytest.mark.parametrize("stage", [one_stage, two_stage])
def test_a_ctrl_c_that_python_drops_comes_again(usual, stage):
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), one_stage(), stage():
        if stage is two_stage:
            signal.raise_signal(signal.SIGINT)  # the first, which is kept
        Deaf(signal.SIGINT)
        time.sleep(60)
    assert time.monotonic() - began < 30


def test_so_does_what_stops_the_work(usual):

    def work(number):
        Deaf(number)
        time.sleep(60)

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), one_stage():
        list(spread([signal.SIGINT], work))
    assert time.monotonic() - began < 30


# A program that hears nothing once it has its first sample, not even that nobody asks any more.
DEAF = """
import json, sys, time
json.loads(input())
print('{"names": ["f_m"]}', flush=True)
input()
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
    """Ended long before one of its parts would have; one fifth of what is allowed is usual."""
    if name in ("record", "demo"):
        pytest.importorskip("mjviser")
    monkeypatch.syspath_prepend(os.path.dirname(__file__))
    import ctrl_c

    words = ctrl_c.commands(tmp_path)[name]
    ended = ctrl_c.press(words, times, 8.0, "live axis is at" if name == "demo" else "")
    # The demo ends by it: a second one comes to a Python that is at its end, which is 130 too.
    right = {(True, 1): {0}, (True, 2): {0, 130, -signal.SIGINT}}.get(
        (name == "demo", times), {130}
    )
    assert ended.status in right, ctrl_c.last_lines(ended.said)
    assert ended.seconds < 10 and not ended.orphans
    assert "Traceback" not in ended.said
    if name in ("run", "study", "compare", "tune", "tradeoff"):
        assert "go on with: flexaxis" in ended.said and "--resume" in ended.said
    left = [path for path in tmp_path.rglob(".*") if path.is_file() and path.name != ".lock"]
    assert not left


@pytest.mark.skipif(STOP is None, reason="there is no such signal")
def test_a_signal_that_comes_late_stops_nothing_that_goes_on_now(short, tmp_path):
    """As where a stop is sent again, and what it was for has ended meanwhile."""
    work = unit(short, tmp_path / "a", 0, "raise")

    def late(task):
        signal.raise_signal(STOP)
        return run_unit(task)

    assert stopping.heed()
    assert [outcome.cases for outcome in spread([work], late)] == [work.cases]
    stopping.ask()  # nothing goes on
    assert run_unit(work).cases == work.cases


def test_a_stop_ends_what_goes_on_inside_something_else(short, tmp_path):
    with two_stage() as outer, two_stage():
        outer.asked = True
        with stopping.stoppable():
            stopping.ask()
            pytest.fail("it goes on")


def test_what_has_ended_sends_no_ctrl_c_to_what_comes_after_it(usual):
    """It comes again where it seems lost: a second later, which may be in another command."""
    with pytest.raises(KeyboardInterrupt), one_stage():
        signal.raise_signal(signal.SIGINT)
    with one_stage():
        time.sleep(1.5 * stopping.LOST)
