"""What a case of a board's entry may ask of the system, and of whoever checks."""

import os
import socket
import time

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board import child, sieve
from flexaxis.experiments.board.cage import Cage
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.world import permitted
from flexaxis.experiments.catalogue.find import find_scenario

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="code is not verified here")
alone = pytest.mark.skipif(not permitted(), reason="this system gives no process its own world")
STEP = find_scenario("fm_step-v1")

SPY = """
import ctypes, gc, os, socket, subprocess, sys, time

class Base:
    names, output = ("k_T", "1/J_a", "f_m"), "speed"
    def __init__(self, nominal, period): pass

class Frames(Base):
    \"\"\"Reads what the process that serves cases has in its variables.\"\"\"
    def step(self, u, y):
        frame, found = sys._getframe(), 0.0
        while frame:
            found += sum("secret-name" in repr(value) for value in frame.f_locals.values())
            frame = frame.f_back
        held = [o for o in gc.get_objects() if type(o) in (dict, list)]
        return found, float(sum("secret-name" in o for o in held)), 0.0

class Calls(Base):
    \"\"\"Tries sockets that no namespace holds, and calls by which others could be had.\"\"\"
    def step(self, u, y):
        sockets = 0.0
        for family in range(3, 46):
            for kind in (1, 2, 3, 5):
                try:
                    socket.socket(family, kind).close()
                    sockets += family not in (10, 16)
                except OSError:
                    pass
        lib = ctypes.CDLL(None, use_errno=True)
        def refused(number):
            return lib.syscall(number, 0, 0, 0, 0, 0) < 0 and ctypes.get_errno() == 1
        works = subprocess.run(["/bin/echo", "hi"], capture_output=True).stdout == b"hi\\n"
        return sockets, float(sum(map(refused, (425, 426, 427)))), float(works)

class Mute(Base):
    \"\"\"Answers before it is asked, and reads nothing.\"\"\"
    def __init__(self, nominal, period):
        text = b'{"names": ["k_T", "1/J_a", "f_m"], "output": "speed", "able": ["run", "gaps"]}'
        for fd in range(3, 64):
            try:
                os.write(fd, b"J" + len(text).to_bytes(8, "little") + text)
            except OSError:
                pass
        while True:
            time.sleep(1)

class Talks(Base):
    def __init__(self, nominal, period):
        raise RuntimeError(1_000_000 * "A")

class Forges(Base):
    def __init__(self, nominal, period):
        text = b'{"error": "' + 1_000_000 * b"A" + b'"}'
        for fd in range(3, 64):
            try:
                os.write(fd, b"J" + len(text).to_bytes(8, "little") + text)
            except OSError:
                pass
        os._exit(0)
"""


@pytest.fixture
def folder(tmp_path):
    """An entry with code that tries this and that."""
    (tmp_path / "entry").mkdir()
    (tmp_path / "entry" / "spy.py").write_text(SPY)
    return tmp_path / "entry"


@alone
def test_a_case_is_not_told_what_lies_in_the_home(folder, tmp_path, monkeypatch):
    """What must not be seen there is said to another process than that from which cases come."""
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "secret-name").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    with Cage(folder) as cage, cage.case("spy.py:Frames", STEP) as spy:
        # its own text of the name is in a constant of code, and code is not looked at
        assert spy.step(0.0, 0.0).tolist() == [0, 0, 0]


@alone
def test_a_case_has_no_sockets_that_go_round_its_network(folder):
    """Such as those to the host of a virtual machine, which a namespace does not hold."""
    if os.uname().machine not in sieve._CALLS:
        pytest.skip("the numbers of calls are not known here")
    with Cage(folder) as cage, cage.case("spy.py:Calls", STEP) as spy:
        assert spy.step(0.0, 0.0).tolist() == [0, 3, 1]


def test_where_such_sockets_are_left_there_is_a_network(monkeypatch):
    """As on a machine whose calls are not known."""
    monkeypatch.setattr(socket, "if_nameindex", lambda: [(1, "lo")])
    monkeypatch.setattr(child, "_connects", lambda: False)
    for families, expected in (((socket.AF_UNIX,), False), ((255,), True)):
        monkeypatch.setattr(sieve, "HELD_BY_NONE", families)
        assert child.reached([], "")["no network"] is expected


def test_who_reads_nothing_has_his_time(folder):
    """Else whoever checks would wait for ever for room in front of him."""
    samples = np.zeros(100_000)
    with Cage(folder, plain=True, patience=6.0) as cage:
        begin = time.monotonic()
        late = pytest.raises(EntryError, match="did not take a message within 6 s")
        with late, cage.case("spy.py:Mute", STEP) as spy:
            spy.run(samples, samples)
        assert time.monotonic() - begin < 60
    # whoever is sound has the usual patience: a busy machine may be slow to begin
    with Cage(folder, plain=True) as cage, cage.case("rpem-forgetting", STEP) as other:
        assert other.run(samples[:10], samples[:10]).shape == (10, 3)


@pytest.mark.parametrize("name", ["Talks", "Forges"])
def test_what_code_says_is_cut(folder, name):
    with (
        Cage(folder, plain=True) as cage,
        pytest.raises(EstimatorError) as told,
        cage.case(f"spy.py:{name}", STEP),
    ):
        pass
    assert 1000 < len(str(told.value)) < 3000
