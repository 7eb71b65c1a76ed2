"""The site: no page without a place, no reference that lacks a thing, no link into nothing."""

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import flexaxis as fx
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import scenario_names, suite_names
from flexaxis.experiments.catalogue.names import GROUPS
from flexaxis.experiments.cli import commands
from flexaxis.experiments.scoring.score_table import SCORES

ROOT = Path(__file__).parents[1]
SITE = ROOT / "docs" / "site"
MODULES = ("api", "gallery", "pages", "reference", "sources", "staging")


@pytest.fixture(scope="module")
def site():
    """The modules that build the site, by name."""
    sys.path.insert(0, str(SITE))
    try:
        yield {name: import_module(name) for name in MODULES}
    finally:
        sys.path.remove(str(SITE))
        for name in MODULES:
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def staged(site, tmp_path_factory):
    """All sources of the site but the figures of the gallery."""
    folder = tmp_path_factory.mktemp("source")
    found = site["staging"].Staged(folder)
    found.fill()
    site["reference"].write(folder)
    site["api"].write(folder)
    site["sources"].write(folder, found.shown)
    (folder / "gallery.md").write_text(site["gallery"].page(site["gallery"].examples()), "utf-8")
    return folder


def headings(path, level):
    return re.findall(rf"^{'#' * level} (.+)$", path.read_text("utf-8"), re.MULTILINE)


def test_every_page_of_the_docs_has_one_place(site):
    pages = site["pages"]
    assert pages.unplaced() == [], "give it a section in docs/site/pages.py"
    named = [path for section in pages.SECTIONS for path in section.pages]
    assert len(named) == len(set(named))
    assert len(set(pages.written().values())) == len(pages.written())


def test_a_page_without_a_place_is_seen(site, monkeypatch, tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "lonely.md").touch()
    monkeypatch.setattr(site["pages"], "ROOT", tmp_path)
    assert site["pages"].unplaced() == ["docs/lonely.md"]


def test_every_place_of_the_navigation_has_its_page(site, staged):
    wanted = [p for section in site["pages"].SECTIONS for p in section.pages]
    names = {site["pages"].name_of(path) for path in wanted}
    there = {p.relative_to(staged).with_suffix("").as_posix() for p in staged.rglob("*.*")}
    assert names <= there


def test_every_link_of_a_page_leads_to_a_page(staged):
    for path in staged.rglob("*.md"):
        text = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", path.read_text("utf-8"), flags=re.DOTALL)
        for target in re.findall(r"\]\(([^()\s]+)\)", text):
            place = target.partition("#")[0]
            if place and not re.match(r"[a-z]+:", place) and not place.startswith("gallery/"):
                assert (path.parent / place).exists(), f"{path.relative_to(staged)}: {target}"


def test_a_link_into_nothing_stops_the_build(site, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"docs/gate\.md: its link to none\.md"):
        site["staging"].Staged(tmp_path).rewritten("see [there](none.md)", "docs/gate.md")


def test_links_to_files_of_the_repository_lead_to_pages_that_show_them(site, staged, tmp_path):
    one = site["staging"].Staged(tmp_path)
    said = one.rewritten(
        "[code](../estimators/protocol.py), [`rules`](../estimators)", "docs/gate.md"
    )
    assert said == "[code](source/estimators/protocol.py.md), [`rules`](source/estimators.md)"
    assert one.shown == {"estimators/protocol.py", "estimators"}
    assert one.rewritten("`[a](b.md)`", "docs/gate.md") == "`[a](b.md)`"
    shown = (staged / "source" / "experiments" / "scoring" / "score_table.py.md").read_text("utf-8")
    assert (ROOT / "experiments" / "scoring" / "score_table.py").read_text("utf-8") in shown


def test_the_reference_of_commands_has_every_command(staged):
    page = staged / "reference" / "commands.md"
    assert set(headings(page, 3)) == {f"flexaxis {name}" for name in commands()}
    assert page.read_text("utf-8").count("usage: flexaxis ") == len(commands())


def test_the_reference_of_scenarios_has_every_scenario_once(staged):
    found = [
        name
        for group in GROUPS
        for name in headings(staged / "reference" / f"scenarios-{group}.md", 2)
    ]
    assert sorted(found) == sorted(scenario_names())
    text = (staged / "reference" / "scenarios.md").read_text("utf-8")
    assert all(f"`{name}`" in text for name in (*scenario_names(), *suite_names()))


def test_the_references_of_estimators_and_scores_have_all(staged):
    assert headings(staged / "reference" / "estimators.md", 2) == list(REGISTRY)
    assert headings(staged / "reference" / "scores.md", 2) == list(SCORES)


def test_the_reference_of_python_has_the_whole_front_door(site):
    told = [name for names in site["api"].FRONT.values() for name in names]
    assert sorted([*told, "estimators", "__version__"]) == sorted(fx.__all__)
    assert all(f"flexaxis.{name}" in site["api"].front_page() for name in told)


def test_labs_keep_their_prose_and_their_code(site, staged):
    for lab in site["pages"].labs():
        source = (ROOT / lab).read_text("utf-8")
        page = staged / "labs" / f"{Path(lab).stem}.md"
        assert headings(page, 2) == re.findall(r"^# %% (.+)$", source, re.MULTILINE)
        code = "\n".join(re.findall(r"```python\n(.*?)\n```", page.read_text("utf-8"), re.DOTALL))
        lines = [line for line in source.splitlines() if line and not line.startswith("#")]
        assert set(lines[1:]) <= set(code.splitlines())


def test_every_figure_of_the_gallery_has_title_place_and_code(site):
    gallery = site["gallery"]
    known = gallery.examples()
    assert [each.name for each in known] == list(gallery.ORDER)
    assert all(each.title and "import flexaxis as fx" in each.code for each in known)
    assert all(len(each.code.splitlines()) <= 30 for each in known)


def test_the_readme_is_short_and_begins_with_two_commands():
    text = (ROOT / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= 120
    first = re.search(r"```sh\n(.*?)```", text, re.DOTALL)[1].splitlines()
    assert [line.split("  ")[0] for line in first] == ["make bench", "make test"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The site as `make site` builds it."""
    pytest.importorskip("furo", reason="pip install -e '.[docs]'")
    folder = tmp_path_factory.mktemp("built") / "site"
    done = subprocess.run(
        [sys.executable, SITE / "build.py", "-o", folder],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder


@pytest.mark.slow
def test_the_site_is_whole(built):
    index = (built / "searchindex.js").read_text("utf-8")
    assert all(word in index for word in ("lab7", "glr", "cogging", "scenarios-wear"))


@pytest.mark.slow
def test_every_page_has_its_figures_formulas_and_no_markup_left_over(built):
    model = (built / "model.html").read_text("utf-8")
    assert model.count("<math") > 50 and "\\frac" not in re.sub(r"<annotation.*?</", "", model)
    pictures = {path.stem for path in (built / "_images").glob("*.png")}
    drawn = {f"gallery-{path.stem}" for path in (ROOT / "docs" / "gallery").glob("*.py")}
    assert drawn <= pictures
    notebook = (built / "notebooks" / "teacher.html").read_text("utf-8")
    assert "cell_output" in notebook and "_images" in notebook
    for page in built.rglob("*.html"):
        if "_modules" not in page.parts and "source" not in page.parts:
            prose = re.sub(
                r"<(pre|script|code).*?</\1>", "", page.read_text("utf-8"), flags=re.DOTALL
            )
            assert "]]" not in prose and "](" not in prose and "$$" not in prose, page


def test_a_folder_that_is_no_site_is_left_alone(tmp_path):
    pytest.importorskip("furo", reason="pip install -e '.[docs]'")
    (tmp_path / "thesis.tex").touch()
    done = subprocess.run(
        [sys.executable, SITE / "build.py", "-o", tmp_path],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 2 and "is no site" in done.stderr
    assert (tmp_path / "thesis.tex").exists()
