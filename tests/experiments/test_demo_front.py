"""The page without a browser: addresses, signals, and what is said where viser is absent."""

import signal
import socket
import subprocess
import sys

import pytest

from flexaxis.experiments.cli import main


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
