"""A page of another origin, in a real browser, cannot reach the demo; the owner's page can."""

import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
import viser

from tests.browser.test_page import demo

pytestmark = pytest.mark.browser

# The exploit: a websocket to the demo, and on it a value that names a program. The page is even
# given the token. `window.said` gets what came of each attempt.
EXPLOIT = """
window.said = [];
for (const address of ADDRESSES) {
  const socket = new WebSocket(address, "WORD");
  socket.onopen = () => window.said.push("open");
  socket.onerror = () => window.said.push("refused");
}
for (const address of ADDRESSES) {
  fetch(address.replace("ws", "http"), {mode: "cors"})
    .then(() => window.said.push("read")).catch(() => window.said.push("refused"));
}
"""


def exploit(address):
    bare = re.match(r"http://[^/]+/", address)[0]
    addresses = [a.replace("http", "ws", 1) for a in (bare, address)]
    text = EXPLOIT.replace("WORD", f"viser-v{viser.__version__}")
    return text.replace("ADDRESSES", repr(addresses))


@pytest.fixture(scope="module")
def address():
    """That of a demo."""
    with demo() as address:
        yield address


@pytest.fixture
def elsewhere():
    """Serve an empty page from another port, which is another origin."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<html><body>elsewhere</body></html>")

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def attempts(browser, address):
    browser.run(exploit(address))
    browser.wait("window.said.length == 4", seconds=30, what="the end of the attempts")
    return sorted(browser.run("window.said"))


def test_a_page_of_another_origin_is_refused(browser, address, elsewhere):
    browser.open(elsewhere)
    browser.wait("document.body?.innerText == 'elsewhere'", seconds=30, what="the page")
    assert attempts(browser, address) == 4 * ["refused"]


def test_the_same_from_its_own_page_is_let_in(browser, address):
    """The attempts above fail for who makes them: with the token both ways are open."""
    browser.open(address)
    browser.wait("document.body?.innerText.includes('f_m × 2')", seconds=60, what="the page")
    assert attempts(browser, address) == ["open", "read", "read", "refused"]


def test_a_name_that_somebody_points_here_is_refused(browser, address):
    """DNS rebinding: the browser takes it for one origin, the one of the attacker."""
    browser.open(re.sub(r"//[^:]+:", "//rebound.test:", address))
    text = "document.body?.innerText.trim()"
    said = "refused: this is not the address of the demo"
    browser.wait(f"{text} == {said!r}", seconds=30, what=said)
