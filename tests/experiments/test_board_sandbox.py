"""What code of an entry reaches from its sandbox, what is left for the next case, and limits."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.compiler import cache_folder
from flexaxis.experiments.board import sandbox
from flexaxis.experiments.board.entry import EntryError
from flexaxis.experiments.board.protocol import Wire, plain
from flexaxis.experiments.board.sandbox import ROOM, Sandbox, SandboxError, usage
from flexaxis.experiments.board.verification import rerun
from flexaxis.experiments.building.offer import offer_of
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.cache import default_cache, records
from flexaxis.experiments.running.engine import Means

sys.path.insert(0, str(Path(__file__).parent))
from boards import CHEATS, confined
from cheats import probes

pytestmark = pytest.mark.skipif(os.name == "nt", reason="code is not verified here")
STEP = find_scenario("fm_step-v1")
MEANS = Means(store=default_cache())
ASKED = {"offer": offer_of(STEP).as_data() | {"name": "the scenario"}}


def case(place, text):
    return place.case(ASKED | {"estimator": text}, lambda which: np.zeros(8000))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An entry that tries all it can, and beside it a secret, and servers that listen."""
    home = tmp_path_factory.mktemp("probes")
    (home / "secret").write_text("password")
    (home / "entry" / "code").mkdir(parents=True)
    stop, name = threading.Event(), f"flexaxis-{os.getpid()}"
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(socket.AF_UNIX) as other:
        if sys.platform == "linux":
            other.bind(f"\0{name}")
            other.listen()
        threads = [threading.Thread(target=_accept, args=[s, stop]) for s in (server, other)]
        for thread in threads:
            thread.start()
        text = (CHEATS / "probes.py").read_text()
        for word, value in (
            ('"HOME_OF_USER"', repr(str(Path.home()))),
            ("PORT, SECRET, SOCKET = 1,", f"PORT, SECRET, SOCKET = {server.getsockname()[1]},"),
            ('"SECRET_FILE"', repr(str(home / "secret"))),
            ('"ABSTRACT_SOCKET"', repr(name)),
            ('"TESTS"', repr(str(Path(__file__).parent))),
        ):
            assert word in text
            text = text.replace(word, value)
        (home / "entry" / "code" / "probes.py").write_text(text)
        yield home / "entry"
        stop.set()
        for thread in threads:
            thread.join()


def _accept(server, stop):
    server.settimeout(0.1)
    while not stop.is_set():
        with suppress(OSError):
            server.accept()[0].close()


@pytest.fixture(scope="module")
def got_through(folder):
    os.environ["SECRET"] = "password"
    try:
        with Sandbox(folder) as place, case(place, "code/probes.py:Probe") as probe:
            return dict(zip(probe.names, probe.step(0.0, 0.0), strict=True))
    finally:
        del os.environ["SECRET"]


@confined
@pytest.mark.parametrize("attempt", probes.PROBES)
def test_code_does_not_get_at(attempt, got_through):
    assert got_through[attempt] == 0


def test_attempts_get_through_where_nothing_holds_them(folder):
    """Else a probe that is wrong would hold anywhere."""
    os.environ["SECRET"] = "password"
    try:
        with (
            Sandbox(folder, confined=False) as place,
            case(place, "code/probes.py:Probe") as probe,
        ):
            found = dict(zip(probe.names, probe.step(0.0, 0.0), strict=True))
    finally:
        del os.environ["SECRET"]
    for attempt in ("a server on this computer", "a secret beside the entry", "tests", "/var"):
        assert found[attempt] == 1, attempt
    assert found["variables of the user"] == 0  # all the same


@pytest.mark.slow
@confined
def test_a_case_leaves_nothing_for_the_next(folder):
    """Nor would it be of use there: seed and time of the fault are other ones."""
    with Sandbox(folder) as place:
        for u in (1.0, 0.0):
            with case(place, "code/probes.py:Leaves") as probe:
                left = dict(zip(probe.names, probe.step(u, 0.0), strict=True))
            if u:
                assert (
                    left["a file in /tmp"]
                    and left["shared memory"]
                    and left["a process that stays"]
                )
    assert {what for what, there in left.items() if there} <= MESSAGES


@pytest.mark.slow
@confined
def test_more_may_be_compiled_than_a_case_has_room_for(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("FLEXAXIS_COMPILED", str(tmp_path))
    with open(tmp_path / "flexaxis_of_long_ago.nbc", "wb") as kept:
        kept.truncate(2 * ROOM)
    cache_folder.cache_clear()
    try:
        with Sandbox(folder) as place:
            assert all(place.reached.values())
    finally:
        cache_folder.cache_clear()


MESSAGES: set[str] = set()
"""Ways to tell the next case something that bubblewrap does not shut."""

GREEDY = """
import os, subprocess, sys, time
class Greedy:
    names, output, step = ("f_m",), "speed", None
    def __init__(self, nominal, period): self.kept = []
class Endless(Greedy):
    def step(self, u, y):
        while True: pass
class Loud(Greedy):
    def step(self, u, y):
        print("x" * 100000); os.write(1, b"y" * 1000)
        raise ValueError("it hurts \\x1b[31m" + "z" * 100000)
class Wide(Greedy):
    def step(self, u, y): return range(7)
class Huge(Greedy):
    def step(self, u, y): return __import__('numpy').zeros(8_000_000)
class Telling(Greedy):
    findings = [type("F", (), {"alarm": 1, "parameters": ["x" * 10**7]})()]
    def step(self, u, y): return 0
class Gone(Greedy):
    def step(self, u, y): os._exit(0)
class Many(Greedy):
    def step(self, u, y):
        for _ in range(100): self.kept.append(subprocess.Popen(["sleep", "60"]))
        time.sleep(60)
class Filled(Greedy):
    def step(self, u, y):
        children = 4
        while children and os.fork(): children -= 1
        kept = [b"x" * 1_500_000_000]
        time.sleep(60)
class Grown(Greedy):
    def step(self, u, y): return len(b"x" * 9_000_000_000)
class Slow(Greedy):
    def step(self, u, y): time.sleep(1); return 0.0
class Who(Greedy):
    def step(self, u, y): return os.getpid()
"""
LIMITS = {
    "Loud": "ValueError: it hurts",
    "Wide": "gave 7 numbers, not 1",
    "Huge": "sent .* bytes for an answer",
    "Telling": "sent .* bytes for an answer",
    "Gone": "has ended",
    "Endless": "no answer within 2 s",
    "Many": r"processes; 64 are allowed",
    "Grown": "MemoryError",
}


@pytest.fixture
def greedy(tmp_path):
    (tmp_path / "greedy.py").write_text(GREEDY)
    return tmp_path


@confined
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n not in {"Endless", "Huge"})) for n in LIMITS],
)
def test_code_that_takes_too_much_is_ended(greedy, name):
    with Sandbox(greedy, patience=2.0 if name == "Endless" else 20.0) as place:
        with (
            pytest.raises((EstimatorError, EntryError), match=LIMITS[name]) as caught,
            case(place, f"greedy.py:{name}") as estimator,
        ):
            estimator.step(0.0, 0.0)
            assert estimator.findings
        assert len(str(caught.value)) < 300 and "\x1b" not in str(caught.value)
        with case(place, "greedy.py:Who") as estimator:  # the next is as if nothing had been
            assert estimator.step(0.0, 0.0)[0] < 10


@pytest.mark.slow
@confined
def test_the_memory_of_all_processes_together_is_limited(greedy, monkeypatch):
    monkeypatch.setattr(sandbox, "MEMORY", 1 << 30)
    with (
        Sandbox(greedy, patience=60.0) as place,
        pytest.raises(EntryError, match="MB; 1024 are allowed"),
        case(place, "greedy.py:Filled") as estimator,
    ):
        estimator.step(0.0, 0.0)


@pytest.mark.slow
def test_a_case_has_a_time_in_all(greedy, monkeypatch):
    monkeypatch.setattr(sandbox, "IN_ALL", 0.75)
    with (
        Sandbox(greedy, patience=4.0, confined=False) as place,
        pytest.raises(EntryError, match="no end"),
        case(place, "greedy.py:Slow") as estimator,
    ):
        for _ in range(6):
            estimator.step(0.0, 0.0)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked at in /proc")
def test_all_that_a_process_has_started_is_counted():
    line = "import subprocess, time; subprocess.Popen(['sleep', '60']); print(1, flush=True)"
    line += "; time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", line], stdout=subprocess.PIPE) as one:
        assert one.stdout.readline() == b"1\n"
        processes, size = usage(one.pid)
        subprocess.run(["pkill", "-P", str(one.pid)], check=False)
        one.kill()
    assert processes == 2 and 2 << 20 < size < 1 << 30


def test_what_comes_back_is_read_with_care():
    one, other = Pipe(duplex=False)
    wire = Wire(one, other)
    for content in (b"N" + b"x" * 7, b"J{,}", b""):
        other.send_bytes(content)
        with pytest.raises(EntryError, match="no answer"):
            wire.receive()
    wire.send(np.arange(3.0))
    assert wire.receive().tolist() == [0, 1, 2]
    os.write(other.fileno(), b"\x40\0\0\0N")  # a length that nobody waits for
    with pytest.raises(EntryError, match="more than 65536 bytes for an answer"):
        wire.receive()
    one, other = Pipe(duplex=False)
    other.close()
    with pytest.raises(EntryError, match="has ended"):
        Wire(one, other).receive()


def test_a_text_of_somebody_else_is_short_and_does_nothing():
    assert plain("a\x1b[31m\n" + "b" * 1000) == "a [31m " + "b" * 193


def test_without_bubblewrap_nothing_is_run(greedy, monkeypatch):
    monkeypatch.setenv("PATH", str(greedy))
    with pytest.raises(SandboxError, match="apt install bubblewrap"), Sandbox(greedy):
        pass


@pytest.mark.skipif(os.name == "nt", reason="a script of the shell")
def test_where_the_system_refuses_bubblewrap_nothing_is_run(greedy, monkeypatch):
    (greedy / "bwrap").write_text("#!/bin/sh\necho bwrap: No permissions to create namespace >&2\n")
    (greedy / "bwrap").chmod(0o755)
    monkeypatch.setenv("PATH", f"{greedy}{os.pathsep}{os.environ['PATH']}")
    sandbox._no_more_namespaces.cache_clear()
    with pytest.raises(SandboxError, match=r"No permissions to create.*sysctl"), Sandbox(greedy):
        pass
    sandbox._no_more_namespaces.cache_clear()


@pytest.mark.slow
@confined
@pytest.mark.parametrize("option", ["--unshare-all", "--cap-drop"])
def test_where_anything_is_lacking_nothing_is_run(greedy, monkeypatch, option):
    real = sandbox.command

    def less(entry):
        words = real(entry)
        at = words.index(option)
        del words[at : at + (2 if option == "--cap-drop" else 1)]
        return [w for w in words if w not in {"--disable-userns", "--unshare-user"}]

    if option == "--unshare-all":
        monkeypatch.setattr(sandbox, "OWN", tuple(o for o in sandbox.OWN if o != "--hostname"))
    monkeypatch.setattr(sandbox, "command", less)
    with pytest.raises(SandboxError), Sandbox(greedy):
        pass


def test_an_estimator_is_offered_nothing_of_the_truth():
    told = offer_of(find_scenario("real_lugre_fm_step-v1")).as_data() | {"name": "the scenario"}
    known = {"name", "model", "nominal", "period", "identify", "output", "noise"}
    assert told.keys() == known
    assert not any(word in json.dumps(told) for word in ("lugre", "fm_step", "stiff", "streams"))
    assert told["nominal"]["J_m"] == pytest.approx(0.95 * 0.0012)  # as told, not as it is


@pytest.mark.slow
@confined
def test_a_verifier_that_is_killed_leaves_nothing(greedy):
    text = f"""
import time
from pathlib import Path
from flexaxis.experiments.board.sandbox import Sandbox
with Sandbox(Path({str(greedy)!r})) as place:
    print(place._next._process.pid, flush=True)
    time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE) as verifier:
        pid = int(verifier.stdout.readline())
        assert usage(pid)[0] > 1
        verifier.kill()
    for _ in range(100):
        if usage(pid)[1] == 0:
            break
        threading.Event().wait(0.1)
    assert usage(pid)[1] == 0


@pytest.mark.slow
@confined
def test_a_case_has_the_rows_of_a_run(tmp_path):
    """The code is told neither fault nor seed, sample by sample, and yet: the same numbers."""
    for text in ("rpem-forgetting", "ekf"):
        (mine,) = Bench([STEP], None, MEANS).runs([STEP], [text], [1002])[STEP.hash, text]
        record = records(STEP, [1002], default_cache())[0][0]
        with Sandbox(tmp_path) as place:
            found = rerun(place, text, STEP, record)
        for score in ("lag", "std", "excess", "diverged"):
            given, wanted = ([row[score] for row in rows] for rows in (found, mine))
            assert np.array(given, float) == pytest.approx(np.array(wanted, float), nan_ok=True)


def test_samples_that_are_missing_are_told(greedy):
    (greedy / "greedy.py").write_text(
        GREEDY + "class Gap(Greedy):\n    def step(self, u, y): return -1 if y is None else y\n"
    )
    with Sandbox(greedy, confined=False) as place, case(place, "greedy.py:Gap") as estimator:
        assert [float(estimator.step(0.0, y)[0]) for y in (0.5, None, 2.0)] == [0.5, -1, 2]


def test_what_is_found_comes_back_as_it_is(greedy):
    (greedy / "greedy.py").write_text(
        GREEDY + "from types import SimpleNamespace as S\nclass Finds(Greedy):\n"
        "    findings = [S(alarm=7, parameters=('f_m',), ratio=(1.5,)), S(alarm=9, onset=8)]\n"
    )
    with Sandbox(greedy, confined=False) as place, case(place, "greedy.py:Finds") as estimator:
        first, second = estimator.findings
    assert first == SimpleNamespace(alarm=7, onset=7, parameters=("f_m",), ratio=(1.5,))
    assert second == SimpleNamespace(alarm=9, onset=8, parameters=(), ratio=())


def test_only_what_is_needed_of_python_is_seen():
    for path in sandbox.seen():
        assert path not in {sys.prefix, sys.base_prefix, "/usr", "/etc", str(Path.home())}
    assert any(re.fullmatch(r".*/(site|dist)-packages", path) for path in sandbox.seen())
    assert shutil.which("true").startswith(tuple(sandbox.seen()))
