"""The page without a browser: addresses, signals, and what is said where viser is absent."""

import signal
import socket
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

from flexaxis.experiments.cli import main
from flexaxis.experiments.demo import curves
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.experiments.reporting.charts_old.figures import draw
from flexaxis.sim.timing import PERIOD


def test_without_viser_one_clear_line(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mjviser", None)
    assert main(["demo", "--no-browser"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install -e '.[demo]'" in line


@pytest.fixture
def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def started(free_port):
    """Start the demo with some words, and return the process and the lines that it printed."""
    processes = []

    def start(*words, lines=1):
        command = [sys.executable, "-u", "-m", "flexaxis.experiments.cli", "demo", "--no-browser"]
        process = subprocess.Popen(
            [*command, "--port", str(free_port), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process, [process.stdout.readline() for _ in range(lines)]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    "kind", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM]
)
def test_signals_end_it_with_status_0(started, free_port, kind):
    process, (line,) = started()
    assert f"http://127.0.0.1:{free_port}" in line
    process.send_signal(kind)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "", "")


def test_the_bank_of_hypotheses_is_seen_at_work():
    """In every sample after a change: what has jumped, and when; found, and empty again."""
    session = DemoSession(estimators=["frozen", "glr"])
    session.advance(2000)
    session.inject("f_m", 1.5)
    session.advance(400)
    assert not session.racers[0].thoughts and len(session.racers[1].thoughts) == 400
    chart = curves.OWN["glr"](session.racers[1])
    what, when = ({line.who: line.y for line in panel.lines} for panel in chart.panels)
    (at, words), *_ = chart.marks
    before = round(at / PERIOD) - 2
    assert words.startswith("found: f_m × 1.5") and 0 < at < 1
    assert what["f_m"][before] > 50 > sum(what[name][before] for name in what if name != "f_m")
    assert abs(when["f_m"][before]) < 0.1  # when it began, after the change
    assert what["f_m"][before + 20] < 1  # what is found has been taken: the bank begins anew
    session.repair()
    assert not session.racers[1].thoughts


def test_a_recording_draws_what_the_session_has():
    session = DemoSession(estimators=("rpem-forgetting", "rpem-drift"))
    session.advance(400)
    known = session.curves()
    lines = draw(curves.estimates(known), Figure().subplots(), panel=2).lines
    (line,) = [n for n in lines if n.get_label() == "A"]
    np.testing.assert_array_equal(line.get_ydata(), known.theta[:, 0, 2])
