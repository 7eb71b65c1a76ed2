"""A browser without a screen, driven over its DevTools protocol: no more than the test needs."""

import base64
import contextlib
import importlib.util
import json
import os
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1300,1250",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP rebound.test 127.0.0.1",
)


# Where no graphics card draws, a picture of the axis takes a third of a second of a core, and the
# page stands until it is there: only a page of this name draws it. The others of the demo move ten
# times a second and not sixty, for each move is composed by the processor too.
DRAWN = "drawn"
BLANK = f"""
for (const name of ["drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"])
  if (window.name != "{DRAWN}") WebGL2RenderingContext.prototype[name] = () => {{}};
if (window.name != "{DRAWN}" && location.protocol == "http:") {{
  window.requestAnimationFrame = act => setTimeout(() => act(performance.now()), 100);
  window.cancelAnimationFrame = clearTimeout;
}}
"""


FIND = """
(() => {{
  const found = [...document.querySelectorAll("{kind}")].filter(
    e => e.innerText?.trim().includes("{text}") && e.getClientRects().length);
  const last = found[found.length - 1];
  if (!last) return null;
  if ({scroll}) last.scrollIntoView({{block: "nearest"}});
  const {{left, top, right, bottom}} = last.getBoundingClientRect();
  const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return {{left, top, right, bottom, free: last.contains(hit)}};
}})()
"""


def find() -> str | None:
    """The path of Chromium, or None where it is not installed."""
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)


@pytest.fixture(scope="session")
def started(tmp_path_factory):
    """A Chromium that all tests of a process share."""
    if find() is None:
        (pytest.fail if os.environ.get("FLEXAXIS_RELEASE") else pytest.skip)("no Chromium here")
    with Browser(tmp_path_factory.mktemp("profile") / "profile") as page:
        yield page


@pytest.fixture(scope="module")
def chromium(started):
    """That Chromium, in which no page of another module asks for anything any more."""
    started.fresh()
    return started


@pytest.fixture
def browser(chromium):
    """That Chromium, as if it had just begun."""
    chromium.fresh()
    return chromium


SERIOUS = """
axe.run().then(r => window.found = r.violations
  .filter(v => ["serious", "critical"].includes(v.impact))
  .map(v => v.id + ": " + v.nodes.slice(0, 3).map(n => n.html.slice(0, 99)).join(" · "))); 1
"""


@pytest.fixture(scope="session")
def axe():
    """A function that says what axe-core finds serious or critical in the page of a browser."""
    place = importlib.util.find_spec("axe_core_python")
    if place is None:
        pytest.skip("axe-core-python is not installed")
    code = Path(place.origin).with_name("axe.min.js").read_text(encoding="utf-8")

    def found(browser):
        browser.run(code + "; window.found = null; 1")
        browser.run(SERIOUS)
        browser.wait("window.found !== null", seconds=60, what="axe-core")
        return browser.run("window.found")

    return found


class Browser:
    """One page in a Chromium of its own; `requests` has every address that it asked for."""

    def __init__(self, profile: Path) -> None:
        from websockets.sync.client import connect

        self.requests: list[str] = []
        self.errors: list[str] = []
        self._number = 0
        words = [find(), *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(
            words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        port = self._port(profile / "DevToolsActivePort")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [target for target in json.load(answer) if target["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=2**27, proxy=None)
        for domain in ("Network", "Page", "Runtime"):
            self._call(f"{domain}.enable")
        self._call("Page.addScriptToEvaluateOnNewDocument", source=BLANK)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._socket.close()
        self._process.terminate()
        self._process.wait(30)

    def fresh(self) -> None:
        """Leave nothing of what was there before."""
        self._call("Emulation.clearDeviceMetricsOverride")
        self._call("Network.clearBrowserCookies")
        self.open("about:blank")
        self.wait("location.href === 'about:blank'", seconds=20, what="nothing")
        end = time.monotonic() + 20
        self.requests.append("of the page before, whose workers end late")
        while self.requests:
            assert time.monotonic() < end, f"the page before still asks: {self.requests}"
            self.requests.clear()
            time.sleep(0.1)
            self._moves()
        self.errors.clear()

    def open(self, address: str) -> None:
        self._call("Page.navigate", url=address)

    def run(self, script: str):
        """Return the value of an expression in the page, None if it fails."""
        answer = self._call("Runtime.evaluate", expression=script, returnByValue=True)
        if "exceptionDetails" in answer:  # such as a page that has no body yet
            return None
        return answer["result"].get("value")

    def _moves(self) -> None:
        """Return once the page has moved twice more what moves, or is another: `BLANK` is slow."""
        twice = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(() => r(1))))"
        with contextlib.suppress(AssertionError):  # it has gone elsewhere meanwhile
            self._call("Runtime.evaluate", expression=twice, awaitPromise=True)

    def wait(self, script: str, *, seconds: float, what: str):
        """Return the value of an expression as soon as it is true."""
        end = time.monotonic() + seconds
        while not (value := self.run(script)):
            assert time.monotonic() < end, f"not within {seconds} s: {what}"
            time.sleep(0.05)
        return value

    def size(self, width: int, height: int, *, mobile: bool = False) -> None:
        """Make the page as large as a screen of so many pixels."""
        self._call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=mobile,
        )

    def place(self, text: str, kind: str = "*", *, scroll: bool = True) -> dict[str, float]:
        """Where the innermost element that has a text lies: left, top, right, bottom [pixels]."""
        script = FIND.format(text=text, kind=kind, scroll=str(scroll).lower())
        return self.wait(script, seconds=20, what=f"{kind} with {text!r}")

    def click(self, text: str, kind: str = "*") -> None:
        """Click in the middle of the innermost element that has a text.

        Once it is at rest and nothing lies over it: before the panel of a phone has slid up, its
        buttons are said to be below the screen, where no click arrives. At rest is what has not
        moved where the page might have moved it: pages of the demo do so ten times a second, and
        where the computer is busy less often.
        """
        before, end = None, time.monotonic() + 20
        while (at := self.place(text, kind)) != before or not at["free"]:
            assert time.monotonic() < end, f"{text!r} does not come to rest, or lies under another"
            before = at
            time.sleep(0.1)
            self._moves()
        where = {"x": (at["left"] + at["right"]) / 2, "y": (at["top"] + at["bottom"]) / 2}
        for event in ("mouseMoved", "mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=event, button="left", clickCount=1, **where)

    def draw(self, address: str) -> None:
        """Open a page that draws the axis."""
        self.run(f"window.name = {DRAWN!r}")  # which stays with the tab
        self.open(address)
        self.run("window.name = ''")

    def screenshot(self, path: Path) -> None:
        answer = self._call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(answer["data"]))

    def _port(self, file: Path) -> str:
        end = time.monotonic() + 60
        while not file.exists() or not file.read_text():
            assert self._process.poll() is None and time.monotonic() < end, (
                "Chromium does not start"
            )
            time.sleep(0.1)
        return file.read_text().splitlines()[0]

    def _call(self, method: str, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=120))
            if answer.get("method") == "Network.requestWillBeSent":
                self.requests.append(answer["params"]["request"]["url"])
            elif answer.get("method") == "Network.webSocketCreated":
                self.requests.append(answer["params"]["url"])
            elif answer.get("method") == "Runtime.exceptionThrown":
                self.errors.append(str(answer["params"]["exceptionDetails"])[:500])
            elif answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
