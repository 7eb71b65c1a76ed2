"""The server of the demo, driven over real sockets: it answers its own page and no other."""

import socket
from http.client import HTTPConnection

import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.demo import door
from flexaxis.experiments.demo.door import DemoServer, listen

PAPER = ("rpem-forgetting", "rpem-drift")  # every knob, and little to compile
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def demo():
    """The server of the demo, without a page."""
    server = DemoServer(free_port())
    yield server
    server.stop()


def status(demo, path, headers):
    connection = HTTPConnection("127.0.0.1", demo.token.port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse().status
    connection.close()
    return answer


# What a request says of itself; {own} is host and port of the demo, {port} its port.
STRANGERS = {
    "no token": ("/", {}),
    "no token, but a query": ("/?{token}", {}),
    "wrong token": ("/" + 43 * "A" + "/", {}),
    "half a token": ("/{half}/", {}),
    "name of another (DNS rebinding)": ("/{token}/", {"Host": "evil.example:{port}"}),
    "its own port at another name": ("/{token}/", {"Host": "127.0.0.1.evil.example:{port}"}),
    "another port": ("/{token}/", {"Host": "127.0.0.1:1"}),
    "page of another origin": ("/{token}/", {"Origin": "http://evil.example"}),
    "page of this computer, of another port": ("/{token}/", {"Origin": "http://127.0.0.1:1"}),
    "page without an origin": ("/{token}/", {"Origin": "null"}),
    "the same by another protocol": ("/{token}/", {"Origin": "https://{own}"}),
}


@pytest.mark.parametrize("upgrade", [{}, UPGRADE], ids=["page", "websocket"])
@pytest.mark.parametrize("stranger", STRANGERS)
def test_strangers_stay_outside(demo, stranger, upgrade):
    token = demo.token
    words = {"token": token.secret, "half": token.secret[:20], "port": token.port}
    words["own"] = f"127.0.0.1:{token.port}"
    path, headers = STRANGERS[stranger]
    headers = {key: value.format(**words) for key, value in headers.items()}
    assert status(demo, path.format(**words), upgrade | headers) == 403


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LOCALHOST"])
def test_the_owner_comes_in(demo, name):
    token = demo.token
    headers = {"Host": f"{name}:{token.port}", "Origin": f"http://{name}:{token.port}"}
    for path in (f"/{token.secret}/", f"/{token.secret}/?websocket=x", f"/{token.secret}"):
        assert status(demo, path, headers) == 200
        assert status(demo, path, headers | UPGRADE) == 101
    assert status(demo, f"/{token.secret}/nothing.js", headers) == 404


def test_a_taken_port_is_said(monkeypatch, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["demo", "--no-browser", "--port", str(port)]) == 2
        assert f"--port {port} cannot be had" in capsys.readouterr().err
        monkeypatch.setattr(door, "PORT", port)
        said = []
        with listen(None, said.append) as found:
            other = found.getsockname()[1]
        assert other > port
        assert said == [f"port {port} is taken; the next that is free is {other}"]
