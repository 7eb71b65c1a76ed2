"""What docs/speed.py measures: complete and consistent, not how fast this machine is."""

import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.experiments.running.estimators import build, parse

sys.path.append(str(Path(__file__).parents[1] / "docs"))
import speed_peers as peers_module
import speed_steps as steps_module
from speed_memory import _resident, streamed
from speed_peers import PEERS, peers
from speed_rounds import measure, problem, rivals, shipped
from speed_steps import PERCENTILES, steps, time_steps, warm
from speed_streams import make_stream

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


@pytest.mark.slow
def test_one_round():
    given = problem()
    (found,) = measure([*rivals(given), *shipped(given, ["ekf"])], 1)
    rows = {row["name"]: row for row in found}
    assert {"expm", "rpem-run", "rpem-forgetting", "ekf"} <= set(rows)
    for row in found:
        assert row["low"] <= row["ratio"] <= row["high"] and row["us_per_sample"] > 0
    unit = rows["expm"]["us_per_sample"]
    by = {row["by"]: row for row in found if row.get("estimator") == "ekf"}
    assert set(by) == {"run", "run-fault", "step"}
    for row in by.values():
        assert row["unit"] == "rpem-forgetting" and row["besides"] == "expm"
        assert abs(row["times"] - row["us_per_sample"] / unit) < 1e-9


@pytest.mark.slow
def test_steps_are_told_from_the_median_to_the_longest():
    timer, *rows = steps(400, ["rpem-forgetting"])
    assert [row["faults"] for row in rows] == [False, True]
    for row in (timer, *rows):
        assert list(row["cpu_us"]) == list(PERCENTILES) and row["steps"] == 400
        assert list(row["cpu_us"].values()) == sorted(row["cpu_us"].values())
        assert abs(row["of_period"] - row["cpu_us"]["max"] / 5000) < 1e-9
    assert timer["cpu_us"]["p50"] < rows[0]["cpu_us"]["p50"]


@pytest.fixture(scope="module")
def stream():
    return make_stream("linear")


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


def test_what_lengthens_a_step_once_is_not_the_estimators(stream):
    """As where the host of a virtual machine takes its time away."""
    made = []

    def make():
        made.append(stream)
        steps = iter([len(made) == 1] + [False] * 99)
        return SimpleNamespace(step=lambda u, y: next(steps) and busy(0.03))

    row = steps_module._timed(make, 100, stream)
    assert len(made) == 2 and row["cpu_us"]["max"] < 1e4


def busy(seconds):
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        pass


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


@pytest.mark.slow
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
