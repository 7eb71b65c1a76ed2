"""The demo in a real browser: it loads, asks nobody outside, and a click moves the curve."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.browser

PICTURES = Path(__file__).parents[2] / "results" / "browser"

# The number in a column of the table of estimates: 1 truth, 2 estimator A, 3 estimator B.
CELL = """
[...document.querySelectorAll("tr")].filter(row => row.cells[0]?.innerText.trim() == "{name}")
  .map(row => parseFloat(row.cells[{column}].innerText))[0]
"""
# What is drawn of a racer under a title, in one panel: how many points, and how far it rises.
DRAWN = """
(() => {{
  const heads = [...document.querySelectorAll("h4.chart")];
  const head = heads.find(e => e.innerText.includes("{title}"));
  const figure = head?.nextElementSibling;
  const panel = [...figure?.querySelectorAll("svg.panel") ?? []].find(
    e => e.dataset.y.startsWith("{panel}"));
  const lines = [...panel?.querySelectorAll(".area .line") ?? []];
  const line = lines.find(e => e.dataset.said == "{who}");
  const d = line?.querySelector(".curve")?.getAttribute("d");
  if (!d) return {{count: 0, rise: 0}};
  const steps = [...d.matchAll(/l-?\\d+,(-?\\d+)/g)].map(hit => Number(hit[1]));
  const {{width}} = line.getBoundingClientRect();
  return {{count: steps.length, wide: width, rise: -steps.reduce((a, b) => a + b, 0) / 10000}};
}})()
"""
CLOCK = "parseFloat(document.body.innerText.match(/t = ([\\d.]+) s/)?.[1])"
READY = "document.querySelectorAll('h4.chart + figure svg.panel').length >= 5"


def drawn(title, who, what="count", panel=""):
    """A script for how many points of a curve are drawn in a chart, or how far it rises."""
    return f"({DRAWN.strip().format(title=title, who=who, panel=panel)})?.{what}"


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


def number(browser, name, column):
    return browser.run(CELL.format(name=name, column=column))


def opened(browser, address):
    browser.open(address)
    browser.wait(READY, seconds=60, what="charts")
    browser.wait(f"{CLOCK} > 8", seconds=60, what="the clock")


def break_and_watch(browser, *, seconds):
    """Click "f_m × 2" once the curves run, and wait until both estimators have followed."""
    browser.wait(READY, seconds=60, what="charts")
    browser.wait(f"{CLOCK} > 10", seconds=90, what="10 s of the axis")
    browser.click("f_m × 2", "button")

    def reached(column):
        cell = CELL.format(name="f_m", column=column).strip()
        script = f"Math.abs({cell} / 0.1 - 1) < 0.06"
        browser.wait(script, seconds=seconds, what=f"column {column} of f_m at 0.1")

    reached(1)
    risen = f"{drawn('Estimates', 'A', 'rise', 'f_m [')} > 0.3"  # while it is in the window
    browser.wait(risen, seconds=seconds, what="the line risen")
    reached(2)
    reached(3)


def test_a_click_moves_the_curve(browser):
    with demo("--speed", "1.5") as address:
        browser.open(address)
        browser.wait("document.body.innerText.includes('f_m × 2')", seconds=60, what="the buttons")
        assert number(browser, "f_m", 1) in (None, 0.05)
        break_and_watch(browser, seconds=60)
        PICTURES.mkdir(parents=True, exist_ok=True)
        browser.screenshot(PICTURES / "after_fault.png")
        outside = [
            url for url in browser.requests if not re.match(rf"{address}|data:|blob:|ws://127", url)
        ]
        assert not outside
        assert len(browser.requests) > 1 and not browser.errors


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (390, 844)])
def test_the_first_fault_is_seen_without_scrolling(browser, width, height):
    """Its button, and what each estimator makes of it, beside what theory allows."""
    with demo("--speed", "2") as address:
        browser.size(width, height, mobile=width < 600)
        opened(browser, address)
        assert browser.run(drawn("break it", "A")) == 0
        browser.click("f_m × 2", "button")
        title = "f_m × 2: left to be found"
        for who in ("A", "B", "theory allows"):
            browser.wait(f"{drawn(title, who, 'wide')} > 100", seconds=30, what=f"line {who}")
        for text, kind in (("f_m × 2", "button"), (title, "h4"), ("lag", "tr")):
            at = browser.place(text, kind, scroll=False)
            assert at["top"] >= 0 and at["left"] >= 0, text
            assert at["bottom"] <= height and at["right"] <= width + 1, text
        PICTURES.mkdir(parents=True, exist_ok=True)
        browser.screenshot(PICTURES / f"first_fault_{width}.png")
        wide = "document.documentElement.scrollWidth"
        assert browser.run(wide) <= width and not browser.errors
        if width < 600:
            phone_shows_all(browser, PICTURES / "first_fault_phone.png", width)


def phone_shows_all(browser, picture, width):
    """The axis above the controls, and these as wide as the page, with the wide table open too."""
    # What the page says of a computer without a graphics card would lie over the axis.
    browser.run("document.querySelectorAll('.mantine-Notification-root').forEach(e => e.remove())")
    browser.screenshot(picture)
    controls = browser.place("break it, and watch", scroll=False)
    with Image.open(picture) as shot:
        above = np.asarray(shot.convert("RGB")).astype(int)[: int(controls["top"]) - 8]
    # Sky and grid are grey; gear and arm are not, and 40 pixels long.
    assert (np.ptp(above, axis=2) > 40).sum() > 400
    browser.click("What was done")  # unfolds
    time.sleep(1.0)
    browser.click("What was done")
    shown = "document.querySelector('table.history')?.getClientRects().length > 0"
    browser.wait(shown, seconds=20, what="the table")
    for text in ("f_m × 2", "Repair", "Step"):
        assert browser.place(text, "button", scroll=False)["right"] <= width, text


def test_a_button_that_does_nothing_is_found_out(browser):
    """The check above can fail."""
    dead = (
        "from flexaxis.experiments.demo.session import DemoSession;"
        "DemoSession.inject = lambda self, parameter, factor: None;"
        "from flexaxis.experiments.cli import main; sys.exit(main())"
    )
    with demo("--speed", "3", code=dead) as address:
        browser.open(address)
        with pytest.raises(AssertionError, match="column 1 of f_m"):
            break_and_watch(browser, seconds=3)


def test_two_viewers_see_the_same(browser, tmp_path):
    with demo("--speed", "3") as address, type(browser)(tmp_path / "second") as other:
        for page in (browser, other):
            page.open(address)
            page.wait("document.body.innerText.includes('f_m × 2')", seconds=60, what="the buttons")
        browser.wait(f"{CLOCK} > 8", seconds=60, what="the clock")
        browser.click("f_m × 2", "button")
        for page in (browser, other):
            truth = f"{CELL.format(name='f_m', column=1).strip()} == 0.1"
            page.wait(truth, seconds=30, what="the fault on both pages")


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
        said = "document.body.innerText.includes('act[0] at 1 s cannot be done: it does not')"
        browser.wait(said, seconds=60, what="what was wrong")
        browser.wait(f"{CLOCK} > 3", seconds=60, what="the lesson goes on")
    ended = "document.body.innerText.includes('The demo has ended')"
    browser.wait(ended, seconds=10, what="the end")
    gone = "[...document.querySelectorAll('button')].every(e => e.innerText != 'Run')"
    browser.wait(gone, seconds=5, what="no buttons")
