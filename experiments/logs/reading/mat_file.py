"""Logs in MAT files up to v7, read in a process of their own: broken ones can take it along."""

from __future__ import annotations

import json
import signal
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


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    try:
        with TemporaryDirectory() as folder:
            found = _read(path, Path(folder) / "columns.npy")
    except LogError:
        raise
    except MemoryError as error:
        raise LogError(f"{path}: is too large for the memory of this machine") from error
    except (OSError, EOFError, ValueError) as error:
        raise LogError(f"{path}: lost in the folder for temporary files ({error})") from error

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        return {name: found[name] for name in names}

    return Log(path.name, tuple(found), read)


def _read(path: Path, kept: Path) -> dict[str, Array]:
    """Return the columns that the process has kept in a file, one behind the other."""
    # -P: what lies where the user stands is data, and no module of this process
    command = [sys.executable, "-P", "-m", MODULE, str(path.absolute()), str(kept)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired as error:
        raise LogError(f"{path}: not read within {PATIENCE:g} s; is it broken?") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        said = lines[-1] if lines and done.returncode > 0 else _ended(done.returncode)
        raise LogError(f"{path}: {said}")
    with kept.open("rb") as file:
        return {name: np.load(file) for name in json.loads(done.stdout)}


def _ended(status: int) -> str:
    """Return how the process that read a file came to an end without a word."""
    how = f"with status {status}"
    with suppress(ValueError):
        how = how if status > 0 else f"by {signal.Signals(-status).name}"
    return f"reading it was ended {how}; is it broken?"


def flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures, by ``outer.inner``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name}.")
        else:
            yield from columns_of(before + name, value)


def keep(path: str, kept: str) -> list[str]:
    """Write columns one behind the other, as they come; return their names."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except MemoryError:
        raise
    except Exception as error:  # scipy raises whatever the broken bytes lead to
        why = f"{type(error).__name__}: {error}"
        raise LogError(f"no MAT file, or a broken one ({why})") from error
    names = []
    with Path(kept).open("wb", buffering=0) as out:
        for name, column in flattened({n: v for n, v in content.items() if n[:2] != "__"}):
            try:
                np.save(out, column)
            except OSError as error:  # what cannot be written is no fault of the file
                raise LogError(f"no room for its columns ({error})") from error
            names.append(name)
    return names


def main() -> None:
    """Read the file that this process was started for, within its limits."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (MEMORY, MEMORY))  # as columns are kept in one
    try:
        print(json.dumps(keep(*sys.argv[1:])))
    except MemoryError as error:
        why = f"to read it takes more than the {MEMORY >> 30} GB of memory that it may ({error})"
        sys.exit(why)
    except LogError as error:
        sys.exit(" ".join(str(error).split()))


if __name__ == "__main__":
    main()
