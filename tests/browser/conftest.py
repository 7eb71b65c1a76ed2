"""A browser without a screen, driven over its DevTools protocol: no more than the tests need."""

import base64
import json
import os
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest
from websockets.sync.client import connect

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP rebound.test 127.0.0.1",
)


@pytest.fixture
def browser(tmp_path):
    """A Chromium of its own."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        (pytest.fail if os.environ.get("FLEXAXIS_RELEASE") else pytest.skip)("no Chromium here")
    command = [path, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield Browser(tmp_path / "profile" / "DevToolsActivePort")
    finally:
        process.kill()
        process.wait()


SERIOUS = """
axe.run().then(r => window.problems = r.violations
  .filter(v => ["serious", "critical"].includes(v.impact))
  .map(v => v.id + ": " + v.nodes.slice(0, 3).map(n => n.html.slice(0, 99)).join(" · "))); 1
"""


@pytest.fixture
def axe():
    """Return a function that says what axe-core finds serious or critical in a page."""
    axe = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed")
    code = Path(axe.__file__).with_name("axe.min.js").read_text(encoding="utf-8")

    def problems(browser):
        browser.run(code + "; window.problems = null; 1")
        browser.run(SERIOUS)
        browser.wait("window.problems !== null", "axe-core")
        return browser.run("window.problems")

    return problems


class Browser:
    """One page; `requests` has every address that it asked for, `errors` what its scripts threw."""

    def __init__(self, file):
        self.requests, self.errors, self._number = [], [], 0
        until(lambda: file.exists() and file.read_text(), "Chromium")
        port = file.read_text().splitlines()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            (page,) = (target for target in json.load(answer) if target["type"] == "page")
        self._socket = connect(page["webSocketDebuggerUrl"], max_size=2**27, proxy=None)
        for domain in ("Network", "Page", "Runtime"):
            self._call(f"{domain}.enable")

    def open(self, address):
        """Go to an address."""
        self._call("Page.navigate", url=address)

    def run(self, script):
        """Return what a script comes to."""
        return self._call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get(
            "value"
        )

    def click(self, text, kind="button"):
        """Click on the first element of a kind with a text."""
        elements = f"[...document.querySelectorAll({kind!r})]"
        self.run(f"{elements}.find(e => e.innerText.includes({text!r})).click()")

    def wait(self, script, what):
        """Wait until a script comes to something true."""
        until(lambda: self.run(script), what)

    def size(self, width, height):
        """Show the page as on a screen of that size; a narrow one is a telephone's."""
        self._call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip

    def screenshot(self, path):
        """Write a picture of the page."""
        picture = self._call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(picture))

    def _call(self, method, **parameters):
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=120))
            match answer.get("method"):
                case "Network.requestWillBeSent":
                    self.requests.append(answer["params"]["request"]["url"])
                case "Runtime.exceptionThrown":
                    self.errors.append(str(answer["params"]["exceptionDetails"])[:500])
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]


def until(true, what, seconds=90):
    """Wait until something is true."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, f"no {what}"
        time.sleep(0.1)
