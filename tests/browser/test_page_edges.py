"""A page at its edges: cut links, unknown names, old browsers, no script, keyboard, a phone."""

import csv

import pytest

from tests.browser import test_report_kit as kit

opened, ROWS = kit.opened, kit.ROWS

pytestmark = pytest.mark.browser

DIALOG = "document.getElementById('picked').open"
TRADEOFF = "#speed-against-variance"


def test_a_cut_link_opens(opened):
    page = opened()
    page.open("#hide=%E0%A4%A")
    page.until("document.querySelectorAll('.area .line').length >= 4", "its charts", seconds=5)
    assert not page.browser.errors


@pytest.mark.parametrize("name", ["constructor", "__proto__"])
def test_a_name_that_every_object_has_is_no_run(opened, name):
    page = opened()
    page.open(f"#pick={name}")
    assert page.run(DIALOG) is False


def test_an_unknown_group_hides_nothing(opened):
    page = opened()
    page.open("#group=bogus")
    assert page.run(f"{ROWS}.length") == 5
    assert page.run("document.getElementById('group-choice').value") == ""


def test_what_is_of_all_groups_stays_and_says_so(opened):
    page = opened()
    page.open("#group=ramp")
    counts = "document.querySelector('#{}').closest('.scroll').previousSibling.textContent"
    assert "of all groups" in page.run(counts.format("wide"))
    assert "of all groups" not in page.run(counts.format("scores"))
    assert page.run("document.querySelector('label.group').innerText").startswith("group")


def test_an_anchor_to_what_a_group_hides_shows_it(opened):
    page = opened()
    page.open("#group=ramp&at=a-step")
    page.until("document.getElementById('a-step').checkVisibility()", "what the link names")
    assert "group" not in page.fragment()


def test_saved_tables_say_all_that_a_cell_says(opened):
    page = opened()
    page.run("document.querySelector('[aria-label=\"Save table marked\"]').click()")
    sheet = "document.querySelector('[aria-label=\"Save table marked\"]').nextSibling"
    page.run(f"{sheet}.querySelectorAll('button')[0].click()")
    with page.browser.saved("marked*.csv").open(newline="", encoding="utf-8") as file:
        heads, first, second = csv.reader(file)
    lag = ["step f_m lag [s]", "step f_m lag low [s]", "step f_m lag high [s]", "step f_m lag mark"]
    assert heads == ["row", *lag, "score", "score low", "score high", "change"]
    values = ["0.16593", "0.12", "Infinity", "★ ≥", "-3", "-54", "21.5", "+21 … +103 %"]
    assert first == ["a", *values]
    assert second == ["=1+1", "", "", "", "", "7", "", "", "-2+cmd|x"]
    labels = "document.querySelector('#marked th:nth-child(2) .sort').ariaLabel"
    assert page.run(labels) == "Sort by step f_m lag [s]"


def test_escape_in_a_chart_of_the_dialog_closes_it_and_back_does_not_open_it(opened):
    page = opened()
    page.click("#scores th:nth-child(3) button")
    page.until("location.hash.includes('sort')", "sorted")
    page.run("document.querySelector('[data-opens]').click()")
    page.until("Boolean(document.querySelector('#picked .view'))", "its chart", seconds=5)
    page.run("document.querySelector('#picked .view').focus()")
    page.browser.key("ArrowRight")
    page.browser.key("+")
    page.until("location.hash.includes('win.pick')", "zoomed")
    page.browser.key("Escape")
    page.until(f"!{DIALOG} && !location.hash.includes('pick')", "closed by one Escape")
    page.run("history.back()")
    page.until("!location.hash.includes('sort')", "one step back: not sorted")
    assert not page.run(DIALOG)


def test_two_bounds_look_different(opened):
    page = opened()
    style = "['stroke', 'strokeWidth', 'strokeDasharray'].map(n => getComputedStyle(p)[n])"
    for place in (".legend .role", ".area .line[data-who='']"):
        drawn = page.run(
            f"""[...document.querySelectorAll("{TRADEOFF} {place} path")].map(p => {style})"""
        )
        assert len(drawn) == 2 and drawn[0] != drawn[1]
    assert all(a != b for a, b in zip(*drawn, strict=True))


def test_a_browser_without_light_dark_has_light_colours(opened):
    page = opened()
    path = page.folder / "page.html"
    style, rest = path.read_text(encoding="utf-8").split("</style>", 1)
    path.write_text(style.replace("light-dark(", "unknown(") + "</style>" + rest, encoding="utf-8")
    page.browser.media("", prefers_color_scheme="dark")
    page.open()
    page.until("!!document.querySelector('.line[data-who=ekf] path.curve')", "drawn", seconds=5)
    colour = "getComputedStyle(document.querySelector('{}')).{}"
    assert page.run(colour.format("body", "backgroundColor")) == "rgb(255, 255, 255)"
    assert page.run(colour.format(".line[data-who=ekf] path.curve", "stroke")) == "rgb(35, 117, 72)"


def test_a_browser_too_old_says_so(opened):
    page = opened(
        lambda text: text.replace("new RegExp(text", "new NoSuch(text").replace(
            "window.CSS?.supports?.(", "window.CSS?.noSuch?.("
        )
    )
    words = page.run(
        "[...document.querySelectorAll('[role=alert]')].map(e => e.textContent).join()"
    )
    assert "too old for dark colours" in words
    assert page.run("document.querySelector('button.theme')") is None


def test_without_a_script_the_page_says_what_is_missing(opened):
    page = opened()
    page.browser.scripts(False)
    try:
        page.browser.open("about:blank")
        page.browser.open((page.folder / "page.html").as_uri())
        page.until("document.readyState === 'complete' && !!document.body", "there", seconds=5)
        assert "JavaScript is off" in page.run("document.body.innerText")
        assert page.run("document.querySelectorAll('.area .curve').length") > 20
        assert page.run("document.querySelector('svg.panel').getBoundingClientRect().height") > 100
        assert page.run("document.documentElement.scrollWidth <= innerWidth")
    finally:
        page.browser.scripts(True)


def test_the_keyboard_can_skip(opened):
    page = opened()
    page.browser.key("Tab")
    assert page.run("document.activeElement.textContent") == "Skip to content"
    assert page.run("document.activeElement.getBoundingClientRect().height") >= 24
    page.browser.key("Enter")
    page.until("document.activeElement.id === 'content'", "in the content")
    # A chart comes before its legend, though it stands below: nobody has to pass nine buttons.
    order = f"[...document.querySelectorAll('{TRADEOFF} :is(.view, button)')]"
    assert page.run(f"{order}[0].classList.contains('view')")
    assert page.run(f"{order}[0].offsetTop > {order}[1].offsetTop")


def test_a_chart_says_what_it_draws(opened):
    page = opened()
    said = page.run(f"document.querySelector('{TRADEOFF} .view').ariaLabel")
    assert said.startswith("Speed against variance: lag [s] over std of f_m [%]")
    assert "ekf" in said and "bound, others known" in said
    assert page.run("document.querySelectorAll('[role=application]').length") == 0


def test_a_phone_has_targets_and_hints(opened):
    page = opened()
    page.browser.size(390, 800, mobile=True)
    page.open()
    least = (
        "Math.min(...[...document.querySelectorAll('{}')].filter(e => e.checkVisibility()).map({}))"
    )
    both = "e => Math.min(e.getBoundingClientRect().height, e.getBoundingClientRect().width)"
    assert page.run(least.format(".sort", both)) >= 24
    page.click(".bar summary")
    page.until(least.format(".bar .sheet a", both) + " >= 24", "large enough to touch")
    scroll = "document.querySelector('#wide').closest('.scroll')"
    page.until(f"{scroll}.classList.contains('beyond')", "a hint that there is more")
    page.run(f"{scroll}.scrollLeft = 99999")
    page.until(f"!{scroll}.classList.contains('beyond')", "none at the end")
