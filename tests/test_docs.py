"""The documentation: tables are what commands wrote, and what is typed there are commands."""

import importlib.util
import re
import runpy
import shlex
import sys
import tomllib
from pathlib import Path

import pytest

from flexaxis.estimators.models.tables import model_from_tables
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario, find_suite, scenario_names
from flexaxis.experiments.cli import parser

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "docs"))  # where its scripts find each other


def loaded(name):
    """A script of docs/, as a module."""
    place = importlib.util.spec_from_file_location(f"docs_{name}", ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(place)
    sys.modules[f"docs_{name}"] = module
    place.loader.exec_module(module)
    return module


def page(name):
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tables():
    return loaded("tables")


@pytest.fixture(scope="module")
def written(tables):
    """The tables as they stand in the pages, by name: lines of cells."""
    found = {}
    for page in tables.PAGES:
        for name, text in loaded("making").MARK.findall((ROOT / page).read_text(encoding="utf-8")):
            lines = [line for line in text.splitlines() if line.startswith("|")]
            found[name] = [[c.strip() for c in re.split(r"(?<!\\)\|", x)[1:-1]] for x in lines]
            found[name, "text"] = text
    return found


def test_every_table_has_its_place_and_every_place_its_table(tables, written):
    assert {name for name in written if isinstance(name, str)} == set(tables.TABLES)


@pytest.mark.parametrize("name", ["catalogue", "scores", "tuned"])
def test_tables_of_what_there_is_are_up_to_date(tables, written, name):
    assert written[name, "text"] == tables.TABLES[name](), f"run: python docs/tables.py {name}"


def test_every_estimator_stands_in_the_table_of_lags(tables, written):
    head, _, *lines = written["equal-noise"]
    assert head[1:-1] == [f"{name}: lag [s], × bound" for name in tables.SWEPT]
    names = {line[0].split("`")[1] for line in lines}
    of_suite = {*find_suite("headline").estimators, tables.UKF}
    assert names == of_suite, "run: python docs/tables.py equal-noise"
    assert all(len(line) == len(head) for line in lines)


@pytest.mark.parametrize(("name", "first"), [("mismatch", "WRONG")])
def test_tables_of_scenarios_hold_those_they_are_of(tables, written, name, first):
    head, _, *lines = written[name]
    assert [line[0].strip("`") for line in lines] == list(getattr(tables, first))
    assert all(find_scenario(scenario).name == scenario for scenario in getattr(tables, first))
    assert all(len(line) == len(head) for line in lines)


MADE = re.compile(r"`(flexaxis|python docs/[\w/]+\.py)[^`]*`.*flexaxis \d+\.\d+")
LISTED = {"catalogue", "scores", "tuned", "three"}  # what the package has; the same without rows


def test_the_line_below_a_measured_table_names_command_and_version():
    tables = [
        (path.name, name, text)
        for path in ROOT.glob("docs/*.md")
        for name, text in loaded("making").MARK.findall(path.read_text(encoding="utf-8"))
        if name not in LISTED
    ]
    assert len(tables) > 20
    for page, name, text in tables:
        assert MADE.search(text), (page, name)


def test_what_python_on_a_page_imports_is_there():
    line = re.compile(r"^from (flexaxis[\w.]*) import (?:\(([^)]*)\)|(.+))$", re.MULTILINE)
    found = []
    for path in (ROOT / "README.md", *ROOT.glob("docs/**/*.md")):
        for block in re.findall(r"```python\n(.*?)```", path.read_text("utf-8"), re.DOTALL):
            for module, several, one in line.findall(block):
                names = [n.split(" as ")[0].strip() for n in (several or one).split(",")]
                found += [(path.name, module, name) for name in names if name]
    assert len(found) > 20
    for where, module, name in found:
        there = hasattr(importlib.import_module(module), name)
        assert there or importlib.util.find_spec(f"{module}.{name}"), (where, module, name)


@pytest.mark.parametrize(
    "path", sorted((ROOT / "tests/experiments").glob("*_tables.py")), ids=lambda path: path.stem
)
def test_what_makes_a_measured_table_finds_all_that_it_names(path, monkeypatch):
    monkeypatch.syspath_prepend(path.parent)
    runpy.run_path(str(path), run_name="imported")


def test_the_tables_of_friction_are_of_what_their_command_makes(tables):
    friction = loaded("friction")
    text = friction.PAGE.read_text(encoding="utf-8")
    found = {name: table.splitlines() for name, table in loaded("making").MARK.findall(text)}
    assert set(found) == set(friction.TABLES)
    first = {n: [x.split(" | ")[0].strip("| ") for x in found[n][2:-2]] for n in found}
    assert first["motions"] == list(friction.MOTIONS)
    names = [f"{cell.split('`')[1]}-v1" for cell in first["estimators"]]
    assert names == list(friction.SCENARIOS) and set(names) <= set(scenario_names())
    head = re.findall(r"`([\w-]+)`", found["estimators"][0])
    assert head == list(friction.ESTIMATORS) and set(head) <= set(REGISTRY)
    assert all(f"`python docs/friction.py {name}`" in found[name][-1] for name in found)


def test_the_tables_of_speed_are_of_what_their_command_makes(tables):
    speed = loaded("speed")
    found = dict(loaded("making").MARK.findall(speed.PAGE.read_text(encoding="utf-8")))
    assert set(found) == set(speed.TABLES)
    timed = [f"`{name}`" for name in REGISTRY]
    for name in ("estimators", "steps", "memory"):
        rows = [line.split(" | ")[0].strip("| ") for line in found[name].splitlines()[2:]]
        assert set(timed) <= set(rows), f"run: python docs/speed.py {name}"


def test_the_law_that_the_page_of_friction_writes_is_one():
    text = (ROOT / "docs" / "friction.md").read_text(encoding="utf-8")
    written = re.search(r"```toml\n(.*?)```", text, re.DOTALL)[1]
    model = model_from_tables(tomllib.loads(written))
    assert [(law.kind, law.names) for law in model.laws] == [("bristle", ("f_c", "sigma_0"))]


def typed():
    """Every command line of the documentation, as one types it, with the page that has it."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("models_mjcf/**/*.md")]
    for path in sorted(pages):
        for block in re.findall(r"```sh\n(.*?)```", path.read_text("utf-8"), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                words = shlex.split(line, comments=True)
                if words[:1] == ["flexaxis"]:
                    yield path.relative_to(ROOT).as_posix(), words[1:]


TYPED = list(typed())


@pytest.mark.parametrize(("page", "words"), TYPED, ids=[" ".join(w)[:60] for _, w in TYPED])
def test_every_command_of_the_documentation_is_one(page, words, capsys):
    """What stands behind the first of `;`, `|`, `&&`, `>` is the shell's."""
    stop = next(
        (i for i, word in enumerate(words) if word in {";", "|", "&&", "&", ">", "||"}), None
    )
    words = [word.rstrip(";") for word in words[:stop]]
    try:
        parser().parse_args(words)
    except SystemExit as error:
        assert error.code == 0 and "--help" in words, f"{page}: {capsys.readouterr().err}"


def test_the_documentation_has_commands():
    assert len(TYPED) > 40 and len({page for page, _ in TYPED}) > 8


FROM_INDEX = re.compile(
    r"\b(?:pipx?|uv|uvx|conda|mamba|poetry)\b[^\n|#]*\b(?:install|add|run|uvx)\b[^\n|#]*?"
    r"[ \t\"'`]flexaxis(?![\w/.-])"
)


@pytest.mark.parametrize(
    ("line", "found"),
    [("pip install flexaxis", True), ("pip install 'flexaxis[demo]'", True),
     ("python -m pip install -U flexaxis==0.1.0", True), ("uv add flexaxis", True),
     ("pip install -e '.[demo]' in the folder of flexaxis", False),
     ("pip install -e .\nflexaxis run smoke", False),
     ('pip install "git+https://git.example.org/flexaxis.git"', False)],
)  # fmt: skip
def test_what_is_taken_for_the_name_on_the_index(line, found):
    assert bool(FROM_INDEX.search(line.replace("folder of flexaxis", ""))) == found


def test_nothing_says_to_install_a_name_that_nobody_owns():
    """Whoever takes the name on the package index would have his code run by our readers."""
    found = []
    for path in ROOT.rglob("*"):
        inside = path.relative_to(ROOT)
        if path.suffix not in {".py", ".md", ".yml", ".toml", ".html"} or not path.is_file():
            continue
        if {".venv", ".git", "results"} & {*inside.parts} or inside == Path("tests/test_docs.py"):
            continue
        text = path.read_text(encoding="utf-8").replace("folder of flexaxis", "")
        found += [f"{inside}: {hit[0]}" for hit in FROM_INDEX.finditer(text)]
    assert not found
