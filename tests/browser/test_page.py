"""The demo in a real browser: it loads, asks nobody outside, and a click moves the curve.

A page of another origin cannot reach it; the owner's page can.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
import viser
from PIL import Image

pytestmark = pytest.mark.browser

PICTURES = Path(__file__).parents[2] / "results" / "browser"

# The number in a column of the table of estimates: 1 truth, 2 estimator A, 3 estimator B.
CELL = """[...document.querySelectorAll("tr")]
  .filter(row => row.cells[0]?.innerText.trim() == "{name}")
  .map(row => parseFloat(row.cells[{column}].innerText))[0]"""
# What is drawn of a racer under a title, in one panel: how wide, and how far it rises.
DRAWN = """(() => {{
  const heads = [...document.querySelectorAll("h4.chart")];
  const head = heads.find(e => e.innerText.includes("{title}"));
  const panel = [...head?.nextElementSibling?.querySelectorAll("svg.panel") ?? []].find(
    e => e.dataset.y.startsWith("{panel}"));
  const lines = [...panel?.querySelectorAll(".area .line") ?? []];
  const line = lines.find(e => e.dataset.said == "{who}");
  const d = line?.querySelector(".curve")?.getAttribute("d");
  if (!d) return {{wide: 0, rise: 0}};
  const steps = [...d.matchAll(/l-?\\d+,(-?\\d+)/g)].map(hit => Number(hit[1]));
  const {{width}} = line.getBoundingClientRect();
  return {{wide: width, rise: -steps.reduce((a, b) => a + b, 0) / 10000}};
}})().{what}"""
CLOCK = "parseFloat(document.body.innerText.match(/t = ([\\d.]+) s/)?.[1])"
READY = "document.querySelectorAll('h4.chart + figure svg.panel').length >= 5"
FAULT = "f_m × 2: left to be found"


def drawn(title, who, what="wide", panel=""):
    """A script for how wide a curve is drawn in a chart, or how far it rises."""
    return DRAWN.format(title=title, who=who, panel=panel, what=what)


def says(text):
    return f"document.body?.innerText.includes({text!r})"


@contextmanager
def demo(*words, code="from flexaxis.experiments.cli import main; sys.exit(main())"):
    """The demo in a process of its own, and its address; ended by SIGTERM, with status 0."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-c", f"import sys; {code}", "demo", "--no-browser", "--port", port]
    process = subprocess.Popen(
        [str(word) for word in (*command, *words)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        yield re.search(r"http://\S+", process.stdout.readline())[0]
    finally:
        process.send_signal(signal.SIGTERM)
        process.stdout.read()
        process.stdout.close()
        status = process.wait(60)
    assert status == 0


@pytest.fixture(scope="module")
def address():
    """That of a demo at twice real time, for all tests of a module."""
    with demo("--speed", "2") as address:
        yield address


def opened(browser, address):
    """Open the page of a demo where no fault acts."""
    browser.open(address)
    browser.wait(READY, seconds=60, what="charts")
    browser.wait(f"{CLOCK} > 8", seconds=60, what="the clock")
    browser.click("Repair", "button")
    browser.wait(says("s: repaired"), seconds=30, what="repaired")
    quiet = browser.run(CLOCK) + 3  # s from which on a fault is one after a quiet time
    browser.wait(f"{CLOCK} > {quiet}", seconds=60, what="a quiet time")


def shown(browser):
    """Wait until what came of a fault is drawn of both, beside what theory allows."""
    for who in ("A", "B", "theory allows"):
        browser.wait(f"{drawn(FAULT, who)} > 100", seconds=30, what=f"line {who}")


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (390, 844)])
def test_a_click_moves_the_curve_and_is_seen_without_scrolling(browser, address, width, height):
    """Button, chart of what is left, and lags; both estimators follow. Nobody else is asked."""
    browser.size(width, height, mobile=width < 600)
    opened(browser, address)
    cell = CELL.format
    browser.wait(f"{cell(name='f_m', column=1)} == 0.05", seconds=5, what="f_m at nominal")
    assert browser.run(drawn(FAULT, "A")) == 0
    browser.click("f_m × 2", "button")
    shown(browser)
    for text, kind in (("f_m × 2", "button"), (FAULT, "h4"), ("lag", "tr")):
        at = browser.place(text, kind, scroll=False)
        assert at["top"] >= 0 and at["left"] >= 0, text
        assert at["bottom"] <= height and at["right"] <= width + 1, text
    for column in (1, 2, 3):
        followed = f"Math.abs({cell(name='f_m', column=column)} / 0.1 - 1) < 0.06"
        browser.wait(followed, seconds=60, what=f"column {column} of f_m at 0.1")
    risen = f"{drawn('Estimates', 'A', 'rise', 'f_m [')} > 0.3"  # while it is in the window
    browser.wait(risen, seconds=30, what="the line risen")
    PICTURES.mkdir(parents=True, exist_ok=True)
    browser.screenshot(PICTURES / f"first_fault_{width}.png")
    assert browser.run("document.documentElement.scrollWidth") <= width and not browser.errors
    ours = re.compile(rf"{address}|data:|blob:|ws://127")
    assert len(browser.requests) > 1 and all(map(ours.match, browser.requests))
    if width < 600:
        phone_shows_all(browser, width)
        axis_is_drawn(browser, address, PICTURES / "first_fault_phone.png")


def axis_is_drawn(browser, address, picture):
    """Above the controls of a phone."""
    assert coloured(browser, picture) < 400
    browser.draw(address)
    canvas = "document.querySelector('canvas[data-engine]') !== null"
    browser.wait(canvas, seconds=60, what="the page, drawn")
    end = time.monotonic() + 60
    while coloured(browser, picture) < 400:
        assert time.monotonic() < end, "no gear and no arm"


def coloured(browser, picture):
    """How many pixels of the canvas are no grey: sky and grid are, gear and arm are not."""
    # What the page says of a computer without a graphics card would lie over the axis.
    browser.run("document.querySelectorAll('.mantine-Notification-root').forEach(e => e.remove())")
    browser.screenshot(picture)
    script = "(({left, top, right, bottom}) => [left, top, right, bottom])"
    box = browser.run(
        f"{script}(document.querySelector('canvas[data-engine]').getBoundingClientRect())"
    )
    with Image.open(picture) as shot:
        there = np.asarray(shot.convert("RGB").crop([int(x) for x in box])).astype(int)
    return (np.ptp(there, axis=2) > 40).sum()


def phone_shows_all(browser, width):
    """The controls are as wide as the page, with the wide table open too."""
    browser.click("What was done")  # unfolds
    time.sleep(1.0)
    browser.click("What was done")
    table = "document.querySelector('table.history')?.getClientRects().length > 0"
    browser.wait(table, seconds=20, what="the table")
    for text in ("f_m × 2", "Repair", "Step"):
        assert browser.place(text, "button", scroll=False)["right"] <= width, text


def test_two_viewers_see_the_same_and_who_reloads_where_it_is(browser, address, tmp_path):
    """Also in the middle of a fault, and beside another page that was closed then."""
    with type(browser)(tmp_path / "second") as other:
        other.open(address)
        opened(browser, address)
        other.wait(says("s: repaired"), seconds=60, what="repaired on both pages")
        browser.click("f_m × 2", "button")
        browser.open("about:blank")
        shown(other)
    browser.open(address)
    shown(browser)
    browser.click("Pause", "button")
    browser.wait(says("paused"), seconds=10, what="the pause")
    browser.open("about:blank")
    browser.open(address)
    shown(browser)
    assert browser.run(says("paused")) and not browser.errors
    browser.click("Run", "button")


def test_an_act_that_fails_is_said_and_the_lesson_goes_on(browser, tmp_path):
    """And when the demo ends, the page says so, and has no buttons."""
    stubborn = (
        "from flexaxis.experiments.demo.session import DemoSession;"
        "exec('def inject(*_): raise RuntimeError(\"it does not break\")');"
        "DemoSession.inject = inject;"
        "from flexaxis.experiments.cli import main; sys.exit(main())"
    )
    lesson = tmp_path / "mine.toml"
    lesson.write_text('[[act]]\nat = 1.0\nfault = "f_m"\nfactor = 2.0\n', encoding="utf-8")
    with demo(lesson, code=stubborn) as address:
        browser.open(address)
        said = says("act[0] at 1 s cannot be done: it does not")
        browser.wait(said, seconds=60, what="what was wrong")
        browser.wait(f"{CLOCK} > 3", seconds=60, what="the lesson goes on")
    browser.wait(says("The demo has ended"), seconds=10, what="the end")
    gone = "[...document.querySelectorAll('button')].every(e => e.innerText != 'Run')"
    browser.wait(gone, seconds=5, what="no buttons")


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


def attempts(browser, address):
    bare = re.match(r"http://[^/]+/", address)[0]
    addresses = [a.replace("http", "ws", 1) for a in (bare, address)]
    text = EXPLOIT.replace("WORD", f"viser-v{viser.__version__}")
    browser.run(text.replace("ADDRESSES", repr(addresses)))
    browser.wait("window.said.length == 4", seconds=30, what="the end of the attempts")
    return sorted(browser.run("window.said"))


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


def test_a_page_of_another_origin_is_refused(browser, address, elsewhere):
    """And its own page is let in: with the token both ways are open, so that it is who asks."""
    browser.open(elsewhere)
    browser.wait("document.body?.innerText == 'elsewhere'", seconds=30, what="the page")
    assert attempts(browser, address) == 4 * ["refused"]
    browser.open(address)
    browser.wait(says("f_m × 2"), seconds=60, what="the page")
    assert attempts(browser, address) == ["open", "read", "read", "refused"]


def test_a_name_that_somebody_points_here_is_refused(browser, address):
    """DNS rebinding: the browser takes it for one origin, the one of the attacker."""
    browser.open(re.sub(r"//[^:]+:", "//rebound.test:", address))
    text = "document.body?.innerText.trim()"
    said = "refused: this is not the address of the demo"
    browser.wait(f"{text} == {said!r}", seconds=30, what=said)
