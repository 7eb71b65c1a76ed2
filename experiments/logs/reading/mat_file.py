"""Logs in MAT files up to v7, read in a process of their own: broken ones can take it along."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Array, Log, columns_of

MODULE = "flexaxis.experiments.logs.reading.mat_file"
PATIENCE = 300.0  # s
MEMORY = 8 << 30  # bytes that the process may have: a small file may say that it unpacks to more
COLUMNS, TEXTS = "columns", "texts"  # what it can be asked for


def open_file(path: Path) -> Log:
    """Open one; see `reader.open_log`."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "columns.npy"
        names, columns = json.loads(_asked(path, COLUMNS, str(out))), _split(out)
    found = dict(zip(names, columns, strict=True))

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        return {name: found[name] for name in names}

    return Log(path.name, tuple(found), read)


def texts_of(path: Path, names: Sequence[str]) -> list[str]:
    """Return the variables of some names as texts, those of numbers too; nothing of an array.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    return [str(text) for text in json.loads(_asked(path, TEXTS, *names))]


def _asked(path: Path, what: str, *words: str) -> bytes:
    """Return what the process that reads a file has printed."""
    # -P: what lies where the user stands is data, and no module of this process
    command = [sys.executable, "-P", "-m", MODULE, what, str(path.resolve()), *words]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired as error:
        raise LogError(f"{path}: not read within {PATIENCE:g} s; is it broken?") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        why = lines[-1] if lines else f"reading it ended with status {done.returncode}"
        raise LogError(f"{path}: no MAT file, or a broken one ({why})")
    return done.stdout


def _split(out: Path) -> list[Array]:
    with out.open("rb") as file:
        count = int(np.load(file))
        return [np.load(file) for _ in range(count)]


def _convert(path: str, out: str) -> None:
    """Read a MAT file, write its columns one behind the other, and print their names."""
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    own = {name: value for name, value in content.items() if not name.startswith("__")}
    names = []
    columns = list(flattened(own))
    with Path(out).open("wb") as file:
        np.save(file, len(columns))
        for name, column in columns:
            names.append(name)
            np.save(file, column)
    print(json.dumps(names))


def _texts(path: str, *names: str) -> None:
    """Print what some variables hold, as texts."""
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True, variable_names=list(names))
    print(json.dumps([text_of(value) for name, value in content.items() if name in names]))


def text_of(value: Any) -> str:
    """Return an attribute or a variable as a text; nothing of an array."""
    if isinstance(value, bytes | np.bytes_):
        return value.decode(errors="replace")
    if isinstance(value, str):
        return value
    number = np.asarray(value)
    numeric = number.size == 1 and number.dtype.kind in "iuf" and np.isfinite(number).all()
    return f"{number.item():.6f}" if numeric else ""


def _limit() -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures, by ``outer.inner``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name}.")
        else:
            yield from columns_of(before + name, value)


if __name__ == "__main__":
    try:
        _limit()
        what, *rest = sys.argv[1:]
        _texts(*rest) if what == TEXTS else _convert(*rest)
    except Exception as error:
        # scipy raises whatever the broken bytes lead to
        raise SystemExit(f"{type(error).__name__}: {error}") from None
