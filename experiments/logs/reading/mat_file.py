"""Logs in MAT files up to v7."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Array, Log, columns_of


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except MemoryError:
        raise
    except Exception as error:  # scipy raises whatever the broken bytes lead to
        why = f"{type(error).__name__}: {error}"
        raise LogError(f"{path}: no MAT file, or a broken one ({why})") from error
    columns = dict(_flattened({name: v for name, v in content.items() if name[:2] != "__"}))

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        return {name: columns[name] for name in names}

    return Log(path.name, tuple(columns), read)


def _flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures, by ``outer.inner``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{before}{name}.")
        else:
            yield from columns_of(before + name, value)
