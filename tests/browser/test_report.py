"""A report in a real browser: what its script does, and that everybody can read it."""

import pytest

from flexaxis.experiments.reporting import page
from tests.experiments.test_reports import VERDICT

pytestmark = pytest.mark.browser
ROWS = "[...document.querySelectorAll('tbody tr')].map(row => row.cells[0].innerText).join()"


@pytest.fixture
def report(browser, tmp_path):
    """The page of a comparison of two scores, opened."""
    (row,) = VERDICT["rows"]
    rows = [row, row | {"text": ["s0", *row["text"][1:]]}]
    path = tmp_path / "report.html"
    path.write_text(page.comparison(VERDICT | {"rows": rows}), encoding="utf-8")
    browser.open(path.as_uri())
    browser.wait("document.readyState == 'complete'", "page")
    return browser


def test_a_table_is_sorted(report):
    assert report.run(ROWS) == "s1,s0"
    report.run("document.querySelector('button.sort').click()")
    assert report.run(ROWS) == "s0,s1" and report.errors == []


@pytest.mark.parametrize("width", [1400, 390])
def test_it_fits_asks_nobody_and_has_nothing_serious(report, axe, width):
    report.size(width, 900)
    assert report.run("document.documentElement.scrollWidth") <= width
    assert {address.partition(":")[0] for address in report.requests} <= {"file", "data"}
    assert axe(report) == []
    report.click("Dark", "button")
    assert axe(report) == []
