"""What `flexaxis speed` tells: complete and consistent, not how fast this machine is."""

import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.cli import main
from flexaxis.experiments.speed import deadline as deadline_module
from flexaxis.experiments.speed import peers as peers_module
from flexaxis.experiments.speed import steps as steps_module
from flexaxis.experiments.speed.deadline import Run, _Claiming, _later, deadline, with_deadline
from flexaxis.experiments.speed.memory import _resident, streamed
from flexaxis.experiments.speed.peers import PEERS, peers
from flexaxis.experiments.speed.problem import problem
from flexaxis.experiments.speed.steps import PERCENTILES, time_steps, warm
from flexaxis.experiments.speed.streams import make_stream

# what other libraries warn of when they are imported is theirs
PEERS_WARN = pytest.mark.filterwarnings("ignore")
HOARDER = """
class Hoarder:
    names, output = ("k_T",), "speed"

    def __init__(self, nominal, period):
        self.all, self.theta = [], [nominal["k_T"]]

    def step(self, u, y):
        self.all.append(y)
        return self.theta
"""
JUDGE = """
class Judge:  # works on much for a second of every five
    names, output = ("k_T",), "speed"

    def __init__(self, nominal, period):
        self.k, self.held, self.theta = 0, None, [nominal["k_T"]]

    def step(self, u, y):
        self.k += 1
        self.held = bytes(40_000) if 100 < self.k % 1000 < 400 else b""
        return self.theta
"""


def told(capsys, *words):
    assert main(["speed", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def stream():
    return make_stream("linear")


@PEERS_WARN
def test_one_round(capsys):
    found = told(capsys, "--rounds", "1", "--estimator", "ekf")
    rows = {row["name"]: row for row in found["rows"]}
    assert {"expm", "literal-rpem", "c2d", "rpem-run", "ekf-run", "plant"} <= set(rows)
    assert set(rows) | set(found["missing"]) >= set(PEERS)
    assert rows["expm"]["ratio"] == rows["engine"]["ratio"] == 1.0
    for row in rows.values():
        assert row["low"] <= row["ratio"] <= row["high"] and row["us_per_sample"] > 0
    unit = rows["expm"]["us_per_sample"]
    assert abs(rows["c2d"]["ratio"] - unit / rows["c2d"]["us_per_sample"]) < 1e-9
    by = {row["by"]: row for row in found["rows"] if row.get("estimator") == "ekf"}
    assert set(by) == {"run", "run-fault", "step"}
    for row in by.values():
        assert row["unit"] == "rpem-forgetting" and row["besides"] == "expm"
        assert abs(row["times"] - row["us_per_sample"] / unit) < 1e-9


@pytest.mark.parametrize(
    ("words", "named"),
    [("--rounds 0", "--rounds 0"), ("--steps -1", "--steps -1"), ("--memory 0", "--memory 0"),
     ("--steps 5 --seeds 3", "--seeds"), ("--steps 5 --estimator relocat", "relocat"),
     ("--memory 1e-6", "0.25 hours"),
     ("--deadline nan", "--deadline nan"), ("--steps 5 --rounds 2", "--rounds"),
     ("--campaign smoke --rounds 2", "--rounds"), ("--steps 5 --jobs 2", "--jobs"),
     ("--deadline 0.001 --seeds 300:301 --estimator ekf", "ekf takes no deadline"),
     ("--deadline 0.001 --estimator relocate[deadline=0.002]", "a deadline already"),
     ("--deadline 0.001 --estimator pipe:cat", "pipe:cat takes no deadline")],
)  # fmt: skip
def test_what_cannot_be_measured_is_refused(capsys, words, named):
    assert main(["speed", *words.split()]) == 2
    told = capsys.readouterr().err
    assert named in told and told.count("\n") == 1


@pytest.mark.parametrize("text", ["relocate", "relocate[]", "relocate[gain=0.5]"])
def test_a_deadline_goes_among_the_options_that_are_given(text):
    options = parse(text).options
    assert parse(with_deadline(text, 0.0012345678)).options == {**options, "deadline": 0.0012345678}


@pytest.mark.parametrize("when", ["made", "run"])
def test_a_peer_that_breaks_is_left_out_with_its_words(monkeypatch, when):
    def make(given):
        if when == "run":
            return lambda u, y: fail()
        return fail()

    def fail():
        raise AttributeError("no such\nname here")

    monkeypatch.setattr(peers_module, "PEERS", {"ekf-broken": ("", make, time.thread_time)})
    found, missing = peers(problem())
    assert len(found) == 1
    assert missing == {"ekf-broken": "AttributeError: no such name here"}


@pytest.mark.parametrize("name", PEERS)
@PEERS_WARN
def test_peers_compute_what_we_compute(name):
    found, missing = peers(problem(), [name])
    if missing:
        assert "pip install" in missing[name]  # not installed, and not broken
        pytest.skip(missing[name])
    row = found[-1]
    # rounding in P, whose numbers span eight decades; a wrong sample of the torque gives 1e-2
    assert row.facts["difference"] < 1e-6


def test_steps_are_told_from_the_median_to_the_longest(capsys):
    timer, *rows = told(capsys, "--steps", "400", "--estimator", "rpem-forgetting")["rows"]
    assert [row["faults"] for row in rows] == [False, True]
    for row in (timer, *rows):
        for clock in ("cpu_us", "wall_us"):
            assert list(row[clock]) == list(PERCENTILES)
            assert list(row[clock].values()) == sorted(row[clock].values())
        assert row["steps"] == 400
        assert abs(row["of_period"] - row["cpu_us"]["max"] / 5000) < 1e-9
    assert timer["cpu_us"]["p50"] < rows[0]["cpu_us"]["p50"]


def test_a_long_step_is_seen_by_the_clock_that_runs_in_it(stream):
    def step(u, y):
        step.count += 1
        if step.count == 50:
            while time.thread_time() < busy:
                pass
        if step.count == 80:
            time.sleep(0.1)

    step.count, busy = 0, time.thread_time() + 0.03
    cpu, wall = time_steps(SimpleNamespace(step=step), stream, 100)
    assert cpu.argmax() == 49 and 1e7 < cpu[49] <= wall[49]
    assert wall[79] > 1e8 > 2 * cpu[79]


def test_the_next_lap_goes_on_where_the_last_one_ended(stream):
    lap = len(stream.u)
    rpem = build(parse("rpem-forgetting"), stream.scenario)
    rpem.run(*stream.samples(0).take(2 * lap))
    off = rpem.innovations[:, 0] / stream.noise
    assert np.abs(off[lap - 5 : lap + 200]).max() < 5
    assert np.abs(off).max() > 5  # as at the faults
    changed = np.prod([[f.factor for f in stream.scenario.fault]])
    assert changed == pytest.approx(1.0)


def test_pieces_of_a_stream_are_the_stream(stream):
    whole = stream.samples(3).take(100)
    pieces = stream.samples(3)
    parts = zip(*(pieces.take(size) for size in (1, 60, 39)), strict=True)
    for at_once, piecewise in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(at_once, np.concatenate(piecewise))


@pytest.mark.slow
def test_what_keeps_every_sample_is_not_flat(stream, tmp_path):
    (tmp_path / "hoarder.py").write_text(HOARDER)
    row = streamed(f"{tmp_path / 'hoarder.py'}:Hoarder", stream, 0.01)
    assert row["samples"] == 7200 and not row["flat"]
    assert row["grown"] >= 8 * 0.9 * 7200
    kept = streamed("rpem-forgetting", stream, 0.01)
    assert kept["grown"] == 0 and kept["made"] > 100
    assert list(kept) == list(row)


def test_what_is_held_for_a_while_is_seen_whatever_the_phase(stream, tmp_path):
    (tmp_path / "judge.py").write_text(JUDGE)
    row = streamed(f"{tmp_path / 'judge.py'}:Judge", stream, 0.05)
    assert row["early"] >= 8 * 5000 and abs(row["grown"]) < 100


def test_who_is_warmed_up_is_at_its_start(stream, monkeypatch):
    monkeypatch.setattr(steps_module, "_stream", lambda *_: stream)
    warmed, new = (build(parse("rpem-forgetting"), stream.scenario) for _ in range(2))
    warm(warmed, "linear")
    u, y = stream.samples(0).take(100)
    np.testing.assert_array_equal(warmed.run(u, y), new.run(u, y))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="not told on this system")
def test_what_a_process_holds_is_what_the_kernel_says():
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    (kilobytes,) = [int(line.split()[1]) for line in lines if line.startswith("VmRSS")]
    assert _resident() == pytest.approx(1024 * kilobytes, rel=0.05)


def found(alarm, onset, *parameters):
    return SimpleNamespace(alarm=alarm, onset=onset, parameters=parameters)


def test_a_row_of_a_deadline_by_hand(monkeypatch):
    """Two seeds: the longest step of both, the later claim, all findings, how late they come."""
    one, other = found(105, 100, "f_m"), found(305, 300, "k_T")
    runs = {
        7: [Run(90.0, 30, [one, other]), Run(40.0, 35, [found(109, 100, "f_m")])],
        8: [Run(70.0, 50, [one]), Run(45.0, None, [found(107, 100, "f_m"), other])],
    }
    asked = []

    def both(name, limited, seed):
        asked.append((name, limited))
        return runs[seed], 1000 * seed

    monkeypatch.setattr(deadline_module, "_both", both)
    (row,) = deadline(0.001, [7, 8], ["relocate"])
    assert asked == [("relocate", "relocate[deadline=0.001]")] * 2
    assert row == {
        "estimator": "relocate", "deadline": 0.001, "steps": 15000,
        "longest_us": 90.0, "longest_with_us": 45.0, "findings": 3, "findings_with": 3,
        "alike": 2, "later_median": 3.0, "later_max": 4, "claim": 50, "claim_with": 35,
    }  # fmt: skip


def test_a_claim_is_one_of_all_parameters():
    """From the first sample on after which every variance is more than zero."""
    estimator = SimpleNamespace(covariance=None, count=0)

    def step(u, y):
        variances = [None, (1.0, 0.0), (1.0, 1.0), (2.0, 2.0)][estimator.count]
        estimator.covariance = None if variances is None else np.diag(variances)
        estimator.count += 1

    estimator.step = step
    claiming = _Claiming(estimator)
    for _ in range(4):
        claiming.step(0.0, 0.0)
    assert claiming.first == 2


def test_how_much_later_a_finding_comes():
    without = Run(1.0, 0, [found(105, 100, "f_m"), found(305, 300, "k_T"), found(505, 500, "d_g")])
    limited = Run(1.0, 0, [found(125, 99, "f_m"), found(308, 301, "J_a"), found(512, 500, "d_g")])
    assert list(_later(without, limited)) == [20, 7]


@pytest.mark.slow
def test_a_deadline_makes_steps_shorter_and_findings_later(capsys):
    words = ("--deadline", "0.001", "--seeds", "0:1", "--estimator", "relocate")
    (row,) = told(capsys, *words)["rows"]
    assert row["longest_with_us"] < row["longest_us"]
    assert row["alike"] > 0 and 0 <= row["later_median"] <= row["later_max"]
