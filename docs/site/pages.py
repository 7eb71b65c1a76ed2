"""The pages of the site and their order: what file of the repository is which page, and where.

A page of `docs/` that no section names fails the build and `tests/test_site.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Section:
    """A part of the navigation.

    Attributes
    ----------
    title : str
    pages : tuple of str
        Files of the repository, or names after `made/` of pages that the build writes.
    """

    title: str
    pages: tuple[str, ...]


FIRST = "README.md"
SECTIONS = (
    Section(
        "Begin",
        (
            "docs/python.md",
            "made/gallery",
            "docs/notebooks/README.md",
            "docs/running.md",
            "docs/report.md",
        ),
    ),
    Section(
        "Your own axis",
        ("docs/logs.md", "docs/trend.md", "docs/friction.md", "docs/notebooks/engineer.ipynb"),
    ),
    Section(
        "Your own estimator",
        (
            "docs/extending.md",
            "docs/gate.md",
            "docs/pipes.md",
            "docs/notebooks/developer.ipynb",
        ),
    ),
    Section(
        "Faults",
        (
            "docs/scenarios.md",
            "docs/drives.md",
            "docs/control.md",
            "docs/studies.md",
            "docs/notebooks/researcher.ipynb",
        ),
    ),
    Section(
        "Teach and learn",
        (
            "docs/model.md",
            "docs/labs/README.md",
            "docs/labs/handout.md",
            "docs/labs/answers.md",
            "docs/demo.md",
            "docs/notebooks/teacher.ipynb",
        ),
    ),
    Section(
        "Reference",
        (
            "docs/scores.md",
            "made/commands",
            "made/scenarios",
            "made/estimators",
            "made/scores",
            "made/api",
            "docs/glossary.md",
            "docs/json.md",
            "docs/speed.md",
            "docs/glr.md",
        ),
    ),
    Section(
        "The project",
        (
            "docs/compares.md",
            "CHANGELOG.md",
            "CONTRIBUTING.md",
            "SECURITY.md",
            "made/citation",
        ),
    ),
)


def name_of(path: str) -> str:
    """Return the name of the page that a file of the repository, or `made/NAME`, becomes."""
    if path == FIRST:
        return "index"
    if path.startswith("made/"):
        return path.replace("made/", "reference/") if path != "made/gallery" else "gallery"
    folder, _, file = path.removeprefix("docs/").rpartition("/")
    stem = "index" if folder and file == "README.md" else file.rpartition(".")[0].lower()
    return f"{folder}/{stem}" if folder else stem


def line_of(path: str) -> str:
    """Return the line of a page in the navigation: its name, of a notebook with for whom it is."""
    name = name_of(path)
    whom = f"{Path(path).stem}s"
    return f"Notebook for {whom} <{name}>" if path.endswith(".ipynb") else name


def labs() -> list[str]:
    """Return the labs, in order."""
    return sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("docs/labs/lab*.py"))


def written() -> dict[str, str]:
    """Return the pages that are files of the repository: path to name of the page."""
    named = [path for section in SECTIONS for path in section.pages]
    files = [FIRST, *(path for path in named if not path.startswith("made/")), *labs()]
    return {path: name_of(path) for path in files}


def unplaced() -> list[str]:
    """Return the pages and notebooks of `docs/` that no section has."""
    found = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/**/*.ipynb")]
    inside = {path.relative_to(ROOT).as_posix() for path in found if "site" not in path.parts[:-1]}
    return sorted(inside - set(written()))
