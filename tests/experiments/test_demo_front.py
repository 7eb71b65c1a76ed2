"""The page without a browser: addresses, signals, and what is said where viser is absent."""

import signal
import socket
import subprocess
import sys

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.demo.charts import Charts
from flexaxis.experiments.demo.racer import SHOWN


def test_without_viser_one_clear_line(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mjviser", None)
    assert main(["demo", "--no-browser"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'flexaxis[demo]'" in line


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


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_with_status_0(started, free_port, kind):
    process, (line,) = started()
    assert f"http://127.0.0.1:{free_port}" in line
    process.send_signal(kind)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "", "")


def test_shared_only_if_asked_and_then_it_says_what(started, free_port):
    """127.0.0.2 is this computer by another name: only a server for everybody answers there."""
    if sys.platform != "linux":
        pytest.skip("only Linux has all of 127.0.0.0/8")
    process, _ = started()
    assert not reachable("127.0.0.2", free_port)
    process.terminate()
    process.communicate(timeout=30)
    _, (_, warning) = started("--share", lines=2)
    assert "whoever reaches this computer" in warning and "no password" in warning
    assert reachable("127.0.0.2", free_port)


def test_a_tunnel_to_the_outside_is_never_opened(free_port, monkeypatch):
    """The page of viser can ask for one; ours does not hear it."""
    import viser

    from flexaxis.experiments.demo.serve import make_server

    asked = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_: asked.append(1))
    server = make_server(free_port, "127.0.0.1")
    server.request_share_url()
    server.stop()
    assert not asked


class Charted:
    """What is put on a page, by title."""

    def __init__(self):
        self.charts = {}

    def add_uplot(self, *, title, **look):
        self.charts[title.split()[0]] = look


def test_ticks_are_told_apart_by_three_decimals():
    """The browser writes no more: 0.0505 would be 0.051, beside 0.051."""
    pytest.importorskip("viser")
    page, nominal = Charted(), (1.0, 1.25, 0.05, 0.1)
    Charts(page, np.array(nominal))
    for name, size in zip(SHOWN, nominal, strict=True):
        ticks = page.charts[name]["axes"][1]["incrs"]
        assert all(round(tick, 3) == tick > 0 for tick in ticks)
        if name != "f_c":  # so that two ticks at least are seen, whatever the noise
            edges = page.charts[name]["scales"]["y"]["range"]
            span = edges["max"]["soft"] - edges["min"]["soft"]
            assert edges["min"]["soft"] < size < edges["max"]["soft"] and span >= 2 * min(ticks)
