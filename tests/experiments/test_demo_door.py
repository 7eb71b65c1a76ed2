"""The server of the demo, driven over real sockets: who comes in, and what they may say."""

import logging
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from collections import deque
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from types import SimpleNamespace

import pytest
import viser
from msgspec import msgpack
from viser.infra import _infra
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from flexaxis.experiments.cli import main
from flexaxis.experiments.demo import door
from flexaxis.experiments.demo import page as pages
from flexaxis.experiments.demo.door import DemoServer, listen
from flexaxis.experiments.demo.page import Page
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.sim.errors import FlexaxisError

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
    """The demo as it is served, but with a clock that stands."""
    server, session = DemoServer(free_port()), DemoSession(estimators=PAPER)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # viser's, of an older name
        page = Page(server, session, exaggerate=100.0, speed=1.0)
    uuids = {label: uuid for uuid, (label, _) in server.check._offered.items()}
    yield SimpleNamespace(
        token=server.token, server=server.viser, session=session, page=page, uuids=uuids
    )
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


@pytest.mark.parametrize("path", [b"/\xff/", b"/%s\xe9/", b"/\xed\xb3\xbf"])
def test_a_token_that_is_no_text_is_a_wrong_one(demo, path):
    """Not an error of ours: nothing may be learnt of what is done with it."""
    token = demo.token
    path = path.replace(b"%s", token.secret[:-1].encode())
    with socket.create_connection(("127.0.0.1", token.port)) as raw:
        raw.sendall(b"GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n" % (path, token.port))
        assert raw.recv(100).startswith(b"HTTP/1.1 403")


def test_two_hosts_are_none(demo):
    token = demo.token
    with socket.create_connection(("127.0.0.1", token.port)) as raw:
        own = f"127.0.0.1:{token.port}"
        raw.sendall(f"GET /{token.secret}/ HTTP/1.1\r\nHost: {own}\r\nHost: evil\r\n\r\n".encode())
        assert raw.recv(100).startswith(b"HTTP/1.1 403")


def test_a_viser_that_starts_its_server_in_another_way_is_not_served(monkeypatch):
    """A newer one may hold its own reference to what we stand in front of."""
    own = SimpleNamespace(**vars(_infra.websockets))
    own.asyncio = SimpleNamespace(
        server=SimpleNamespace(serve=_infra.websockets.asyncio.server.serve)
    )
    monkeypatch.setattr(_infra, "websockets", own)
    monkeypatch.setattr(viser.ViserServer, "__init__", lambda self, **_: None)
    monkeypatch.setattr(viser.ViserServer, "stop", lambda self: None)
    monkeypatch.setattr(door, "_let_threads_draw", lambda _: None)
    with pytest.raises(FlexaxisError, match="that the demo does not know"):
        DemoServer(free_port())


LAST = "f_c [N m]"  # does nothing and says nothing while there is no dry friction


def say(demo, *messages):
    """Say something over a websocket, and wait until it was heard: what comes last is offered."""
    address = demo.token.address.replace("http", "ws", 1)
    last = demo.server.gui._gui_input_handle_from_uuid[demo.uuids[LAST]]
    last.value = 0.0
    with connect(address, subprotocols=[WORD], proxy=None, max_size=None) as viewer:
        for message in (CAMERA, *messages, update(demo, LAST, 0.3)):
            viewer.send(msgpack.encode(message))
        assert until(lambda: last.value == 0.3), "not heard"


def until(holds, patience=60.0):
    """Wait for it, and return whether it came to be so."""
    end = time.monotonic() + patience
    while not (found := holds()) and time.monotonic() < end:
        time.sleep(0.01)
    return found


WORD = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [3.0, 3.0, 3.0],
    "image_height": 100,
    "image_width": 100,
    "fov": 1.3,
    "near": 0.01,
    "far": 1000,
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}


def update(demo, label, value, key="value"):
    return {"type": "GuiUpdateMessage", "uuid": demo.uuids[label], "updates": {key: value}}


def stands(demo):
    """What a viewer could have changed."""
    handles = demo.server.gui._gui_input_handle_from_uuid
    values = {
        uuid: (handle.value, handle._impl.removed, len(handle._impl.update_cb))
        for uuid, handle in handles.items()
        if uuid != demo.uuids[LAST]
    }
    racers = [(racer.text, racer.tuning) for racer in demo.session.racers]
    return values, racers, demo.page.pace.speed, dict(demo.session.factors)


def test_text_of_a_viewer_is_never_run(demo, tmp_path):
    """The exploit: a list's value that names a program, a file, a module."""
    code = tmp_path / "evil.py"
    code.write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\nclass Mine: pass\n")
    before = stands(demo)
    program = f"pipe:touch {tmp_path / 'ran'}"
    texts = [program, f"{code}:Mine", "os:system", "ekf[walk=0.1]", "nobody", "", 5, None, ["ekf"]]
    say(demo, *(update(demo, "estimator", text) for text in texts))
    assert stands(demo) == before
    assert os.listdir(tmp_path) == ["evil.py"]
    assert demo.session.said == "refused: estimator: only what is in the list can be chosen"


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, -math.inf, 1e7, -1.0, "1", True, None, [1.0]]
)
@pytest.mark.parametrize("label", ["speed ×", "λ", "log₁₀ Δ f_m", "μ", "f_s [N m]", "v_s [rad/s]"])
def test_numbers_that_were_not_offered_are_refused(demo, label, value):
    value = -100.0 if label.startswith("log") and value == -1.0 else value
    before = stands(demo)
    say(demo, update(demo, label, value))
    assert stands(demo) == before
    assert demo.session.said.startswith(f"refused: {label}: give a number from")


@pytest.mark.parametrize("label", ["break it", "clock", "save", "friction"])
@pytest.mark.parametrize("value", ["J_a × 9", "pipe:id", "../x.csv", "", None, 1, True, ["Run"]])
def test_words_that_were_not_offered_are_refused(demo, label, value):
    before = stands(demo), demo.page.pace.paused, len(demo.session.history.entries)
    say(demo, update(demo, label, value))
    assert (stands(demo), demo.page.pace.paused, len(demo.session.history.entries)) == before
    assert demo.session.said == f"refused: {label}: only what is in the list can be chosen"


def test_a_row_of_buttons_is_heard_in_order(demo):
    """Though both clicks are there before the first is answered."""
    demo.session.repair()
    say(demo, update(demo, "break it", "worn gear f_m × 2"), update(demo, "clock", "Pause"))
    say(demo, update(demo, "break it", "payload J_a × 1.25"), update(demo, "clock", "Step 0.1 s"))
    expected = {"f_m": 2.0, "J_a": 1.25}, True, 1
    pace = demo.page.pace

    def found():
        return dict(demo.session.factors), pace.paused, pace.steps

    until(lambda: found() == expected)
    assert found() == expected
    assert demo.page.stepped() == 20 and demo.page.stepped() == 0
    demo.session.repair()
    pace.paused = False


def test_we_do_not_touch_what_the_loop_of_viser_goes_through(demo):
    """Else the demo ends now and then when a viewer comes: "deque mutated during iteration"."""
    buffer = demo.server._websock_server._broadcast_buffer
    home = []
    buffer.event_loop.call_soon_threadsafe(lambda: home.append(threading.get_ident()))

    class OwnThread(deque):
        def __iter__(self):
            assert threading.get_ident() in home, "by a thread that is not the loop's"
            return super().__iter__()

    event = buffer.message_event
    event._waiters = OwnThread(event._waiters)
    for _ in range(20):
        event._value = False
        demo.page.draw_axis()
        demo.page.pace.frames += 1.0
        demo.page.draw_curves()
    demo.page.pace.frames = 0.0


def test_what_is_offered_is_taken(demo):
    say(demo, update(demo, "speed ×", 2.5), update(demo, "excitation", "off"))

    def found():
        return demo.page.pace.speed, demo.session.axis.excitation

    until(lambda: found() == (2.5, "off"))  # viser runs what follows in a pool of threads
    assert found() == (2.5, "off")


def test_other_properties_and_messages_are_not_heard(demo):
    before = stands(demo)
    buffer = demo.server._websock_server._broadcast_buffer.message_from_id
    held = len(buffer)
    say(
        demo,
        update(demo, "speed ×", True, key="removed"),
        update(demo, "speed ×", [], key="update_cb"),
        {
            "type": "GuiUpdateMessage",
            "uuid": demo.uuids["μ"],
            "updates": {"value": demo.session.racers[1].tuning.regularization, "removed": True},
        },
        {"type": "GuiUpdateMessage", "uuid": demo.uuids["λ"], "updates": {}},
        {"type": "GuiUpdateMessage", "uuid": ["λ"], "updates": {"value": 1}},
        {"type": "ShareUrlRequest"},
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        CAMERA | {"position": [math.nan, 0.0, 0.0]},
        CAMERA | {"position": [0.0] * 5000},
        *({"type": "GuiFormDirtyMessage", "uuid": f"{n}", "dirty": True} for n in range(50)),
        [],
        "GuiUpdateMessage",
        {"type": {}},
    )
    assert stands(demo) == before
    assert len(buffer) == held, "each would be kept for viewers to come"
    assert demo.session.said == "refused: nothing that was offered"


def test_uploads_are_not_kept(demo):
    target = demo.uuids["break it"]
    start = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": target,
        "transfer_uuid": "t",
        "filename": "f",
        "mime_type": "",
        "part_count": 1000,
        "size_bytes": 10**9,
    }
    part = {
        "type": "FileTransferPart",
        "source_component_uuid": target,
        "transfer_uuid": "t",
        "part_index": 0,
        "content": bytes(50_000),
    }
    held = []
    forget = demo.server.gui._drop_uploads_from_client
    demo.server.gui._drop_uploads_from_client = lambda client: held.append(
        dict(demo.server.gui._current_file_upload_states)
    )
    try:
        say(demo, start, part, part | {"part_index": 1})
        assert until(lambda: held)
    finally:
        demo.server.gui._drop_uploads_from_client = forget
    assert not any(held)  # once or twice: who comes again meanwhile is cut off again


def opened(demo, buffer):
    """A viewer on a bare socket, who has said that he looks."""
    token = demo.token
    viewer = socket.socket()
    viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    viewer.connect(("127.0.0.1", token.port))
    lines = [f"GET /{token.secret}/ HTTP/1.1", f"Host: 127.0.0.1:{token.port}"]
    lines += [f"{key}: {value}" for key, value in UPGRADE.items()]
    lines += [f"Sec-WebSocket-Protocol: {WORD}", "", ""]
    viewer.sendall("\r\n".join(lines).encode())
    camera = msgpack.encode(CAMERA)
    viewer.sendall(b"\x82" + bytes([0x80 | 126]) + len(camera).to_bytes(2) + bytes(4) + camera)
    return viewer


def test_who_does_not_read_does_not_fill_the_memory(demo):
    """Every ping is answered, and the answers wait: half a gigabyte in twenty seconds."""
    pings = 1000 * (b"\x89" + bytes([0x80 | 125]) + bytes(4) + 125 * b"p")
    sent, most = 0, 8 * door.MOST_UNREAD
    with opened(demo, 2048) as deaf, pytest.raises(ConnectionError):
        while sent < most:
            deaf.sendall(pings)
            sent += len(pings)


def test_a_file_a_second_is_enough(demo, monkeypatch):
    """Those of a viewer who does not read them would wait in memory, all of them."""
    monkeypatch.setattr(pages, "NEXT_SAVE", 1e6)  # the clock of a busy machine says nothing
    sent = []
    monkeypatch.setattr(viser.ClientHandle, "send_file_download", lambda *args, **_: sent.append(1))
    say(demo, *(20 * [update(demo, "save", "Table (CSV)")]))
    assert len(sent) == 1
    say(demo, update(demo, "save", "Lesson (TOML)"))  # another viewer has his own
    assert len(sent) == 2


def test_a_large_message_ends_the_connection(demo):
    address = demo.token.address.replace("http", "ws", 1)
    with connect(address, subprotocols=[WORD], proxy=None, max_size=None) as viewer:
        with pytest.raises(ConnectionClosed):
            viewer.send(bytes(100_000))
            while True:
                viewer.recv(timeout=20)
        assert viewer.close_code == 1009


@contextmanager
def bare_log():
    """A log that is printed, as a library may have set up, and that pytest does not keep."""
    names = (None, "flexaxis.demo", "websockets.server")
    held = {logger: logger.handlers for logger in map(logging.getLogger, names)}
    for logger, handlers in held.items():
        logger.handlers = [h for h in handlers if not type(h).__module__.startswith("_pytest")]
    logging.getLogger().addHandler(logging.StreamHandler())
    try:
        yield
    finally:
        for logger, handlers in held.items():
            logger.handlers = handlers


@bare_log()
def test_idle_connections_print_nothing_and_leave_room(demo, capfd):
    """No more are held than MOST_VIEWERS, so that files do not run out."""
    most = 300 - door.MOST_VIEWERS
    idle = [socket.create_connection(("127.0.0.1", demo.token.port)) for _ in range(300)]

    def cut(viewer, patience=0.0):
        viewer.settimeout(patience)
        try:
            return viewer.recv(1) == b""
        except BlockingIOError:
            return False
        except ConnectionError:
            return True

    try:
        # The last that the server meets. Where nothing limits them, websockets cuts all after 10 s.
        assert cut(idle[-1], 30.0)
        assert most <= sum(map(cut, idle)) <= most + 20  # viewers of the tests before may be there
    finally:
        for each in idle:
            each.close()

    def answers():
        with suppress(ConnectionError):
            return status(demo, f"/{demo.token.secret}/", {}) == 200

    assert until(answers, 5.0)  # sooner than websockets gives them up
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("port", ["99999", "0", "-1"])
def test_a_port_that_is_none(port, capsys):
    assert main(["demo", "--no-browser", "--port", port]) == 2
    assert f"--port {port}: give a number from 1 to 65535" in capsys.readouterr().err


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


COMPILES = """
import hashlib
from flexaxis.experiments import cli
from flexaxis.experiments.demo.page import Page
Page.end = lambda self: print("told", flush=True)
Page.advance = lambda self, count: hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
cli.main(["demo", "--no-browser", *2 * ["--estimator", "frozen"], "--port", "{port}"])
"""


def test_ctrl_c_does_not_wait_for_what_runs_outside_of_python():
    """As a compiler does, for seconds, when the demo is first started; here it is a minute.

    The pages are told all the same.
    """
    line = [sys.executable, "-u", "-c", COMPILES.format(port=free_port())]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            assert b"the live axis is at" in process.stdout.readline()
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
            assert process.stdout.read() == b"told\n"
        finally:
            process.kill()


@pytest.mark.slow
def test_ctrl_c_does_not_wait_for_viewers_who_do_not_read():
    """Nor for one who has not said yet what he wants."""
    command = [sys.executable, "-u", "-m", "flexaxis.experiments.cli", "demo", "--no-browser"]
    started = time.monotonic()
    process = subprocess.Popen(
        [*command, "--port", str(free_port())], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        address = process.stdout.readline().decode().split("at ")[1].split()[0]
        started = time.monotonic() - started
        host = address.split("/")[2]
        mute = socket.create_connection(("127.0.0.1", int(host.split(":")[1])))
        deaf = socket.socket()
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        deaf.connect(("127.0.0.1", int(host.split(":")[1])))
        path = address.partition(host)[2]
        lines = [f"GET {path} HTTP/1.1", f"Host: {host}"]
        lines += [f"{key}: {value}" for key, value in UPGRADE.items()]
        lines += [f"Sec-WebSocket-Protocol: {WORD}", "", ""]
        deaf.sendall("\r\n".join(lines).encode())
        camera = msgpack.encode(CAMERA)
        deaf.sendall(b"\x82" + bytes([0x80 | 126]) + len(camera).to_bytes(2) + bytes(4) + camera)
        time.sleep(4)  # at 30 pictures a second more than its buffers hold
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        # 0.4 s on a quiet machine, where the start takes 4 s; viser alone waits 6 s, by a clock.
        assert time.monotonic() - begin < max(5.5, started)
        mute.close()
        deaf.close()
    finally:
        process.kill()
        process.communicate()
