"""Logs in MAT files up to v7, read in a process of their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import apart
from flexaxis.experiments.logs.reading.log import Array, Log, columns_of

MODULE = "flexaxis.experiments.logs.reading.mat_file"


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    found = apart.columns(MODULE, path, "columns")

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
    return [str(text) for text in apart.asked(MODULE, path, "texts", *names)]


def text_of(value: Any) -> str:
    """Return an attribute or a variable as a text, the start of a long one; nothing of an array."""
    if isinstance(value, bytes | np.bytes_):
        return value[: apart.TEXT].decode(errors="replace")
    if isinstance(value, str):
        return value[: apart.TEXT]
    number = np.asarray(value)
    numeric = number.size == 1 and number.dtype.kind in "iuf" and np.isfinite(number).all()
    return f"{number.item():.6f}" if numeric else ""


def flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures, by ``outer.inner``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name}.")
        else:
            yield from columns_of(before + name, value)


def _columns(path: str, out: str) -> list[str]:
    content = _loaded(path)
    own = {name: value for name, value in content.items() if not name.startswith("__")}
    return apart.kept(out, flattened(own))


def _texts(path: str, *names: str) -> list[str]:
    content = _loaded(path, variable_names=list(names))
    return [text_of(value) for name, value in content.items() if name in names]


def _loaded(path: str, variable_names: list[str] | None = None) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        return dict(loadmat(path, simplify_cells=True, variable_names=variable_names))
    except MemoryError:
        raise
    except Exception as error:  # scipy raises whatever the broken bytes lead to
        why = f"{type(error).__name__}: {error}"
        raise LogError(f"no MAT file, or a broken one ({why})") from error


ANSWERS: apart.Answers = {"columns": _columns, "texts": _texts}

if __name__ == "__main__":
    apart.serve(ANSWERS)
