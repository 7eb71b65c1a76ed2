"""Logs in MAT files up to v7, read in a process of their own: broken ones can take it along."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Array, Log, columns_of

MODULE = "flexaxis.experiments.logs.reading.mat_file"
PATIENCE = 300.0  # s


def open_file(path: Path) -> Log:
    """Open one; see `reader.open_log`."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "columns.npy"
        # -P: what lies where the user stands is data, and no module of this process
        words = [sys.executable, "-P", "-m", MODULE, str(path.resolve()), str(out)]
        try:
            done = subprocess.run(words, capture_output=True, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired as error:
            raise LogError(f"{path}: not read within {PATIENCE:g} s; is it broken?") from error
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            why = lines[-1] if lines else f"reading it ended with status {done.returncode}"
            raise LogError(f"{path}: no MAT file, or a broken one ({why})")
        names, columns = json.loads(done.stdout), _split(out)
    found = dict(zip(names, columns, strict=True))

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        return {name: found[name] for name in names}

    return Log(path.name, tuple(found), read)


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


def flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures, by ``outer.inner``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name}.")
        else:
            yield from columns_of(before + name, value)


if __name__ == "__main__":
    try:
        _convert(*sys.argv[1:3])
    except Exception as error:
        # scipy raises whatever the broken bytes lead to
        raise SystemExit(f"{type(error).__name__}: {error}") from None
