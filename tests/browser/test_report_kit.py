"""What a page can do, in Chromium; each of it is seen to fail when its code is dead."""

import csv
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from flexaxis.experiments.reporting.tables import TERMS
from tests.browser import sample

pytestmark = pytest.mark.browser

ROWS = "[...document.querySelectorAll('#scores tbody tr')].filter(r => r.checkVisibility())"
NAMES = f"{ROWS}.map(r => r.cells[0].textContent)"
LINES = """[...document.querySelectorAll('.area .line[data-who="ekf"]')]
    .filter(line => line.getClientRects().length).length"""
CENTRE = """(() => {{ const all = document.querySelectorAll({selector!r}); const e = all[{n}];
  e.scrollIntoView({{block: "center"}}); const b = e.getBoundingClientRect();
  return [b.left, b.top, b.width, b.height]; }})()"""


class Page:
    """A page in a browser, with what the checks below do to it."""

    def __init__(self, browser, folder: Path) -> None:
        self.browser, self.folder = browser, folder
        self.run = browser.run

    def open(self, fragment: str = "") -> None:
        self.browser.open("about:blank")
        self.browser.open((self.folder / "page.html").as_uri() + fragment)
        self.until("document.documentElement.dataset.ready", "ready", seconds=6)

    def until(self, script: str, what: str, seconds: float = 1.5):
        return self.browser.wait(script, seconds=seconds, what=what)

    def box(self, selector: str, n: int = 0) -> list[float]:
        found = self.run(CENTRE.format(selector=selector, n=n))
        assert found, f"nothing is {selector}"
        return found

    def click(self, selector: str, n: int = 0) -> None:
        left, top, width, height = self.box(selector, n)
        at = (left + width / 2, top + height / 2)
        self.browser.mouse(at, at, press=True)

    def fragment(self) -> str:
        return self.run("decodeURIComponent(decodeURIComponent(location.hash))")


def sorts(page):
    page.click("#scores th:nth-child(3) button")
    names = [sample.WHO[i] for i in (3, 1, 0, 2, 4)]
    page.until(f"{NAMES}[0] === 'glr'", "upwards")
    assert page.run(NAMES) == names
    assert page.run("document.querySelector('#scores th:nth-child(3)').ariaSort") == "ascending"
    page.click("#scores th:nth-child(3) button")
    down = [sample.WHO[i] for i in (2, 0, 1, 3, 4)]  # nothing stays last
    page.until(f"{NAMES}[0] === 'ekf'", "downwards")
    assert page.run(NAMES) == down
    assert "sort.scores=2d" in page.fragment()


def sorts_by_keyboard(page):
    page.run("document.querySelector('#scores th button').focus()")
    page.browser.key("Tab")
    page.browser.key("Enter")
    page.until("document.querySelector('#scores th:nth-child(2)').ariaSort === 'ascending'", "sort")
    assert page.run(f"{ROWS}[0].cells[1].textContent") == "ramp"


def filters(page):
    page.click("input[type=search]")
    page.browser.write("row d")
    rows = "[...document.querySelectorAll('#wide tbody tr')].filter(r => r.checkVisibility())"
    page.until(f"{rows}.length === 1", "one row left")
    assert page.run(f"{rows}[0].cells[0].textContent") == "row d"
    assert page.run(
        "document.querySelector('#wide').closest('.scroll').previousSibling.textContent"
    )
    assert "find.wide=row d" in page.fragment()


def shows_columns(page):
    head = "document.querySelector('#scores th:nth-child(4)').checkVisibility()"
    assert page.run(head) is False
    page.click(".tools button[aria-pressed]")
    page.until(head, "the column on demand")


def hides(page):
    before = page.run(LINES)
    assert before == 5  # two panels in two views, and the trade-off
    page.click('#estimates button[data-toggle="ekf"]')
    page.until(f"{LINES} === 0", "no curve of it anywhere")
    assert page.run(f"{NAMES}.includes('ekf')") is False
    assert page.run("document.querySelector('input[data-toggle=\"ekf\"]').checked") is False
    page.run("history.back()")
    page.until(f"{LINES} === {before} && {NAMES}.includes('ekf')", "back again")


def filters_groups(page):
    page.run("document.getElementById('group-choice').focus()")
    page.browser.key("ArrowDown")
    page.browser.key("ArrowDown")
    page.until(
        f'JSON.stringify({ROWS}.map(r => r.cells[1].textContent)) === \'["ramp","ramp"]\'', "group"
    )


def zooms(page):
    second = "document.querySelectorAll('#estimates .view')[1]"
    ticks = f"{second}.querySelector('.below').textContent"
    before = page.run(ticks)
    left, top, width, _ = page.box("#estimates .view:nth-child(2) .panel")
    y = top + 80
    page.browser.mouse(
        (left + 0.5 * width, y), (left + 0.6 * width, y), (left + 0.7 * width, y), press=True
    )
    page.until("location.hash.includes('win.estimates')", "zoom in the address")
    ends = re.search(r"win.estimates.2=([-\d.e]+)~([-\d.e]+)", page.fragment()).groups()
    assert [float(end) for end in ends] == pytest.approx([10, 14], abs=0.1)
    box = page.run(f"{second}.querySelector('.area').getAttribute('viewBox')")
    assert [float(v) for v in box.split()][::2] == pytest.approx([5000, 2000], abs=60)
    page.run(f"{second}.focus()")
    assert page.run(ticks) != before
    page.browser.key("Escape")
    page.until("!location.hash.includes('win')", "back by Escape")
    assert page.run(ticks) == before


def reads_off(page):
    left, top, width, _ = page.box("#estimates .view:nth-child(2) .panel")
    x = left + width * 0.75  # at 15 s
    page.browser.mouse((x, top + 40), (x + 1, top + 41))
    page.until(
        "document.querySelectorAll('#estimates .view')[1].querySelector('.tip').checkVisibility()",
        "tip",
    )
    text = page.run("document.querySelectorAll('#estimates .tip')[1].textContent")
    assert "time [s]: 15" in text
    n = sample.WHO.index("glr")
    told = float(re.search(r"glr([\d.]+) ", text)[1])
    assert told == pytest.approx(sample.curve(n, 0)[300], abs=0.006)  # three digits
    assert page.run("document.querySelectorAll('#estimates .line.near').length") >= 1


def reads_by_keyboard(page):
    page.run("document.querySelector('#speed-against-variance .view').focus()")
    page.browser.key("ArrowRight")
    page.browser.key("ArrowRight")
    said = page.until("document.getElementById('said').textContent", "words for a screen reader")
    knob = 10 ** (-1.5228787 + 1.5228787 / 5)  # the second of six settings
    assert said.startswith("rpem-forgetting, lag [s]: ")
    assert f"at {knob:.4g}" in said
    assert f": {1 / knob:.4g} " in said
    page.browser.key("+")
    page.until("location.hash.includes('win.speed')", "zoom by key")
    page.browser.key("Escape")
    page.until("!location.hash.includes('win.speed')", "back by key")


def picks(page):
    page.click('#estimates .dots .line[data-who="rpem-forgetting"] use', 1)
    page.until("document.getElementById('picked').open", "the dialog")
    text = page.run("document.getElementById('picked').textContent")
    assert "Seed 1003 of fm_step-v1" in text
    assert "flexaxis track fm_step-v1 --seed 1003" in text
    page.until("Boolean(document.querySelector('#picked .line[data-who=ekf]'))", "its chart")
    page.browser.key("Escape")
    page.until(
        "!document.getElementById('picked').open && !location.hash.includes('pick')", "closed"
    )


def copies(page):
    page.run("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    page.click("div.command button")
    page.until("window.copied === 'flexaxis run smoke --seeds 8'", "on the clipboard")


def copies_where_the_clipboard_is_refused(page):
    page.run("navigator.clipboard.writeText = async () => { throw new Error('refused'); }")
    page.run(
        "document.addEventListener('copy', () => { window.copied = document.activeElement.value; })"
    )
    page.click("div.command button")
    page.until("window.copied === 'flexaxis run smoke --seeds 8'", "by the older way")


def saves_csv(page):
    page.click(".tools summary")
    page.click(".tools .sheet button", 1)
    with page.browser.saved("scores*.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["estimator", "group", "lag [s]", "seeds"]
    assert [row[0] for row in rows[1:]] == list(sample.WHO)
    assert [row[2] for row in rows[1:]] == ["0.9", "0.5", "Infinity", "0.0625", ""]


def saves_json_as_shown(page):
    page.open("#hide=ekf&sort.scores=2a")
    page.click(".tools summary")
    page.click(".tools .sheet button", 2)
    found = json.loads(page.browser.saved("scores*.json").read_text(encoding="utf-8"))
    assert [row["estimator"] for row in found] == [sample.WHO[i] for i in (3, 1, 0, 4)]
    assert set(found[0]) == {"estimator", "group", "lag [s]"}
    assert [row["lag [s]"] for row in found] == [0.0625, 0.5, 0.9, None]


def saves_curves(page):
    page.click("#estimates .menu summary")
    page.click("#estimates .menu button", 0)
    with page.browser.saved("estimates*.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    mine = [row for row in rows if row["estimator"] == "ekf" and row["quantity"] == "f_m / nominal"]
    n = sample.WHO.index("ekf")
    for row in mine:  # of the curve what is drawn
        exact = np.interp(float(row["time [s]"]), sample.TIME, sample.curve(n, 1))
        assert float(row["y"]) == pytest.approx(exact, abs=0.004)
        assert float(row["low"]) == pytest.approx(exact - 0.03, abs=0.006)
    assert len(mine) > 10 and float(mine[-1]["time [s]"]) == pytest.approx(20, abs=0.01)


def saves_pictures(page):
    page.click("#speed-against-variance .menu summary")
    page.click("#speed-against-variance .menu button", 1)
    text = page.browser.saved("speed*.svg").read_text(encoding="utf-8")
    found = ElementTree.fromstring(text)  # by itself it is whole
    strokes = [part.get("stroke") for part in found.iter()]
    assert "rgb(19, 108, 209)" in strokes and "var(" not in text


def restores_from_a_link(page):
    page.open("#hide=ekf&sort.scores=2a&win.estimates=9~12&pick=1003")
    page.until("document.getElementById('picked').open", "what was open")
    assert page.run(LINES) == 0
    assert page.run(f"{NAMES}[0]") == "glr"
    assert page.run("document.querySelector('#estimates .view.zoomed') !== null")


def explains_terms(page):
    page.click("h1")  # a page that nobody has touched has no focus to give
    page.run("document.querySelector('dfn').focus()")
    page.until("document.getElementById('term-tip').checkVisibility()", "what the word means")
    said = page.run("document.getElementById('term-tip').textContent")
    assert said == TERMS["lag"].replace("_", "")  # indices are set


def changes_theme(page):
    back = "getComputedStyle(document.body).backgroundColor"
    assert page.run(back) == "rgb(255, 255, 255)"
    page.click("button.theme")
    page.until(f"{back} === 'rgb(22, 25, 29)'", "dark")
    page.open()
    assert page.run(back) == "rgb(22, 25, 29)"


def jumps(page):
    page.browser.size(390, 800, mobile=True)
    page.open()
    page.click(".bar summary")
    links = "[...document.querySelectorAll('.bar .sheet a')]"
    page.run(f"{links}.find(a => a.textContent === 'Estimates').click()")
    page.until("location.hash.includes('at=')", "in the address")
    head = "[...document.querySelectorAll('h2')].find(h => h.textContent === 'Estimates')"
    page.until(f"Math.abs({head}.getBoundingClientRect().top - 60) < 60", "on top")


def prints(page):
    page.run("window.dispatchEvent(new Event('beforeprint'))")
    page.browser.media("print")
    page.browser.size(1030, 800)  # A4, landscape, less its margins, in pixels of 1/96 inch
    widest = (
        "Math.max(...[...document.querySelectorAll('table, svg.panel')]"
        ".map(e => e.getBoundingClientRect().right))"
    )
    assert page.run(widest) <= 1030
    heads = "[...document.querySelectorAll('th:not(.again, details th)')]"
    assert page.run(f"{heads}.every(e => e.checkVisibility())")
    # Not said twice, and what is long and was folded stays so.
    assert not page.run("document.querySelector('th.again').checkVisibility()")
    assert not page.run("document.querySelector('details th').checkVisibility()")
    assert (
        page.run("[...document.querySelectorAll('.bar, .tools')].some(e => e.checkVisibility())")
        is False
    )
    page.until("document.querySelector('details p').checkVisibility()", "what was closed")
    assert page.run("document.querySelectorAll('svg.panel').length") >= 5


# What is checked, and the function of the page without which it must fail.
FEATURES = {
    sorts: "sortRows",
    sorts_by_keyboard: "setUpHead",
    filters: "filterRows",
    shows_columns: "markMore",
    hides: "showChanges",
    filters_groups: "showParts",
    zooms: "zoomBetween",
    reads_off: "showTip",
    reads_by_keyboard: "onKey",
    picks: "openPick",
    copies: "copyText",
    copies_where_the_clipboard_is_refused: "copyText",
    saves_csv: "download",
    saves_json_as_shown: "contentOf",
    saves_curves: "valuesOf",
    saves_pictures: "alone",
    restores_from_a_link: "pairOf",
    explains_terms: "showTerm",
    changes_theme: "kept",
    jumps: "goTo",
    prints: "setUpPrint",
}


@pytest.fixture
def opened(chromium, tmp_path, monkeypatch):
    """A function that writes the page, its code changed or not, and opens it."""

    def make(changed=None):
        (tmp_path / "page.html").write_text(sample.render(monkeypatch, changed), encoding="utf-8")
        chromium.requests.clear()
        chromium.errors.clear()
        chromium.media("", prefers_color_scheme="light")
        chromium.size(1400, 3200)  # all charts are near the screen
        chromium.downloads(tmp_path)
        page = Page(chromium, tmp_path)
        page.open()
        if page.run("localStorage.length"):
            page.run("localStorage.clear()")
            page.open()
        return page

    return make


@pytest.mark.parametrize("check", FEATURES, ids=lambda check: check.__name__)
def test_the_page(opened, check):
    page = opened()
    check(page)
    assert not page.browser.errors
    asked = {address.partition(":")[0] for address in page.browser.requests}
    assert asked <= {"file", "about", "blob"}


def dead(name: str):
    """Return a change to the code by which a function does nothing."""
    declared = re.compile(rf"^((?:async )?function {name}\(.*\) \{{)$|^(const {name} = )", re.M)

    def changed(text):
        done, count = declared.subn(
            lambda hit: (
                f"{hit[1]} return;"
                if hit[1]
                else f"const {name} = () => undefined; const {name}Was = "
            ),
            text,
        )
        assert count == 1, f"{name} is declared {count} times"
        return done

    return changed


@pytest.mark.parametrize("check", FEATURES, ids=lambda check: check.__name__)
def test_a_dead_feature_is_seen(opened, check):
    with pytest.raises((AssertionError, TypeError, IndexError, KeyError, SyntaxError)):
        check(opened(dead(FEATURES[check])))


def test_text_of_data_stays_text(opened):
    page = opened()
    assert page.run("document.querySelectorAll('img').length") == 0
    assert page.run(
        "document.querySelector('#estimates .legend').textContent.includes('<img src=x')"
    )
    page.click("#estimates button.who", 4)
    page.until(f"{ROWS}.length === 4", "its row hidden, whatever its name")
    assert page.fragment().startswith("#hide=" + sample.HOSTILE)


def test_a_browser_that_cannot_unpack_has_the_tables(opened):
    page = opened(lambda text: text.replace("new DecompressionStream", "new NoSuchStream"))
    page.run("""document.querySelector('[data-opens="1003"]').click()""")
    page.until("document.querySelector('[role=alert]')?.textContent.includes('too old')", "told")
    page.browser.key("Escape")
    page.click("#scores th:nth-child(3) button")
    page.until(f"{NAMES}[0] === 'glr'", "sorted all the same")


def test_nothing_leaves_the_page(opened):
    page = opened()
    page.run("""window.refused = [];
      document.addEventListener('securitypolicyviolation', e => refused.push(e.effectiveDirective));
      const add = (tag, rest) =>
        document.body.append(Object.assign(document.createElement(tag), rest));
      add('img', { src: 'http://127.0.0.1:9/x.png' });
      add('script', { textContent: 'window.ran = 1' });
      fetch('http://127.0.0.1:9/y').catch(() => 0); 1""")
    page.until("window.refused.length >= 3", "refused")
    assert sorted(page.run("window.refused"))[:3] == ["connect-src", "img-src", "script-src-elem"]
    assert page.run("window.ran") is None


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 390])
def test_axe_finds_nothing_serious(opened, axe, width, scheme):
    page = opened()
    page.browser.media("", prefers_color_scheme=scheme)
    page.browser.size(width, 3200)
    page.open()
    assert axe(page.browser) == []


def test_axe_would_find_it(opened, axe):
    page = opened()
    page.run("document.documentElement.style.setProperty('--muted', '#bbb'); 1")
    page.run("document.querySelector('button.theme').removeAttribute('aria-label'); 1")
    page.run("document.querySelector('button.theme').textContent = ''; 1")
    words = " ".join(axe(page.browser))
    assert "color-contrast" in words and "button-name" in words
