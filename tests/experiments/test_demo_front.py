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
from flexaxis.experiments.reporting.charts_old.drawing import drawn
from flexaxis.experiments.reporting.charts_old.figures import draw
from flexaxis.sim.timing import PERIOD
from tests.experiments.page_data import charts_of


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


def reachable(address, port):
    try:
        socket.create_connection((address, port), timeout=2).close()
    except OSError:
        return False
    return True


@pytest.mark.parametrize(
    "kind", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM]
)
def test_signals_end_it_with_status_0(started, free_port, kind):
    process, (line,) = started()
    assert f"http://127.0.0.1:{free_port}" in line
    process.send_signal(kind)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "", "")


@pytest.mark.slow
def test_it_is_seen_on_this_computer_only(started, free_port):
    """127.0.0.2 is this computer by another name: only a server for everybody answers there."""
    if sys.platform != "linux":
        pytest.skip("only Linux has all of 127.0.0.0/8")
    started()
    assert reachable("127.0.0.1", free_port) and not reachable("127.0.0.2", free_port)


def test_a_tunnel_to_the_outside_is_never_opened(free_port, monkeypatch):
    """The page of viser can ask for one; ours does not hear it."""
    import viser

    from flexaxis.experiments.demo.door import DemoServer

    asked = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_: asked.append(1))
    server = DemoServer(free_port)
    server.viser.request_share_url()
    server.stop()
    assert not asked


def test_curves_show_what_the_session_has_and_a_recording_the_same():
    """One description: what the page draws is what matplotlib draws."""
    session = DemoSession()
    session.advance(2000)
    session.inject("f_m", 2.0)
    session.advance(600)
    known = session.curves()
    chart = curves.estimates(known)
    ((view,),) = charts_of(str(drawn(chart, "x", high=86))).values()
    assert [p["y"][:3] for p in view["panels"]] == ["k_T", "1/J", "f_m", "dia"]
    panel = view["panels"][2]
    for racer, who in enumerate("AB"):
        (line,) = [n for n in panel["lines"] if n["who"] == who]
        exact = np.clip(known.theta[:, racer, 2], panel["low"], panel["high"])
        off = np.interp(known.time, line["x"], line["y"]) - exact
        assert abs(off[known.time > view["from"]]).max() < 0.012 * (panel["high"] - panel["low"])
    ax = Figure().subplots()
    (drawn_line,) = [n for n in draw(chart, ax, panel=2).lines if n.get_label() == "A"]
    np.testing.assert_array_equal(drawn_line.get_ydata(), known.theta[:, 0, 2])
    left = curves.left(session.history.last)
    assert left.title == "f_m × 2: left to be found" and len(left.panels[0].lines) == 3
    session.inject("f_m", 1.5)  # ends what was scored
    points = curves.tradeoff(session.points, (0.02, 0.03))
    assert [line.who for line in points.panels[0].lines] == ["", "A f_m", "B f_m"]
    assert points.panels[0].title == "■ k_T, ▲ 1/J_a, ● f_m"
    dots = draw(points, Figure().subplots(), looks=curves.STYLES).containers
    looks = [(dot[0].get_color(), dot[0].get_marker()) for dot in dots]
    assert looks == [(curves.COLOURS[0], "o"), (curves.COLOURS[1], "o")]


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


def test_looking_into_the_bank_changes_nothing():
    watched, plain = (DemoSession(estimators=["frozen", "glr"], seed=3) for _ in range(2))
    plain.racers[1].thoughts = [{}] * 10**6
    for session in (watched, plain):
        session.advance(600)
    np.testing.assert_array_equal(watched.racers[1].theta, plain.racers[1].theta)
