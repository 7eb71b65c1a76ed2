"""The notebooks: they run, stand as their sources say, import what there is, and tell no paths."""

import ast
import importlib
import re
import sys
import warnings
from pathlib import Path

import pytest

import flexaxis as fx
from flexaxis.experiments.cli import parser
from flexaxis.experiments.commands.options import COMMANDS

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NAMES = ["developer", "engineer", "researcher", "teacher"]
LARGEST = 200_000  # bytes of a notebook
PATHS = re.compile(r"(?<![\w.])(/tmp|/home|/root|/usr|/work|/Users|~/|[A-Z]:\\)")


@pytest.fixture(scope="module")
def build():
    place = importlib.util.spec_from_file_location("build_notebooks", FOLDER / "build.py")
    module = importlib.util.module_from_spec(place)
    with warnings.catch_warnings():  # of libraries, at their import
        warnings.simplefilter("ignore")
        place.loader.exec_module(module)
    return module


@pytest.fixture(params=NAMES)
def name(request):
    return request.param


def kept(name):
    import nbformat

    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def outputs(book):
    return [out for cell in book.cells for out in cell.get("outputs", [])]


def pictures(book):
    return sum("image/png" in out.get("data", {}) for out in outputs(book))


def code(name):
    """The Python of a source, without commands of the notebook."""
    return (FOLDER / f"{name}.py").read_text(encoding="utf-8")


def test_there_are_four_and_the_page_names_them(build):
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [path.stem for path in build.SOURCES] == NAMES
    assert sorted(re.findall(r"\((\w+)\.ipynb\)", page)) == NAMES


def test_it_stands_as_its_source_says(build, name):
    """Else somebody changed the one and not the other: make notebooks."""
    told = build.source(FOLDER / f"{name}.py")
    assert [(c.cell_type, c.source) for c in kept(name).cells] == [
        (c.cell_type, c.source) for c in told.cells
    ]


def test_it_can_be_read_without_running_it(name):
    book = kept(name)
    assert (FOLDER / f"{name}.ipynb").stat().st_size < LARGEST
    assert pictures(book) >= 2
    assert not [out for out in outputs(book) if out.output_type == "error"]
    assert not [out for out in outputs(book) if out.get("name") == "stderr"]
    said = [str(out.get("text", "")) + str(out.get("data", {}).get("text/plain", ""))
            + str(out.get("data", {}).get("text/html", "")) for out in outputs(book)]  # fmt: skip
    assert not PATHS.findall("\n".join(said)) and "\x1b" not in "".join(said)


def test_what_it_imports_is_there(name):
    tree = ast.parse(code(name))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, alias.name) for alias in node.names), node.module
        elif isinstance(node, ast.Import):
            assert all(importlib.util.find_spec(alias.name) for alias in node.names)
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "fx":
            assert node.attr in dir(fx)


def test_its_commands_and_links_are_there(name):
    text, _ = code(name), parser()
    for words in re.findall(r"^# !flexaxis (\w+)", text, re.MULTILINE):
        assert words in COMMANDS
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        assert link.startswith("http") or (FOLDER / link).exists(), link


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
