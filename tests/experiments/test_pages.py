"""Every page: one environment, one base, one style sheet; readable without a network."""

import ast
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pytest

from flexaxis.experiments.reporting.page import render
from flexaxis.experiments.reporting.run import page as run_page
from flexaxis.experiments.reporting.study import page as study_page

EXPERIMENTS = Path(__file__).parents[2] / "experiments"
BASE = "reporting/templates/page.html"
PAGES = sorted(
    path.relative_to(EXPERIMENTS).as_posix()
    for path in EXPERIMENTS.glob("*/templates/*.html")
    if path.name not in ("page.html", "equations.html", "table.html", "pick.html")
)
LOG = {
    "title": "t", "command": "c", "version": "1", "remarks": (), "tables": (), "charts": (),
    "finding": SimpleNamespace(kind="ok", text="f"),
}  # fmt: skip


def imported(path):
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return {node.module for node in nodes if isinstance(node, ast.ImportFrom)}


def test_there_is_one_environment():
    users = [path for path in EXPERIMENTS.rglob("*.py") if "jinja2" in imported(path)]
    assert [path.name for path in users] == ["page.py"], "make pages by reporting.page.render"


@pytest.mark.parametrize("template", PAGES)
def test_a_page_brings_no_style_of_its_own(template):
    text = (EXPERIMENTS / template).read_text(encoding="utf-8")
    assert text.startswith(f'{{% extends "{BASE}" %}}')
    assert "<style" not in text and "http" not in text


class Classes(HTMLParser):
    """The classes of elements."""

    def __init__(self):
        super().__init__()
        self.found = set()

    def handle_starttag(self, tag, attrs):
        self.found |= set(dict(attrs).get("class", "").split())


def test_every_class_has_a_style():
    sheet = (EXPERIMENTS / "reporting/templates/page.css").read_text(encoding="utf-8")
    styled = set(re.findall(r"\.([a-z][a-z-]*)", sheet))
    for template in PAGES:
        text = (EXPERIMENTS / template).read_text(encoding="utf-8")
        parser = Classes()
        # What is made up by the template is a class of a row, and stands in quotes there.
        parser.feed(re.sub(r"{[{%].*?[%}]}", "", text))
        assert parser.found <= styled, template


@pytest.mark.parametrize(
    ("module", "kind", "known"),
    [
        (run_page, "Chart", "CHARTS"),
        (study_page, "Chart", "CHARTS"),
        (study_page, "Table", "TABLES"),
    ],
)
def test_every_figure_is_on_its_page(module, kind, known):
    made = [
        name
        for name, each in vars(module).items()
        if getattr(each, "__annotations__", {}).get("return") == f"Iterator[{kind}]"
    ]
    assert made
    for name in made:
        place = f"name it in {known} at the end of {Path(module.__file__).name}"
        assert getattr(module, name) in getattr(module, known), f"{name} is on no page: {place}"


def test_text_is_escaped_and_what_is_missing_is_an_error():
    html = render("logs/templates/log.html", LOG | {"title": "<script>a & b</script>"})
    assert "<h1>&lt;script&gt;a &amp; b&lt;/script&gt;</h1>" in html and "<script>a" not in html
    with pytest.raises(LookupError, match="version"):
        render("logs/templates/log.html", {k: v for k, v in LOG.items() if k != "version"})
