"""What a case of a board's entry can reach: no truth, no other case, and nobody who has gone."""

import json
import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.board import cage as cages
from flexaxis.experiments.board import world
from flexaxis.experiments.board.cage import Cage, offered
from flexaxis.experiments.board.errors import CageError, EntryError
from flexaxis.experiments.board.rerun import _followed
from flexaxis.experiments.board.wire import Wire
from flexaxis.experiments.board.world import permitted, world_of
from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.conformance.requirements import knows_gaps
from flexaxis.experiments.running.cache import default_cache, records
from flexaxis.sim.record import Record

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="code is not verified here")
alone = pytest.mark.skipif(not permitted(), reason="this system gives no process its own world")
linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked at in /proc")
STEP = find_scenario("fm_step-v1")

SPY = """
import ctypes, gc, os, socket, subprocess, sys

def memory():
    lib = ctypes.CDLL(None)
    old = lib.shmget(0x5EA1, 64, 0o666)
    if old < 0:
        lib.shmget(0x5EA1, 64, 0o1666)
    return float(old >= 0)

def reads(path):
    try:
        with open(path, "rb", 0):
            return 1.0
    except OSError:
        return 0.0

class Spy:
    names, output = ("k_T", "1/J_a", "f_m"), "speed"
    def __init__(self, nominal, period): pass
    def step(self, u, y):
        truths = sum(type(o).__name__ in ("Scenario", "Record") for o in gc.get_objects())
        return memory(), reads("/proc/1/mem"), float(truths)

class Named(Spy):
    def step(self, u, y):
        return float(socket.gethostname() == "board"), float(os.path.exists("/sys/kernel")), 0.0

class Stays(Spy):
    \"\"\"Answers for a case that is not its own, and goes on when it has ended.\"\"\"
    def step(self, u, y):
        if u == 1:
            told, self.tells = os.pipe()
            self.pid = os.fork()
            if self.pid:
                return self.pid, 0.0, 0.0
            os.read(told, 1)
        else:
            os.write(self.tells, b"!")
            return self.pid, 0.0, 0.0
        while True:
            for fd in range(3, 9):
                try:
                    os.write(fd, b"N" + (24).to_bytes(8, "little") + bytes(24))
                except OSError:
                    pass

class Spin(Spy):
    def step(self, u, y):
        if u == 1:
            return os.getpid(), 0.0, 0.0
        while True: pass
"""


@pytest.fixture
def folder(tmp_path):
    """An entry with code that looks around."""
    (tmp_path / "entry").mkdir()
    (tmp_path / "entry" / "spy.py").write_text(SPY)
    return tmp_path / "entry"


def there(pid):
    """Whether a process runs; one that has ended and that nobody has asked for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_an_estimator_is_offered_nothing_of_the_truth():
    told = offered(find_scenario("real_lugre_fm_step-v1"))
    assert told.keys() == {"name", "nominal", "period", "identify", "output", "noise"}
    assert not any(word in json.dumps(told) for word in ("lugre", "fm_step", "stiff", "streams"))
    assert told["nominal"]["J_m"] == pytest.approx(0.95 * 0.0012)  # as told, not as it is
    for one, other in (("fm_step-v1", "load-v1"), ("fm_step-v1", "fm_double-v1")):
        assert offered(find_scenario(one)) == offered(find_scenario(other))


@alone
def test_a_case_finds_neither_truth_nor_what_another_has_left(folder):
    with Cage(folder) as cage:
        for _ in range(2):
            with cage.case("spy.py:Spy", STEP) as spy:
                assert spy.step(0.0, 0.0).tolist() == [0, 0, 0]
        with cage.case("spy.py:Named", STEP) as spy:
            assert spy.step(0.0, 0.0).tolist() == [1, 0, 0]


@linux
def test_a_case_neither_outlives_its_end_nor_speaks_for_the_next(folder):
    with Cage(folder, plain=True, patience=20.0) as cage:
        with cage.case("spy.py:Stays", STEP) as spy:
            pid = int(spy.step(1.0, 0.0)[0])
            assert pid and there(pid)
            spy.step(2.0, 0.0)  # from here on two answer
        with cage.case("spy.py:Spin", STEP) as spy:
            assert not there(pid)
            assert spy.step(1.0, 0.0)[0] > 0  # not the zeros of the other


@alone
@pytest.mark.parametrize(
    ("line", "lacks"), [("board.shut", "nothing to write to"), ("/home-of", "no files of the user")]
)
def test_where_anything_is_lacking_nothing_is_run(folder, monkeypatch, line, lacks):
    home = folder.parent / "home-of"
    home.mkdir()
    (home / "secret").write_text("password")
    monkeypatch.setenv("HOME", str(home))

    def other(entry):
        for each in world_of(entry):
            if line == "board.shut" and line in each:
                continue
            yield each
            if line == "/home-of" and each.endswith("/sys/tmp"):
                yield f"mkdir -p /sys{home}; mount --rbind {home} /sys{home}"

    monkeypatch.setattr(cages, "world_of", other)
    with pytest.raises(CageError, match=lacks), Cage(folder):
        pass


def test_python_in_tmp_has_no_place_in_a_world(folder, monkeypatch):
    monkeypatch.setattr(world, "_seen", lambda: ["/usr", "/tmp/venv"])
    assert not permitted()
    with pytest.raises(CageError, match="/tmp/venv lies in /tmp"), Cage(folder):
        pass


def test_without_a_world_nothing_is_run_unless_that_is_asked_for(folder, monkeypatch):
    monkeypatch.setattr(cages, "permitted", lambda: False)
    with pytest.raises(CageError, match="--plain runs its code with all your rights"), Cage(folder):
        pass


@linux
@pytest.mark.parametrize("plain", [True, pytest.param(False, marks=[alone, pytest.mark.slow])])
def test_a_verifier_that_is_killed_leaves_nothing(folder, tmp_path, plain):
    text = f"""
import sys
from pathlib import Path
from flexaxis.experiments.board.cage import Cage
from flexaxis.experiments.catalogue.find import find_scenario
with Cage(Path({str(folder)!r}), plain={plain}) as cage:
    with cage.case("spy.py:Spin", find_scenario("fm_step-v1")) as spy:
        print(cage._process.pid, int(spy.step(1.0, 0.0)[0]), flush=True)
        spy.step(0.0, 0.0)
"""
    place = tmp_path / "tmp"
    place.mkdir()
    with subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(place)},
    ) as verifier:  # fmt: skip
        pids = [int(word) for word in verifier.stdout.readline().split()][: 2 if plain else 1]
        assert len(pids) and all(map(there, pids))
        verifier.send_signal(signal.SIGKILL)
    end = time.monotonic() + 10
    while any(map(there, pids)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(there, pids)) and not [*place.glob("flexaxis-*")]


def test_a_case_has_a_time_in_all():
    one, other = os.pipe()
    wire = Wire(one, other, patience=30.0, in_all=0.2)
    wire.send("x")
    assert wire.receive() == "x"
    with pytest.raises(EntryError, match=r"more than 0\.2 s for a case"):
        wire.receive()
    os.close(one)
    os.close(other)


class Counting:
    """An estimator that remembers how many samples came at once."""

    def __init__(self):
        self.names, self.output, self.able, self.sizes = ("f_m",), "speed", {"covariance"}, []

    def run(self, u, y):
        self.sizes.append(len(u))
        return np.zeros((len(u), 1))

    def told(self):
        at = float(sum(self.sizes))
        return SimpleNamespace(covariance=[[at]], innovations=None, findings=None)


def test_where_a_record_is_cut_says_nothing_of_the_fault():
    zeros = np.zeros(STEP.samples)
    record = Record(
        **{f: zeros for f in ("torque", "speed")}, time=np.arange(STEP.samples) * STEP.period
    )
    sizes = []
    for changes in ({}, {"fault[0].at": 7.0}, {"fault": []}):
        estimator, scenario = Counting(), STEP.override(changes) if changes else STEP
        claimed = _followed(estimator, record, scenario)[1]
        at = scenario.events()[0].index if scenario.events() else STEP.samples
        assert claimed == [[at]]  # of the sample before the fault, all the same
        sizes.append(estimator.sizes)
    assert all(one == other for one, other in pairwise(sizes))


def test_gaps_come_through_to_where_the_code_runs(tmp_path):
    record = records(STEP, [1000], default_cache())[0][0]
    u, y, valid = record.torque[:300], record.speed[:300].copy(), np.ones(300, bool)
    valid[200:220], y[200:220] = False, 5.0
    expected = run_estimator(build(parse("rpem-forgetting"), STEP), u, y, valid)
    with Cage(tmp_path, plain=True) as cage, cage.case("rpem-forgetting", STEP) as remote:
        assert run_estimator(remote, u, y, valid).tolist() == expected.tolist()


def test_a_run_that_knows_no_gaps_is_one_outside_too(folder):
    (folder / "spy.py").write_text(
        SPY + "class Plain(Spy):\n    def run(self, u, y): return [[0, 0, 0]] * len(u)\n"
    )
    with Cage(folder, plain=True) as cage:
        with cage.case("spy.py:Plain", STEP) as remote:
            assert not knows_gaps(remote)
        with cage.case("rpem-forgetting", STEP) as remote:
            assert knows_gaps(remote)
