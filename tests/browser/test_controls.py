"""Every control of the demo in a real browser; a dead one leaves what is looked for as it was."""

import time
import tomllib

import pytest

from flexaxis.experiments.demo.lesson import parse_lesson
from tests.browser import test_page as page

pytestmark = pytest.mark.browser
address, says = page.address, page.says

# What has a label, and in it a slider or a list.
FIND = """(() => {{
  const row = [...document.querySelectorAll("label")].filter(
    e => e.innerText?.trim() == "{label}" && e.getClientRects().length);
  let around = row[row.length - 1];
  while (around && !around.querySelector("{inside}")) around = around.parentElement;
  const found = around?.querySelector("{inside}");
  found?.scrollIntoView({{block: "nearest"}});
  found?.{act}();
  return !!found;
}})()"""


def pulled(label):
    """Pull a slider to its upper end."""

    def act(browser):
        script = FIND.format(label=label, inside="[role=slider]", act="focus")
        browser.wait(script, seconds=10, what=f"slider {label}")
        browser.key("End")

    return act


def chosen(label, option):
    """Choose from a list; a folder that is still opening closes it again, so look twice."""
    seen = (
        "[...document.querySelectorAll('[role=option]')].some("
        f"e => e.innerText.includes({option!r}) && e.getClientRects().length)"
    )

    def act(browser):
        end = time.monotonic() + 30
        while not browser.run(seen):
            assert time.monotonic() < end, f"no {option} in the list {label}"
            browser.run(FIND.format(label=label, inside="input", act="click"))
            time.sleep(0.5)
        browser.click(option, "[role=option]")

    return act


def clicked(text):
    return lambda browser: browser.click(text, "button")


def truth(name, value):
    return f"{page.CELL.format(name=name, column=1)} == {value}"


SPEED = "parseFloat(document.body.innerText.match(/([\\d.]+) × real time/)[1])"

# In this order: what to open first, what to do, and a script that becomes true.
CONTROLS = {
    "f_m × 2": (None, clicked("f_m × 2"), truth("f_m", 0.1)),
    "J_a × 1.25": (None, clicked("J_a × 1.25"), truth("1/J_a", 1)),
    "k_T × 0.9": (None, clicked("k_T × 0.9"), truth("k_T", 0.9)),
    "k_a × 0.9": (None, clicked("k_a × 0.9"), says("k_a × 0.9: what it is taken for")),
    "repair": (None, clicked("Repair"), says("s: repaired")),
    "pause": (None, clicked("Pause"), says("paused")),
    "run": (None, clicked("Run"), f"!{says('paused')}"),
    "step": (None, clicked("Step"), says("paused")),
    "run on": (None, clicked("Run"), f"!{says('paused')}"),
    "noise": ("Axis: speed", pulled("noise [rad/s]"), says("noise 0.5 rad/s")),
    "excitation": (None, chosen("excitation", "stop-and-go"), says("excitation stop-and-go")),
    "friction": ("Dry friction", chosen("friction", "LuGre"), truth("f_c", 0.1)),
    "f_c": (None, pulled("f_c [N m]"), truth("f_c", 0.4)),
    "f_s": (None, pulled("f_s [N m]"), says("f_s 0.4 N m")),
    "v_s": (None, pulled("v_s [rad/s]"), says("v_s 5 rad/s")),
    "estimator": ("Estimator B", chosen("estimator", "ekf"), says("B: ekf")),
    "λ": ("Estimator A", pulled("λ"), says("A: rpem-forgetting λ 0.9995")),
    "μ": (None, pulled("μ"), says("λ 0.9995, μ 1")),
    "speed": (None, pulled("speed ×"), f"{SPEED} > 2.5"),
}


def standing(browser):
    """The time of the clock [s], once it has stood for a second."""
    end, before = time.monotonic() + 30, None
    while (now := browser.run(page.CLOCK)) != before:
        assert time.monotonic() < end, "the clock goes on"
        before = now
        time.sleep(1.0)
    return now


def test_what_was_done_can_be_taken_home(browser, address, tmp_path):
    browser.size(1400, 900)
    page.opened(browser, address)
    browser.click("What was done")
    row = "document.querySelector('table.history')?.innerText"
    assert not browser.run(f"{row}.includes('f_m × 2')")
    browser.click("f_m × 2", "button")
    browser.wait(f"/f_m × [12]\\.?\\d* after/.test({row})", seconds=20, what="what B found")
    browser.downloads(tmp_path)
    browser.click("Table (CSV)", "button")
    table = browser.saved("flexaxis_history.csv", seconds=20).read_text(encoding="utf-8")
    assert table.startswith("time_s,what,") and "f_m × 2,f_m,0.05,0.1" in table
    time.sleep(1.0)  # a viewer gets no more than a file a second
    browser.click("Lesson (TOML)", "button")
    text = browser.saved("flexaxis_lesson.toml", seconds=20).read_text(encoding="utf-8")
    assert tomllib.loads(text)["act"][-1]["fault"] == "f_m"
    assert parse_lesson(text, source="saved").act[-1].factor == 2.0


def test_every_control_does_something(browser, address):
    """What a control leads to is not there before it is turned, so that a dead one is found out."""
    browser.size(1400, 900)
    page.opened(browser, address)
    for name, (folder, act, reached) in CONTROLS.items():
        if folder:
            browser.click(folder)
            time.sleep(1.0)  # it opens slowly, and a list would close again
        if name != "repair":
            assert not browser.run(reached), f"{name}: before it is turned"
        act(browser)
        browser.wait(reached, seconds=30, what=name)
        if name == "pause":
            standing(browser)
        if name == "step":
            before = standing(browser)
            act(browser)
            later = f"{page.CLOCK} > {before}"
            browser.wait(later, seconds=15, what="a tenth of a second")
            assert standing(browser) == pytest.approx(before + 0.1, abs=0.01)
    assert not browser.errors
