"""The fixtures in a user's own test suite."""

import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

TESTS = """
import pathlib
SHORT = str(pathlib.Path(__file__).with_name("short.toml"))

def test_same(flexaxis_gate):
    found = flexaxis_gate("rpem-drift", base="rpem-drift", names=[SHORT], seeds=2)
    assert found.verdict == "same"

def test_slower(flexaxis_gate):
    flexaxis_gate("rpem-forgetting[forgetting=0.999]", base="rpem-forgetting", names=[SHORT],
                  seeds=8, margins={"lag": 0.05})

def test_rules(flexaxis_check):
    flexaxis_check("frozen")

def test_broken(flexaxis_check):
    flexaxis_check("WRONG:Cheater")

def test_of_their_own():
    pass
"""


@pytest.fixture
def suite(tmp_path, short_toml):
    wrong = str(Path(__file__).with_name("wrong.py"))
    (tmp_path / "test_mine.py").write_text(TESTS.replace("WRONG", wrong))
    installed = {point.name for point in entry_points(group="pytest11")}
    plugin = [] if "flexaxis" in installed else ["-p", "flexaxis.experiments.conformance.plugin"]

    def run(*words):
        command = [sys.executable, "-m", "pytest", "-q", "-rs", *plugin, "test_mine.py", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.stdout + done.stderr

    return run


def test_skipped_unless_asked_for(suite):
    out = suite()
    assert "1 passed, 4 skipped" in out and "needs --flexaxis" in out


@pytest.mark.slow
def test_the_gate_and_the_rules_as_tests(suite):
    out = suite("--flexaxis")
    assert "2 failed, 3 passed" in out
    assert "lag worse" in out and "| short | lag f_m |" in out
    assert "no look-ahead: samples after" in out and "hint:" in out
