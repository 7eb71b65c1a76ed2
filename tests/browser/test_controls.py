"""Every control of the demo in a real browser, and each found out where it is dead."""

import json
import time
import tomllib

import pytest

from flexaxis.experiments.demo.lesson import parse_lesson
from tests.browser import test_page as page

pytestmark = pytest.mark.browser


# Where a control acts on the demo; a dead one does nothing there.
PLACES = {
    "inject": "DemoSession",
    "repair": "DemoSession",
    "rub": "DemoSession",
    "disturb": "DemoSession",
    "excite": "DemoSession",
    "tune": "DemoSession",
    "choose": "DemoSession",
    "_wind": "Page",
}
DEAD = (
    "from flexaxis.experiments.demo.session import DemoSession;"
    "from flexaxis.experiments.demo.page import Page;"
    + "".join(f"{owner}.{name} = lambda self, *_: None;" for name, owner in PLACES.items())
    + "import viser; viser.ClientHandle.send_file_download = lambda *_, **__: None;"
    "Pace = __import__('flexaxis.experiments.demo.page', fromlist=['Pace']).Pace;"
    "Pace.speed = property(lambda self: 2.0, lambda self, value: None);"
    "from flexaxis.experiments.cli import main; sys.exit(main())"
)

# Friction comes, but its sliders do nothing.
STIFF = (
    "from flexaxis.experiments.demo.session import DemoSession;"
    "from flexaxis.experiments.demo.live_axis import Friction;"
    "rub = DemoSession.rub;"
    "DemoSession.rub = lambda self, friction: rub(self, Friction(friction.kind));"
    "from flexaxis.experiments.cli import main; sys.exit(main())"
)

SLIDER = """
(() => {{
  const row = [...document.querySelectorAll("label")].filter(
    e => e.innerText?.trim() == "{label}" && e.getClientRects().length);
  let around = row[row.length - 1];
  while (around && !around.querySelector("[role=slider]")) around = around.parentElement;
  const thumb = around?.querySelector("[role=slider]");
  thumb?.scrollIntoView({{block: "nearest"}});
  thumb?.focus();
  return !!thumb;
}})()
"""
CHOICE = """
(() => {{
  const row = [...document.querySelectorAll("label")].filter(
    e => e.innerText?.trim() == "{label}" && e.getClientRects().length);
  let around = row[row.length - 1];
  while (around && !around.querySelector("input")) around = around.parentElement;
  around?.querySelector("input")?.scrollIntoView({{block: "nearest"}});
  around?.querySelector("input")?.click();
  return !!around;
}})()
"""
SAYS = "document.body.innerText.includes({0})"


def says(text):
    return SAYS.format(json.dumps(text))


def pulled(label):
    """Pull a slider to its upper end."""

    def act(browser):
        browser.wait(SLIDER.format(label=label), seconds=10, what=f"slider {label}")
        browser.press("End")

    return act


def chosen(label, option):
    """Choose from a list; a folder that is still opening closes it again, so look twice."""
    seen = (
        "[...document.querySelectorAll('[role=option]')].some("
        f"e => e.innerText.includes({json.dumps(option)}) && e.getClientRects().length)"
    )

    def act(browser):
        end = time.monotonic() + 30
        while not browser.run(seen):
            assert time.monotonic() < end, f"no {option} in the list {label}"
            browser.run(CHOICE.format(label=label))
            time.sleep(2.0)
        browser.click(option, "[role=option]")

    return act


def unfold(browser, folder):
    browser.click(folder)
    time.sleep(1.0)  # it opens slowly, and a list would close again


def clicked(text):
    return lambda browser: browser.click(text, "button")


def stands(browser):
    """Whether the clock stands for a second."""
    before = browser.run(page.CLOCK)
    time.sleep(1.0)
    return browser.run(page.CLOCK) == before


# In this order: what to open first, what to do, and a script that becomes true.
TRUTH = page.CELL.strip()
CONTROLS = {
    "f_m × 2": (None, clicked("f_m × 2"), f"{TRUTH.format(name='f_m', column=1)} == 0.1"),
    "J_a × 1.25": (None, clicked("J_a × 1.25"), f"{TRUTH.format(name='1/J_a', column=1)} == 1"),
    "k_T × 0.9": (None, clicked("k_T × 0.9"), f"{TRUTH.format(name='k_T', column=1)} == 0.9"),
    "k_a × 0.9": (None, clicked("k_a × 0.9"), says("k_a × 0.9: what it is taken for")),
    "repair": (None, clicked("Repair"), says("s: repaired")),
    "pause": (None, clicked("Pause"), says("paused")),
    "step": (None, clicked("Step"), says("paused")),
    "friction": (
        "Dry friction",
        chosen("friction", "LuGre"),
        f"{TRUTH.format(name='f_c', column=1)} == 0.1",
    ),
    "f_c": (None, pulled("f_c [N m]"), f"{TRUTH.format(name='f_c', column=1)} == 0.4"),
    "f_s": (None, pulled("f_s [N m]"), says("f_s 0.4 N m")),
    "v_s": (None, pulled("v_s [rad/s]"), says("v_s 5 rad/s")),
    "noise": ("Axis: speed", pulled("noise [rad/s]"), says("noise 0.5 rad/s")),
    "excitation": (None, chosen("excitation", "stop-and-go"), says("excitation stop-and-go")),
    "estimator": ("Estimator B", chosen("estimator", "ekf"), says("B: ekf")),
    "λ": ("Estimator A", pulled("λ"), says("A: rpem-forgetting λ 0.9995")),
    "μ": (None, pulled("μ"), says("λ 0.9995, μ 1")),
}
NEED = ("f_c", "f_s", "v_s")  # shown only with a law of friction


@pytest.fixture
def opened(browser):
    """A page, opened at an address, with the demo at two times real time."""

    def start(address):
        browser.size(1400, 900)
        page.opened(browser, address)
        return browser

    return start


def test_every_control_does_something(opened):
    with page.demo("--speed", "2") as address:
        browser = opened(address)
        for name, (folder, act, reached) in CONTROLS.items():
            if folder:
                unfold(browser, folder)
            act(browser)
            browser.wait(reached, seconds=60, what=name)
            if name == "pause":
                time.sleep(1.0)
                assert stands(browser)
            if name == "step":
                time.sleep(1.0)
                before = browser.run(page.CLOCK)
                clicked("Step")(browser)
                later = f"Math.abs({page.CLOCK} - {before} - 0.1) < 0.01"
                browser.wait(later, seconds=5, what="a tenth of a second")
                assert stands(browser)
                clicked("Run")(browser)
                browser.wait(f"!{says('paused')}", seconds=5, what="the clock runs again")
        assert not browser.errors


@pytest.mark.parametrize("name", [name for name in CONTROLS if name not in NEED])
def test_a_control_that_is_dead_is_found_out(name, dead):
    folder, act, reached = CONTROLS[name]
    if folder or name in {"excitation", "μ"}:
        unfold(dead, folder or {"excitation": "Axis: speed", "μ": "Estimator A"}[name])
    act(dead)
    with pytest.raises(AssertionError, match="not within"):
        dead.wait(reached, seconds=1.5, what=name)


@pytest.fixture(scope="module")
def lifeless():
    """The address of a demo whose controls do nothing."""
    with page.demo("--speed", "2", code=DEAD) as address:
        yield address


@pytest.fixture
def dead(opened, lifeless):
    """Its page."""
    return opened(lifeless)


def test_dead_sliders_of_friction_are_found_out(opened):
    with page.demo("--speed", "2", code=STIFF) as address:
        browser = opened(address)
        for name in ("friction", *NEED):
            folder, act, reached = CONTROLS[name]
            if folder:
                unfold(browser, folder)
            act(browser)
            if name == "friction":
                browser.wait(reached, seconds=60, what=name)
                continue
            with pytest.raises(AssertionError, match="not within"):
                browser.wait(reached, seconds=2, what=name)


def saved(browser, folder, button, name, seconds=20):
    """The text of a file that a button saves."""
    browser.downloads(folder)
    browser.click(button, "button")
    end = time.monotonic() + seconds
    while not (folder / name).exists():
        assert time.monotonic() < end, f"no {name}"
        time.sleep(0.2)
    return (folder / name).read_text(encoding="utf-8")


def test_what_was_done_can_be_taken_home(opened, tmp_path):
    with page.demo("--speed", "4") as address:
        browser = opened(address)
        browser.click("f_m × 2", "button")
        browser.click("What was done")
        browser.wait(says("f_m × 2"), seconds=20, what="the fault")
        cells = "[...document.querySelectorAll('table.history tr')].length"
        browser.wait(f"{cells} == 2", seconds=20, what="a row")
        found = "/f_m × [12]\\.?\\d* after/.test(document.querySelector('table.history').innerText)"
        browser.wait(found, seconds=20, what="what B found")
        table = saved(browser, tmp_path, "Table (CSV)", "flexaxis_history.csv")
        assert table.startswith("time_s,what,") and "f_m × 2,f_m,0.05,0.1" in table
        text = saved(browser, tmp_path, "Lesson (TOML)", "flexaxis_lesson.toml")
    assert tomllib.loads(text)["act"][0]["fault"] == "f_m"
    assert parse_lesson(text, source="saved").act[0].factor == 2.0
    lesson = tmp_path / "flexaxis_lesson.toml"
    with page.demo(lesson) as address:
        browser = opened(address)
        truth = f"{TRUTH.format(name='f_m', column=1)} == 0.1"
        browser.wait(truth, seconds=60, what="the fault, again")


def test_a_dead_save_is_found_out(dead, tmp_path):
    dead.click("What was done")
    for button, name in (("Table", "flexaxis_history.csv"), ("Lesson", "flexaxis_lesson.toml")):
        with pytest.raises(AssertionError, match=f"no {name}"):
            saved(dead, tmp_path, button, name, seconds=2)


def test_who_reloads_sees_where_it_is(opened):
    """Also in the middle of a fault, and beside another page that was closed then."""
    with page.demo("--speed", "2") as address:
        browser = opened(address)
        browser.click("f_m × 2", "button")
        browser.open("about:blank")
        page.opened(browser, address)
        title = "f_m × 2: left to be found"
        browser.wait(f"{page.drawn(title, 'A', 'wide')} > 100", seconds=30, what="the fault")
        clicked("Pause")(browser)
        browser.wait(says("paused"), seconds=10, what="the pause")
        browser.open(address)
        browser.wait(
            f"{page.drawn(title, 'A', 'wide')} > 100", seconds=30, what="the fault, paused"
        )
        assert browser.run(says("paused")) and not browser.errors
