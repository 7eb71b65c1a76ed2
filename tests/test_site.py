"""The site: every page has its place, and the reference has everything."""

import importlib.util
import re
from pathlib import Path

import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import scenario_names, suite_names
from flexaxis.experiments.scoring.score_table import SCORES

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Pages of reference by name, as the build writes them."""
    where = importlib.util.spec_from_file_location("reference", ROOT / "docs/site/reference.py")
    reference = importlib.util.module_from_spec(where)
    where.loader.exec_module(reference)
    folder = tmp_path_factory.mktemp("made")
    reference.write(folder)
    return {path.stem: path.read_text(encoding="utf-8") for path in folder.glob("*.md")}


def test_every_page_of_the_docs_has_one_place():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    trees = "\n".join(re.findall(r"```\{toctree\}(.*?)```", index, re.DOTALL)).splitlines()
    written = [path for kind in ("md", "ipynb") for path in (ROOT / "docs").glob(f"**/*.{kind}")
               if "made" not in path.parts and path.name != "index.md"]  # fmt: skip
    for path in written:
        name = path.relative_to(ROOT / "docs").with_suffix("").as_posix()
        assert trees.count(name) == 1, f"give {name} a place in docs/index.md"


def test_the_reference_has_everything(pages):
    assert all(f"`{name}`" in pages["catalogue"] for name in (*scenario_names(), *suite_names()))
    assert all(f"## {name}\n" in pages["estimators"] for name in REGISTRY)
    assert all(f"| `{name}` |" in pages["scores"] for name in SCORES)
    assert pages["commands"].count("usage: flexaxis ") == pages["commands"].count("## flexaxis ")


def test_the_readme_is_short_and_begins_with_two_commands():
    text = (ROOT / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= 120
    first = re.search(r"```sh\n(.*?)```", text, re.DOTALL)[1].splitlines()
    assert [line.split("  ")[0] for line in first] == ["make bench", "make test"]
