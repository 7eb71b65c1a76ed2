"""A user's code is a guest: it is told where it fails, ends in time, and says nothing on stdout."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building import away
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.building.estimator_text import build, parse
from flexaxis.experiments.building.guest import hosted, limited
from flexaxis.experiments.cli import main
from flexaxis.experiments.commands.answers import CRASH, FINDING

OWN = """\
import os, pathlib, signal, sys, threading, time, numpy


class Base:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.theta, self.k = nominal["f_m"], 0

    def step(self, u, y):
        self.k += 1
        return [self.go()]

    def go(self):
        return self.theta


class Raises(Base):
    def go(self):
        return self.theta if self.k < 1501 else {}["oh"]  # line 20


class Claims(Raises):
    covariance = [[1.0]]


class Exits(Base):
    def go(self):
        return self.theta if self.k < 1501 else sys.exit(3)  # line 29


class Loops(Base):
    def go(self):
        while True:
            try:
                pass
            except Exception:
                pass


class Prints(Base):
    def go(self):
        print("here")
        return self.theta


class Nan(Base):
    def go(self):
        return self.theta if self.k < 1501 else float("nan")


class Two(Base):
    def step(self, u, y):
        return [1.0, 2.0]


class Forgetful(Base):
    def step(self, u, y):
        self.k += 1


class Generator(Base):
    def go(self):
        raise GeneratorExit("early")


class Odd(BaseException):
    def __str__(self):
        raise ValueError("not even this")


class Raises_odd(Base):
    def go(self):
        raise Odd


class Interrupts(Base):
    def go(self):
        raise KeyboardInterrupt


class Ends(Base):
    def go(self):
        os._exit(0)


class Meddles(Base):
    def go(self):
        os.chdir("/")
        sys.setrecursionlimit(150)
        numpy.seterr(all="raise")
        return self.theta


class Sleeps(Base):
    def go(self):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
        try:
            time.sleep(45)
        finally:
            pathlib.Path(__file__).with_name("slept").touch()


class Killed(Base):
    def go(self):
        mark = pathlib.Path("killed")
        if self.k == 9 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.theta


class Found(tuple):
    alarm, parameters = 3, ("f_m",)


class Finds(Base):
    findings = [Found()]


class Threads(Base):
    def go(self):
        if self.k == 1:
            threading.Thread(target=time.sleep, args=(1e6,), daemon=False).start()
        return self.theta


class Torque(Base):
    def __init__(self, nominal, period, *, torque=None):
        super().__init__(nominal, period)
        self.torque = torque
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, short_toml):
    (tmp_path / "guests.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)


def ran(capsys, name, *words, jobs=1):
    line = ["run", "short.toml", "--estimator", f"guests.py:{name}", "--seeds", "2"]
    status = main([*line, "--jobs", str(jobs), "-o", "out", *words])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return status, out, err


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("name", "what"),
    [("Raises", "KeyError: 'oh'"), pytest.param("Exits", "SystemExit: 3", marks=pytest.mark.slow)],
)
def test_what_it_raises_is_told_once_with_place_and_sample(capsys, name, what, jobs):
    status, _, err = ran(capsys, name, jobs=jobs)
    told = [line for line in err.splitlines() if "crashed" in line]
    assert status == CRASH and len(told) == 1 and "(and 1 like it)" in told[0]
    line = {"Raises": 20, "Exits": 29}[name]
    assert f"sample 1500 (7.5 s): {what}" in told[0] and f"guests.py:{line})" in told[0]
    assert "short, seed 100" in told[0]


@pytest.mark.parametrize(
    ("name", "what"),
    [("Two", "2 numbers"), pytest.param("Forgetful", "nothing", marks=pytest.mark.slow)],
)
def test_a_step_of_another_number_of_values_is_told_with_its_place(capsys, name, what):
    status, _, err = ran(capsys, name)
    assert status == FINDING and "crashed" not in err
    assert f"guests.py:{name}, on short (warm-up), sample 0: step returned {what}, " in err
    line = 2 + OWN[: OWN.index(f"class {name}")].count("\n")
    assert f"names has 1: f_m ({Path('guests.py').resolve()}:{line})" in err
    assert main(["check", f"guests.py:{name}"]) == FINDING
    out = " ".join(capsys.readouterr().out.split())
    assert f"step returned {what}" in out and "the same" in out


def test_what_never_ends_is_stopped(capsys):
    status, _, err = ran(capsys, "Loops", "--time-limit", "0.5")
    assert status == CRASH and "no end within 0.5 s" in err and "--time-limit" in err


@pytest.mark.slow
def test_check_ends_too(capsys):
    assert main(["check", "guests.py:Loops", "--time-limit", "0.2"]) == FINDING
    assert "no end within 0.2 s" in " ".join(capsys.readouterr().out.split())


def test_the_limit_is_of_one_run_and_put_back():
    import signal

    with limited(5.0), hosted("pipe:true", "in a test"):
        assert 3.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 5.0
        with hosted("pipe:true", "in another, which has the time of that"):
            pass
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 5.0
    with limited(5.0), hosted("frozen", "in a test"):
        assert signal.getitimer(signal.ITIMER_REAL)[0] == 0
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0


@pytest.mark.slow
def test_results_alone_go_to_stdout(capfd):
    status, out, err = ran(capfd, "Prints", "--json")
    assert status == 0 and json.loads(out)["rows"]
    assert err.count("here") >= 2 * 1600  # a sample of two runs
    main(["check", "guests.py:Prints", "--json"])
    rules = {rule["rule"]: rule for rule in json.loads(capfd.readouterr().out)["rules"]}
    assert rules["prints nothing"]["holds"] is False and rules["finite"]["holds"]


def test_what_is_not_finite_is_told_and_a_finding(capsys):
    status, _, err = ran(capsys, "Nan")
    assert status == FINDING
    assert "not finite 2 times, first on short, seed 1000, sample 1500" in err


def test_check_tells_each_failure_once(capsys):
    assert main(["check", "guests.py:Raises"]) == FINDING
    out = "".join(capsys.readouterr().out.split())  # a narrow table breaks words
    assert out.count("sample1500") == 1 and "thesame" in out and "guests.py:20)" in out
    assert "hint:boundtheestimates" not in out


def test_a_wrong_name_of_a_parameter_is_told_with_the_right_one(short):
    nominal = build(parse("guests.py:Base"), short).__init__.__self__
    assert nominal.theta == 0.05
    with pytest.raises(KeyError, match="Did you mean 'f_m'"):
        from flexaxis.experiments.building.offer import Nominal

        Nominal(f_m=1.0)["fm"]


def test_torque_is_given_to_whoever_asks_for_it(short):
    """Also where a prior is stored, which only the shipped ones look up."""
    assert build(parse("guests.py:Torque"), short).torque.size > 1000


def test_neighbours_are_found_and_take_no_librarys_place(tmp_path, short):
    (tmp_path / "helper.py").write_text("VALUE = 0.07\n")
    (tmp_path / "wave.py").write_text("raise RuntimeError('the wrong one')\n")
    head = "import wave, helper\nassert wave.Wave_read\n"
    (tmp_path / "near.py").write_text(head + OWN.replace('nominal["f_m"]', "helper.VALUE"))
    assert build(parse("near.py:Base"), short).theta == 0.07
    (tmp_path / "wants.py").write_text("from wave import mine\n")
    with pytest.raises(ValueError, match=r"wave\.py beside it cannot be imported"):
        parse("wants.py:Base")


@pytest.mark.slow
def test_scenarios_that_it_cannot_read_are_left_out(capsys, short, tmp_path):
    other = short.override({"name": "encoder", "output": "increment"})
    (tmp_path / "encoder.toml").write_text(other.to_toml())
    words = ["run", "short.toml", "encoder.toml", "--seeds", "2", "--jobs", "1", "--json"]
    status = main([*words, "--estimator", "guests.py:Base", "-o", "out"])
    out, err = capsys.readouterr()
    assert status == 0 and "encoder is left out: guests.py:Base reads 'speed'" in err
    assert {row["scenario"] for row in json.loads(out)["rows"]} == {"short"}
    words = ["compare", "short.toml", "encoder.toml", "--base", "frozen", "--seeds", "2"]
    main([*words, "--candidate", "guests.py:Base", "--jobs", "1", "--json"])
    out, err = capsys.readouterr()
    assert "encoder is left out" in err and {r["scenario"] for r in json.loads(out)["rows"]} <= {
        "short", "all"}  # fmt: skip
    words = ["run", "encoder.toml", "--estimator", "guests.py:Base", "--seeds", "1"]
    assert main(words) == 2 and "leave the scenario out" in capsys.readouterr().err


@pytest.mark.slow
def test_any_class_with_a_knob_is_tuned(capsys, monkeypatch, tmp_path):
    """The template, to the noise of the reference in the parameter that it estimates."""
    main(["new", "mine.py"])
    words = ["tune", "mine.py:Mine", "--match", "f_m", "--seeds", "0:2", "--jobs", "1", "--json"]
    capsys.readouterr()
    assert main(words) == 0
    (found,) = [json.loads(capsys.readouterr().out)]
    assert found["knob"] == "forgetting" and found["ratio"] == pytest.approx(1.0, abs=0.01)
    assert (tmp_path / "results" / "tune" / "mine.py-Mine").is_dir()
    assert main([*words, "--save"]) == 2 and "give a file" in capsys.readouterr().err
    assert main(["tune", "guests.py:Base"]) == 2
    assert "no knob to turn" in capsys.readouterr().err


def test_estimate_is_a_host_too(capsys, short):
    from flexaxis.sim.simulate import simulate

    simulate(short, [0])[0].save("rec.nc")
    words = ["estimate", "rec.nc", "-o", "est.nc", "--json", "--estimator"]
    assert main([*words, "guests.py:Prints"]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 1600
    for name in ("Raises", "Claims"):  # the one by runs, the other step by step
        assert main([*words, f"guests.py:{name}"]) == CRASH
        assert "sample 1500 (7.5 s): KeyError: 'oh'" in capsys.readouterr().err
    assert main([*words, "guests.py:Loops", "--time-limit", "0.3"]) == CRASH
    assert "no end within 0.3 s" in capsys.readouterr().err


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("name", "what"),
    [
        pytest.param("Generator", "GeneratorExit: early", marks=pytest.mark.slow),
        ("Raises_odd", "Odd"),
    ],
)
def test_whatever_it_raises_the_others_go_on(capsys, name, what, jobs):
    status, out, err = ran(capsys, name, "--estimator", "frozen", jobs=jobs)
    assert status == CRASH and f"guests.py:{name} crashed on short" in err and what in err
    assert "sample 0" in err and "frozen" in out and "given up" not in err


def test_in_a_later_piece_sample_and_time_are_those_of_the_record():
    error = ValueError("odd")
    error.at_sample = 2
    with (
        pytest.raises(EstimatorCrash, match=r"on short, sample 1002 \(5.01 s\): ValueError: odd"),
        hosted("own.py:Mine", "on short", first=1000, period=0.005),
    ):
        raise error


def test_an_interrupt_of_its_own_ends_nobody_else(capsys):
    status, out, err = ran(capsys, "Interrupts", "--estimator", "frozen")
    assert status == CRASH and "crashed on short" in err and "frozen" in out


def test_check_goes_on_where_the_process_ends(capsys):
    assert main(["check", "guests.py:Ends"]) == FINDING
    out = " ".join(capsys.readouterr().out.split())
    assert "its code ended it" in out and "the same" in out


def test_who_ends_its_process_costs_nobody_else_a_case(capsys):
    status, out, err = ran(capsys, "Ends", "--estimator", "frozen")
    assert status == CRASH and "guests.py:Ends crashed on short" in err
    assert "its process died: its code ended it" in err and "frozen" in out


def test_what_the_system_kills_is_run_again(capsys):
    status, _, err = ran(capsys, "Killed")
    assert status == 0 and Path("killed").exists(), err


def test_what_was_made_in_a_process_that_ended_is_told_so(short):
    mine, other = (build(parse("guests.py:Base"), short) for _ in range(2))
    with pytest.raises(away.Died):
        mine.there(_end)
    with pytest.raises(EstimatorError, match="make it anew"):
        other.step(0.0, 0.0)
    assert build(parse("guests.py:Base"), short).step(0.0, 0.0)


def _end(_):
    import os

    os._exit(3)


def test_what_hears_no_signal_is_stopped_too(capsys, monkeypatch):
    monkeypatch.setattr(away, "GRACE", 2.0)
    status, _, err = ran(capsys, "Sleeps", "--time-limit", "0.5")
    assert status == CRASH and "no end within 0.5 s" in err
    assert not Path("slept").exists(), "it was waited for"


def test_an_object_of_its_own_comes_as_its_values(short):
    (found,) = build(parse("guests.py:Finds"), short).findings
    assert (found.alarm, found.parameters) == (3, ("f_m",))


def test_what_it_changes_stays_with_it(capsys, tmp_path):
    """Else the results would lie elsewhere, and our own sums would stop at an underflow."""
    before = sys.getrecursionlimit(), np.geterr()
    status, _, err = ran(capsys, "Meddles")
    assert status == 0, err
    assert Path.cwd() == tmp_path and (sys.getrecursionlimit(), np.geterr()) == before
    assert (tmp_path / "out" / "report.html").exists()


def test_a_script_without_a_guard_may_use_workers_that_use_it():
    """No process runs the script again, and none waits for what it has started itself."""
    lines = ["import flexaxis as fx", 'own = "guests.py:Base"',
             'found = fx.benchmark(own, scenarios="short.toml", seeds=2, jobs=2)',
             "print(len(found.rows))"]  # fmt: skip
    Path("script.py").write_text("\n".join(lines))
    done = subprocess.run([sys.executable, "script.py"], check=True, timeout=100,
                          capture_output=True, text=True)  # fmt: skip
    assert done.stdout.split() == ["2"]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_thread_that_never_ends_holds_nobody_up(jobs):
    words = ["run", "short.toml", "--estimator", "guests.py:Threads", "--seeds", "2", "-o", "out"]
    line = [sys.executable, "-m", "flexaxis", *words, "--jobs", str(jobs)]
    subprocess.run(line, check=True, timeout=100, capture_output=True)
    assert (Path("out") / "report.html").exists()


@pytest.mark.parametrize("seconds", ["3", 0, -1.0, float("nan"), float("inf"), [1.0]])
def test_a_time_limit_is_a_number_of_seconds(seconds):
    told = pytest.raises(EstimatorError, match="is none: give a finite number of seconds above 0")
    with told, limited(seconds):
        pass
