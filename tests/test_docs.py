"""The documentation: tables are what commands wrote, and what is typed there are commands."""

import importlib.util
import re
import shlex
import sys
from pathlib import Path

import pytest

from flexaxis.experiments.cli import parser

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "docs"))  # where its scripts find each other


TABLE = re.compile(r"<!-- table: [\w-]+ -->\n(.*?)<!-- end -->", re.DOTALL)
MADE = re.compile(r"`(flexaxis|python docs/[\w/]+\.py)[^`]*`.*flexaxis \d+\.\d+")


def test_the_line_below_a_measured_table_names_command_and_version():
    pages = [path.read_text(encoding="utf-8") for path in ROOT.glob("docs/*.md")]
    tables = [text for page in pages for text in TABLE.findall(page)]
    measured = [text for text in tables if text.startswith("|")]
    assert all(MADE.search(text) for text in measured)


def test_what_python_on_a_page_imports_is_there():
    line = re.compile(r"^from (flexaxis[\w.]*) import (?:\(([^)]*)\)|(.+))$", re.MULTILINE)
    found = []
    for path in (ROOT / "README.md", *ROOT.glob("docs/**/*.md")):
        for block in re.findall(r"```python\n(.*?)```", path.read_text("utf-8"), re.DOTALL):
            for module, several, one in line.findall(block):
                names = [n.split(" as ")[0].strip() for n in (several or one).split(",")]
                found += [(path.name, module, name) for name in names if name]
    assert found
    for where, module, name in found:
        there = hasattr(importlib.import_module(module), name)
        assert there or importlib.util.find_spec(f"{module}.{name}"), (where, module, name)


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
