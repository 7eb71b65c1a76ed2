"""The demo in a real browser: a click moves the curves; a page of another origin gets nothing."""

import re
import signal
import socket
import subprocess
import sys
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
import viser

pytestmark = pytest.mark.browser

PICTURES = Path(__file__).parents[2] / "results" / "browser"
CELL = """[...document.querySelectorAll("table.demo tr")].filter(
  row => row.cells[0].innerText == "f_m").map(row => parseFloat(row.cells[{}].innerText))[0]"""
CLOCK = "parseFloat(document.body.innerText.match(/t = ([\\d.]+) s/)?.[1])"
# How many pixels of the plot with a title are coloured.
DRAWN = """(title => {{
  const plot = [...document.querySelectorAll(".u-title")].find(e => e.innerText == title);
  const canvas = plot?.parentElement.querySelector("canvas");
  if (!canvas?.width) return 0;
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < data.length; i += 4)
    count += data[i + 3] > 99 && Math.abs(data[i] - data[i + 2]) > 60;
  return count;
}})({!r})"""


@pytest.fixture
def address():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    words = ["demo", "--no-browser", "--port", port]
    command = [sys.executable, "-u", Path(sys.executable).with_name("flexaxis"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield re.search(r"http://\S+", process.stdout.readline())[0]
        process.send_signal(signal.SIGTERM)
    assert process.returncode == 0


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (390, 844)])
def test_a_click_moves_the_curves_and_both_estimators(browser, address, width, height):
    """The clock can be stopped and stepped. Nobody else is asked for anything."""
    browser.size(width, height)
    browser.open(address)
    browser.wait(f"{CELL.format(1)} == 0.05", "f_m at nominal")
    assert browser.run(DRAWN.format("error after the last change")) == 0
    browser.click("f_m × 2")
    for column in (1, 2, 3):
        browser.wait(f"Math.abs({CELL.format(column)} / 0.1 - 1) < 0.06", f"f_m in column {column}")
    browser.wait(f"{DRAWN.format('error after the last change')} > 100", "curves of the change")
    assert width < 600 or browser.run(DRAWN.format("f_m")) > 100
    browser.click("Pause")
    browser.wait("document.body.innerText.includes('paused')", "pause")
    time.sleep(1)  # the clock is drawn four times a second
    before = browser.run(CLOCK)
    browser.click("Step")
    browser.wait(f"Math.abs({CLOCK} - {before} - 0.1) < 0.01", "step of 0.1 s")
    PICTURES.mkdir(parents=True, exist_ok=True)
    browser.screenshot(PICTURES / f"demo_{width}.png")
    assert browser.run("document.documentElement.scrollWidth") <= width and not browser.errors
    ours = re.compile(rf"{address}|data:|blob:")
    assert len(browser.requests) > 1 and all(map(ours.match, browser.requests))


ATTEMPTS = """
window.found = [];
const socket = new WebSocket("{}".replace("http", "ws"), "viser-v{}");
socket.onopen = () => window.found.push("open");
socket.onerror = () => window.found.push("refused");
fetch("{}").then(() => window.found.push("read")).catch(() => window.found.push("refused")); 1
"""


def test_a_page_of_another_origin_is_refused(browser, address, tmp_path):
    """And a name that somebody points here (DNS rebinding); its own page is let in."""
    (tmp_path / "index.html").write_text("elsewhere")
    handler = partial(SimpleHTTPRequestHandler, directory=tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        foreign = f"http://127.0.0.1:{server.server_port}/"
        for page, result in ((foreign, ["refused", "refused"]), (address, ["open", "read"])):
            browser.open(page)
            browser.wait(f"location.href.startsWith({page!r})", page)
            browser.wait("document.readyState == 'complete'", page)
            browser.run(ATTEMPTS.format(address, viser.__version__, address))
            browser.wait("window.found.length == 2", "end of the attempts")
            assert sorted(browser.run("window.found")) == result
        server.shutdown()
    browser.open(address.replace("127.0.0.1", "rebound.test"))
    browser.wait("document.body?.innerText.includes('refused: this page')", "refusal")
