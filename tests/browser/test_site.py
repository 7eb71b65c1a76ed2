"""The site in a real browser, opened as a file: it asks nobody, finds words, fits a phone."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.browser

ROOT = Path(__file__).parents[2]
PAGES = ("index", "model", "gallery", "search", "notebooks/engineer", "reference/api")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A built site."""
    pytest.importorskip("furo", reason="pip install -e '.[docs]'")
    folder = tmp_path_factory.mktemp("built") / "site"
    words = [sys.executable, ROOT / "docs" / "site" / "build.py", "-o", folder]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    return folder


def ready(browser, address):
    browser.open(address)
    browser.wait("document.readyState == 'complete'", seconds=30, what=address)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_asks_nobody_and_fits(browser, site, page):
    for width, mobile in ((1400, False), (390, True)):
        browser.size(width, 900, mobile=mobile)
        ready(browser, f"{(site / page).as_uri()}.html")
        assert browser.run("document.documentElement.scrollWidth") <= width, page
    asked = {address.partition(":")[0] for address in browser.requests}
    assert asked <= {"file", "data"} and "file" in asked
    assert browser.errors == []


def test_search_finds_words_in_a_file(browser, site):
    ready(browser, f"{(site / 'search.html').as_uri()}?q=cogging")
    found = "[...document.querySelectorAll('#search-results li a')].map(a => a.innerText).join()"
    browser.wait(f"{found}.includes('Friction')", seconds=30, what="Friction among the results")
    where = browser.run("document.querySelector('#search-results li a').getAttribute('href')")
    assert (site / where.partition("#")[0].partition("?")[0]).exists()


def test_formulas_have_their_font_and_their_size(browser, site):
    ready(browser, (site / "model.html").as_uri())
    browser.wait("document.fonts.status == 'loaded'", seconds=30, what="fonts")
    assert browser.run("document.fonts.check('16px \"Site Math\"')")
    assert browser.run("[...document.fonts].some(f => f.family.includes('Site Math'))")
    sizes = browser.run(
        "[...document.querySelectorAll('math')].map(m => m.getBoundingClientRect().height)"
    )
    assert len(sizes) > 50 and all(height > 5 for height in sizes)
