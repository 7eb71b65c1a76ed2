"""The report of a run in Chromium: what is shown first, at the fault, and of a single run."""

import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.run import page as run_page
from flexaxis.experiments.results import pooled
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.studies.benchmark import Benchmark, benchmark

pytestmark = pytest.mark.browser

ESTIMATORS = ("rpem-forgetting", "glr", "frozen")
SHOWN = """[...document.querySelectorAll("input[data-toggle]")]
    .filter(box => box.checked).map(box => box.dataset.toggle).join()"""
ALL = "document.querySelector('details.menu .pair button:first-child').click()"


@pytest.fixture(scope="module")
def page(chromium, tmp_path_factory):
    """The report of a short run of three estimators, of which two are shown at first."""
    folder = tmp_path_factory.mktemp("run")
    fault = [{"kind": "step", "parameter": "f_m", "at": 6.0, "factor": 1.5}]
    scenario = find_scenario("fm_step-v1").override(
        {"name": "short", "duration": 8.0, "burn_in": 1.0, "fault": fault}
    )
    study = Study("t", (scenario,), ESTIMATORS, (1000, 1001, 1002))
    benchmark(Benchmark(study, title="t", command="flexaxis run short.toml"), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_page, "AT_FIRST", 2)
        html = run_page.render(pooled.load(folder))
    (folder / "few.html").write_text(html, encoding="utf-8")
    chromium.size(1400, 900)
    return folder / "few.html"


@pytest.fixture
def opened(chromium, page):
    """A function that opens the report at a fragment of its address."""

    def go(fragment=""):
        chromium.open("about:blank")
        chromium.open(page.as_uri() + fragment)
        chromium.wait("document.documentElement.dataset.ready", seconds=20, what="ready")
        return chromium

    return go


def test_those_beyond_the_first_are_there_and_hidden(opened):
    browser = opened()
    assert browser.run(SHOWN) == "rpem-forgetting,glr"
    rows = "[...document.querySelectorAll('tr[data-who=frozen]')]"
    assert browser.run(f"{rows}.length > 0 && {rows}.every((r) => !r.classList.contains('gone'))")
    assert "Charts draw 2 of 3 estimators at first, those with the shortest" in browser.run(
        "document.body.textContent"
    )
    browser.run(ALL)  # the button that shows all
    browser.wait(f"{SHOWN}.includes('frozen')", seconds=3, what="all are shown")
    address = browser.run("location.hash")
    assert "hide" in address
    assert opened(address).run(SHOWN) == "rpem-forgetting,glr,frozen"
    assert opened("#hide=glr").run(SHOWN) == "rpem-forgetting,frozen"
    assert not browser.errors


def test_the_fault_stands_beside_the_whole_run(opened):
    browser = opened("#at=curves-short")
    views = "document.querySelectorAll('#curves-short .view').length"
    browser.wait(f"{views} === 2", seconds=5, what="two views")
    words = "[...document.querySelectorAll('#curves-short .view')].map(v => v.innerText)"
    near, whole = browser.run(words)
    assert near.startswith("at the fault") and whole.startswith("whole run")


def test_a_point_opens_its_run_with_the_line_that_repeats_it(opened):
    browser = opened("#at=runs-short")
    points = "document.querySelectorAll('#runs-short .area .line[data-pick]').length"
    browser.wait(f"{points} === 6", seconds=5, what="two estimators on three seeds")
    browser.run("document.querySelector('[data-opens=\"short/glr/1001\"]').click()")
    text = browser.wait(
        "document.querySelector('dialog[open]')?.innerText", seconds=3, what="opened"
    )
    assert "glr on short, seed 1001" in text and "Found: at 6." in text
    assert "flexaxis run short.toml --estimator glr --seeds 1001:1002" in text
    panels = "document.querySelectorAll('dialog .view svg.panel').length"
    browser.wait(f"{panels} >= 8", seconds=5, what="three parameters and the residual")
    assert "pick" in browser.run("location.hash") and not browser.errors
    again = opened(browser.run("location.hash"))
    shown = "document.querySelector('dialog[open]')?.innerText"
    assert "seed 1001" in again.wait(shown, seconds=5, what="opened again")


def test_the_first_screen_holds_question_and_answer(opened):
    browser = opened()
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    low = "document.querySelector('{}').getBoundingClientRect().bottom"
    assert browser.run(low.format("#at-a-fault .panel")) < 900  # the picture is whole
    assert browser.run("document.querySelector('h2').getBoundingClientRect().top") < 400
