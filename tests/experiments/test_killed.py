"""A run that is killed goes on where it stopped: every row is there once, and the same."""

import os
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from flexaxis.experiments.cli import main
from tests.experiments.kept_rows import scores_of

SEEDS = 8


def _rows(folder):
    try:
        return scores_of(folder)
    except sqlite3.OperationalError:  # the file has only just been made
        return {}


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_killed_run_is_resumed(short_toml, tmp_path):
    words = ["run", str(short_toml), "--estimator", "rpem-forgetting", "--seeds", str(SEEDS)]
    words += ["--jobs", "1", "-o"]
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    command = [sys.executable, "-m", "flexaxis.experiments", *words, str(killed)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while not (before := _rows(killed)):
            assert process.poll() is None, "the run ended before it could be killed"
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
    after = _rows(killed)
    assert before.items() <= after.items() and len(after) < 3 * SEEDS
    assert main([*words, str(killed)]) == 0
    assert main([*words, str(whole)]) == 0
    assert scores_of(killed) == scores_of(whole)
    assert len(scores_of(killed)) == 3 * SEEDS
