"""Which folder `import` sees: that of the estimator whose code runs, and no other estimator's.

So two versions of an estimator in two folders each have their own `helper.py`, whether they import
it at once or only when they run.
"""

from __future__ import annotations

import ast
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

PRIVATE = "_flexaxis_file_"
"""How the modules of estimators' files begin; their names take the place of no library."""

_left: dict[str, dict[str, ModuleType]] = {}
_HANDED_ON = "FLEXAXIS_NEIGHBOURS"
# A worker process begins with the import path of its parent: what was put there is to go as well.
_added: list[str] = [
    place for place in [os.environ.get(_HANDED_ON, "")] if place and place in sys.path
]


def code_file(text: str) -> str:
    """Return the file of an estimator given as path/file.py:Class, and nothing for any other."""
    file = text.partition("[")[0].rpartition(":")[0]
    return file if file.endswith(".py") else ""


def move_to(folder: Path) -> None:
    """Let `import` find what lies in a folder, and what was loaded from there before.

    It is put at the end of the import path, so that no neighbour takes the place of a library; the
    folder of the estimator before is taken from it, with its modules.
    """
    home = str(folder)
    for other in [other for other in _added if other != home]:
        _added.remove(other)
        sys.path[:] = [place for place in sys.path if place != other]
        _left[other] = {name: sys.modules.pop(name) for name in _loaded_from(other)}
    if home not in sys.path:
        sys.path.append(home)
        _added.append(home)
        os.environ[_HANDED_ON] = home
        sys.modules.update(_left.pop(home, {}))


def _loaded_from(folder: str) -> list[str]:
    """Return the names of the modules that were imported from a folder."""
    inside = Path(folder)
    return [
        name
        for name, module in list(sys.modules.items())
        if not name.startswith(PRIVATE) and (found := _origin(module)) and _top(name, found, inside)
    ]


def _origin(module: ModuleType) -> Path | None:
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) else None


def _top(name: str, file: Path, folder: Path) -> bool:
    """Whether a module of some name and file was found by looking into the folder itself."""
    there = folder.joinpath(*name.split("."))
    return file in {there.with_name(f"{there.name}.py"), there / "__init__.py"}


_imported: dict[Path, bytes] = {}


def remember(file: Path, *besides: Path) -> None:
    """Keep what a file holds that is imported now, and files that go with it, if they are new."""
    for each in (file, *besides):
        if each.is_file() and (each == file or each not in _imported):
            _imported[each] = each.read_bytes()


def content_of(file: Path) -> bytes:
    """Return what a file held when it was imported here; else what it holds, nothing if it is none.

    Whoever edits a file while it runs has not run what he wrote.
    """
    known = _imported.get(file.resolve())
    if known is None:
        return file.read_bytes() if file.is_file() else b""
    return known


def imported_neighbours(file: Path) -> list[Path]:
    """Return the files beside a file that it imports, and those import in turn, in order of name.

    They are read, not run; what is imported by a name that is computed is not found.
    """
    found: set[Path] = set()
    wanted = [file]
    while wanted:
        new = set(_imports(wanted.pop(), file.parent)) - found - {file}
        found |= new
        wanted += new
    return sorted(found)


def _imports(file: Path, folder: Path) -> Iterator[Path]:
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):  # said where it is imported
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _files(folder, alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = file.parents[node.level - 1] if node.level else folder
            for alias in node.names:
                yield from _files(base, f"{node.module or ''}.{alias.name}".lstrip("."))


def _files(folder: Path, name: str) -> Iterator[Path]:
    """Yield the files of a module of some dotted name and of the packages that it lies in."""
    parts = name.split(".")
    if parts[0] in sys.stdlib_module_names:  # goes before a neighbour
        return
    for count in range(1, len(parts) + 1):
        place = folder.joinpath(*parts[:count])
        for path in (place.with_name(f"{place.name}.py"), place / "__init__.py"):
            if path.is_file():
                yield path
