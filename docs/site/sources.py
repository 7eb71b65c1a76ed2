"""Pages that show files and folders of the repository to which the documentation links."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

from pages import ROOT

LANGUAGES = {
    ".py": "python",
    ".toml": "toml",
    ".yml": "yaml",
    ".yaml": "yaml",
    ".cff": "yaml",
    ".patch": "diff",
    ".xml": "xml",
    ".m": "matlab",
}


def page_of(path: str) -> str:
    """Return the name of the page that shows a file or folder."""
    return f"source/{path}"


def write(folder: Path, shown: Iterable[str]) -> list[str]:
    """Write a page for each of the files and folders, and return their names."""
    names = []
    for path in sorted(shown):
        target = folder / f"{page_of(path)}.md"
        target.parent.mkdir(parents=True, exist_ok=True)
        place = ROOT / path
        text = _folder(place, path) if place.is_dir() else _file(place, path)
        target.write_text(f"---\norphan: true\n---\n\n# `{path}`\n\n{text}", encoding="utf-8")
        names.append(page_of(path))
    return names


def _file(place: Path, path: str) -> str:
    text = place.read_text(encoding="utf-8")
    if place.suffix == ".md":
        return text.partition("\n")[2]
    fence = "`" * 5
    return f"{fence}{LANGUAGES.get(place.suffix, 'text')}\n{text}\n{fence}\n"


def _folder(place: Path, path: str) -> str:
    """Return a table of what a folder has: each file, and its first line if it is a module."""
    readme = place / "README.md"
    said = readme.read_text(encoding="utf-8").partition("\n")[2] if readme.exists() else ""
    lines = ["| file | what it is |", "|---|---|"]
    files = sorted(p for p in place.iterdir() if not p.name.startswith(("_", ".")))
    lines += [f"| `{p.name}{'/' if p.is_dir() else ''}` | {_words(p)} |" for p in files]
    return f"{said}\n\n" + "\n".join(lines) + "\n"


def _words(path: Path) -> str:
    if path.is_dir() and (path / "__init__.py").exists():
        path /= "__init__.py"
    if path.suffix != ".py":
        return ""
    words = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return words.partition("\n\n")[0].replace("\n", " ").replace("|", "\\|")
