"""Code that an estimator names: who has to be asked for it, classes of this session, digests.

Text of a file is never executed unasked. An estimator that is typed on the command line runs
whatever it names. One that a study, a stored run or a lesson names is somebody else's text: a name
of the registry or of an installed entry point is as good as typed, but `path/file.py:Class`,
`package.module:Class` and `pipe:COMMAND` need `--run-code`, after they were shown.
"""

from __future__ import annotations

import argparse
import ast
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from uuid import uuid4

from flexaxis.experiments.storage.files import SHORT, digest_of
from flexaxis.sim.errors import FlexaxisError

OPTION = "--run-code"
PIPE = "pipe:"
"""How the command of a program begins."""


class CodeRefused(FlexaxisError):
    """Text of a file names code, and nobody has said that it may run."""


def names_code(text: str) -> bool:
    """Whether an estimator's text names code: own files, modules and programs have a colon.

    Examples
    --------
    >>> names_code("rpem-forgetting[forgetting=0.99]"), names_code("mine.py:Mine[gain=0.1]")
    (False, True)
    >>> names_code("pipe:octave-cli -q my.m"), names_code("subprocess:Popen")
    (True, True)
    """
    return ":" in text.partition("[")[0]


def piped(text: str) -> str | None:
    """Return the command of an estimator that is a program; None for any other text.

    Examples
    --------
    >>> piped("pipe:./mine -v")
    './mine -v'
    """
    return text.removeprefix(PIPE) if text.startswith(PIPE) else None


def code_named(texts: Iterable[str]) -> list[str]:
    """Return those of some texts that name code, each once."""
    return [text for text in dict.fromkeys(texts) if names_code(text)]


def require(given: bool, texts: Iterable[str], *, source: str, command: str | None = None) -> None:
    """Refuse texts that name code, unless consent was given.

    Parameters
    ----------
    given : bool
        Whether the user has said `--run-code`.
    texts : iterable of str
        Estimators, as `source` names them.
    source : str
        Where they stand, for the message.
    command : str, optional
        The line that was typed; without one the caller is a program, and is told of `run_code`.

    Raises
    ------
    CodeRefused
        With a line for each text, and what to type.
    """
    found = [] if given else code_named(texts)
    if not found:
        return
    go_on = "pass run_code=True" if command is None else f"type: {command} {OPTION}"
    raise CodeRefused(
        "\n".join(
            [
                f"{source} names code, and text of a file is not run unasked:",
                *(f"  {text}" for text in found),
                f"if you trust it, {go_on}",
            ]
        )
    )


def add_run_code(parser: argparse.ArgumentParser, whose: str) -> None:
    """Declare `--run-code`."""
    parser.add_argument(
        OPTION,
        action="store_true",
        help=f"run code that {whose} name: path.py:Class, module:Class, pipe:COMMAND",
    )


def digest(estimator: str) -> str | None:
    """Return a digest of the files that an estimator names, None for a registered one.

    That is the file of ``path.py:Class`` with what it imports from its folder, the file of
    ``module:Class``, and of ``pipe:COMMAND`` every word of the command that is a file here. What
    the latter two import or call in turn is not looked at. A file that was imported here is as it
    was then.

    Parameters
    ----------
    estimator : str
        As for `--estimator`.
    """
    if is_given(estimator):
        return sha256(written(estimator.partition("[")[0].strip())).hexdigest()[:SHORT]
    if not names_code(estimator):
        return None
    content = b"".join(content_of(path) for path in _named(estimator))
    return sha256(content).hexdigest()[:SHORT]


def _named(estimator: str) -> list[Path]:
    if command := piped(estimator):
        return [Path(word) for word in shlex.split(command)]
    module = estimator.partition("[")[0].rpartition(":")[0]
    if module.endswith(".py"):
        return [Path(module), *imported_neighbours(Path(module).resolve())]
    try:
        found = find_spec(module)
    except (ImportError, ValueError):  # it does not exist: said where it is to be built
        return []
    return [Path(found.origin)] if found and found.origin else []


def code_file(text: str) -> str:
    """Return the file of an estimator given as path/file.py:Class, and nothing for any other."""
    file = text.partition("[")[0].rpartition(":")[0]
    return file if file.endswith(".py") else ""


_imported: dict[Path, bytes] = {}


def remember(estimator: str) -> None:
    """Keep what the files hold that an estimator names, and that are imported now."""
    for file in _named(estimator):
        if file.is_file():
            _imported[file.resolve()] = file.read_bytes()


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


def own_digest() -> str:
    """Return a digest of the code of simulation, estimators and scores."""
    return digest_of("models_mjcf", "sim", "estimators", "experiments.scoring")


_HELD: dict[str, Callable[..., Any]] = {}
_HANDED: dict[str, Callable[..., Any]] = {}  # of modules: here as they are, elsewhere imported
_UNSEEN: dict[str, tuple[Callable[..., Any], bytes]] = {}


def give(make: Callable[..., Any]) -> str:
    """Return the text that names a class: that of its module, or its own name in this session.

    A class of a module that any process can import goes by ``module:Class``. One of a notebook,
    a script or a function is kept here under its name, and a new one takes its place. Either lives
    in this process, which is not protected from it.

    Raises
    ------
    EstimatorError
        If it has no name, or that of a registered estimator.
    """
    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.estimators.registry import REGISTRY

    name = getattr(make, "__name__", "")
    if not name.isidentifier():
        raise EstimatorError(f"{make!r} has no name to stand in results: give a class")
    module = getattr(make, "__module__", "__main__")
    held = getattr(sys.modules.get(module), name, None)
    if module != "__main__" and held is make and getattr(sys.modules[module], "__spec__", None):
        _HANDED[text := f"{module}:{name}"] = make
        return text
    if name in REGISTRY:
        raise EstimatorError(f"{name} is the name of a registered estimator: rename the class")
    _HELD[name] = make
    return name


def is_given(text: str) -> bool:
    """Whether an estimator's text names a class of this session."""
    return text.partition("[")[0].strip() in _HELD


def given(name: str) -> Callable[..., Any] | None:
    """Return the class that was handed over in this session under a name, None if there is none."""
    return _HELD.get(name, _HANDED.get(name))


def written(name: str) -> bytes:
    """Return the text of a class of this session; where it is not known, what no other has."""
    import inspect

    try:
        return inspect.getsource(_HELD[name]).encode() or _unseen(name)
    except (OSError, TypeError):
        return _unseen(name)


def _unseen(name: str) -> bytes:
    """Return a mark of a class whose text cannot be read: of it alone, and of this session."""
    make, mark = _UNSEEN.get(name, (None, b""))
    if make is not _HELD[name]:
        mark = uuid4().bytes
        _UNSEEN[name] = _HELD[name], mark
    return mark
