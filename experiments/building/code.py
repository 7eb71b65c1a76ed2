"""Digests of code: what an estimator of one's own, and flexaxis itself, was when it ran."""

from __future__ import annotations

import shlex
from functools import cache
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable
from importlib.util import find_spec
from pathlib import Path

from flexaxis.experiments.building.consent import names_code, piped
from flexaxis.experiments.building.given import is_given, written
from flexaxis.experiments.building.neighbours import content_of, imported_neighbours

SHORT = 12  # hexadecimal digits: enough to tell versions apart, few enough to read


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


def own_digest() -> str:
    """Return a digest of the code of simulation, estimators and scores."""
    return digest_of("models_mjcf", "sim", "estimators", "experiments.scoring")


@cache
def digest_of(*parts: str) -> str:
    """Return a digest of the code, models and settings in packages of flexaxis."""
    content = sha256()
    for source in (f for part in parts for f in sources(files(f"flexaxis.{part}"))):
        content.update(source.read_bytes())
    return content.hexdigest()[:SHORT]


def sources(folder: Traversable) -> list[Traversable]:
    """Return the files of code, models and settings in a folder and those inside, by name."""
    found: list[Traversable] = []
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir():
            found += sources(item)
        elif item.name.endswith((".py", ".xml", ".toml")):
            found.append(item)
    return found
