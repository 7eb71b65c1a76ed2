"""Every page but that of a run, in Chromium: it opens, sorts, tells values, and fits the screen."""

import re
import shutil
import time

import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.paper.claim import gather
from flexaxis.experiments.paper.data import Size
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.paper.reproduce import decide, render

pytestmark = pytest.mark.browser

STUDY = """
name = "sizes"
scenario = "fm_step-v1"
estimators = ["rpem-forgetting", "glr"]
seeds = 2
[sweep]
"fault[0].factor" = [1.25, 1.5, 2.0]
"rpem-forgetting.forgetting" = [0.98, 0.995]
"""
PLACE = """(() => { const e = document.querySelector("figure.chart .view");
  e.scrollIntoView({block: "center"});
  const b = e.querySelector("svg.panel").getBoundingClientRect();
  return [b.left, b.top, b.width, b.height]; })()"""
TIP = "[...document.querySelectorAll('.view .tip:not([hidden])')].map(e => e.innerText).join()"
HEADS = "[...document.querySelector('table.live').tHead.rows[0].cells]"
COLUMN = """[...document.querySelector("table.live").tBodies[0].rows].map(
  row => row.cells[{n}].dataset.value).filter(Boolean)"""
BEYOND = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Pages by name, each made by its command."""
    home = tmp_path_factory.mktemp("pages")
    days, axis = home / "days", home / "days" / "axis.toml"
    (home / "sizes.toml").write_text(STUDY, encoding="utf-8")

    def run(*words):
        assert main([str(word) for word in words]) in {0, 1, 3}, words

    run("days", "--days", "10", "--duration", "8", "--wear", "f_c=+20%", "--from-day", "5",
        "--units", "deg,A", "-o", days)  # fmt: skip
    first, second = days / "2026-01-01.csv", days / "2026-01-02.csv"
    run("import", first, "-o", home / "import.nc")
    run("identify", home / "import.nc", "--model", axis, "--validate", second, "-o",
        home / "identify.toml")  # fmt: skip
    run("track", days / "2026-01-09.csv", "--model", home / "identify.toml", "--identify", "f_m",
        "-o", home / "track.nc")  # fmt: skip
    run("trend", days, "--model", home / "identify.toml", "--covariate", "temp", "--free", "f_c",
        "--free", "f_m", "-o", home / "trend")  # fmt: skip
    run("study", home / "sizes.toml", "-o", home / "study", "--jobs", "1")
    run("compare", "fm_step-v1", "--base", "rpem-forgetting", "--candidate", "frozen", "--seeds",
        "3", "--jobs", "1", "-o", home / "compare")  # fmt: skip
    for name in ("trend", "study", "compare"):
        shutil.copy(home / name / "report.html", home / f"{name}.html")
    found = gather(Size(first=0, runs=2, long=2, few=2))  # without the pictures as files
    charts = {name: figure(found) for name, figure in FIGURES.items()}
    paper = render(found, decide(found), charts, "flexaxis paper")
    (home / "paper.html").write_text(paper, encoding="utf-8")
    return home


CHARTED = ("import", "identify", "track", "trend", "study", "compare")


@pytest.fixture(params=[*CHARTED, "paper"])
def opened(request, chromium, pages):
    """A page as it is at first."""
    show(chromium, pages / f"{request.param}.html")
    return chromium


def show(browser, path):
    browser.errors.clear()
    browser.requests.clear()
    browser.media()
    browser.size(1400, 1000)
    browser.open("about:blank")
    browser.open(path.as_uri())
    browser.wait("document.documentElement.dataset.ready", seconds=20, what="ready")


def test_it_asks_nobody_and_makes_no_mistake(opened, request):
    opened.wait("document.querySelector('figure svg') !== null", seconds=5, what="a picture")
    assert opened.errors == []
    outside = [url for url in opened.requests if not url.startswith(("file:", "about:", "data:"))]
    assert outside == []
    finding = opened.run("document.querySelector('.verdict').innerText")
    assert len(finding) > 10, "the first screen says what was found"
    assert opened.run("document.querySelector('.verdict').getBoundingClientRect().bottom") < 1000
    first = "document.querySelector('figure.chart')"
    if request.node.callspec.id == "paper":  # begins with model and equations, as the paper does
        return
    assert opened.run(f"!{first} || {first}.getBoundingClientRect().top < 1000")


def test_a_table_sorts(opened):
    column = opened.run(f"{HEADS}.findIndex((head, i) => i > 0 && head.querySelector('button'))")
    before = opened.run(COLUMN.format(n=column))
    for way in ("ascending", "descending"):
        opened.run(f"{HEADS}[{column}].querySelector('button').click()")
        sorted_ = f"{HEADS}[{column}].ariaSort === '{way}'"
        opened.wait(sorted_, seconds=2, what=way)
        cells = opened.run(COLUMN.format(n=column))
        assert sorted(cells) == sorted(before)
        values = [key(cell) for cell in cells]
        assert values == sorted(values, reverse=way == "descending")


def key(text):
    """What a cell is sorted by: numbers by size, before words."""
    try:
        return (0, float(text), "") if text else (1, 0.0, "")
    except ValueError:
        return (1, 0.0, text.lower())


@pytest.mark.parametrize("name", CHARTED)
def test_a_chart_tells_its_values(pages, chromium, name):
    show(chromium, pages / f"{name}.html")
    opened = chromium
    opened.wait(
        "document.querySelector('figure.chart svg.panel') !== null", seconds=5, what="a chart"
    )
    left, top, width, height = opened.run(PLACE)
    end = time.monotonic() + 3
    share = 0.3
    while not (said := opened.run(TIP)):
        assert time.monotonic() < end, "no value is told under the mouse"
        opened.mouse((left + share * width, top + 0.4 * height))
        share = 0.3 + (share + 0.07) % 0.5
    assert re.search(r"\d", said), said


@pytest.mark.parametrize(("width", "scheme"), [(1400, "dark"), (390, "light"), (390, "dark")])
def test_it_fits_the_screen(opened, width, scheme):
    opened.media(prefers_color_scheme=scheme)
    opened.size(width, 900, mobile=width < 500)
    opened.wait(f"window.innerWidth === {width}", seconds=5, what="the width")
    back = opened.run("getComputedStyle(document.body).backgroundColor")
    assert (back == "rgb(255, 255, 255)") == (scheme == "light")
    assert opened.run(BEYOND) <= 0
    table = opened.run(
        "[...document.querySelectorAll('table')].filter(t => !t.closest('.scroll') "
        "&& t.scrollWidth > t.parentElement.clientWidth).length"
    )
    assert table == 0, "a table is cut"
