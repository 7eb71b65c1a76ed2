"""The notebooks: they run, stand as their sources say, import what there is, and tell no paths."""

import importlib
import re
import sys
import warnings
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NAMES = ["developer", "engineer", "researcher", "teacher"]


@pytest.fixture(scope="module")
def build():
    place = importlib.util.spec_from_file_location("build_notebooks", FOLDER / "build.py")
    module = importlib.util.module_from_spec(place)
    with warnings.catch_warnings():  # of libraries, at their import
        warnings.simplefilter("ignore")
        place.loader.exec_module(module)
    return module


def kept(name):
    import nbformat

    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def outputs(book):
    return [out for cell in book.cells for out in cell.get("outputs", [])]


def pictures(book):
    return sum("image/png" in out.get("data", {}) for out in outputs(book))


def test_there_are_four_and_the_page_names_them(build):
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [path.stem for path in build.SOURCES] == NAMES
    assert sorted(re.findall(r"\((\w+)\.ipynb\)", page)) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_it_stands_as_its_source_says(build, name):
    """Else somebody changed the one and not the other: make notebooks."""
    told = build.source(FOLDER / f"{name}.py")
    assert [(c.cell_type, c.source) for c in kept(name).cells] == [
        (c.cell_type, c.source) for c in told.cells
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_it_runs(build, name, tmp_path):
    """From top to bottom, in an empty folder, with as many pictures as it is kept with."""
    with warnings.catch_warnings():  # of what runs the kernel
        warnings.simplefilter("ignore")
        book = build.run(FOLDER / f"{name}.py", tmp_path)
    assert pictures(book) == pictures(kept(name))
    assert str(tmp_path) not in str(outputs(book))
    assert str(Path(sys.prefix)) not in str(outputs(book))
