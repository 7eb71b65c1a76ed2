"""Results never go over what they are made of."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from flexaxis.experiments.running.files import OutputError

Given = str | os.PathLike[str] | None


def spare(inputs: Iterable[Given], *outputs: Given) -> None:
    """Refuse to write over an input; to be called before anything is computed.

    Parameters
    ----------
    inputs : iterable of path or str
        What the command reads. None is allowed, and so is what is not there, such as the name of
        a scenario, for that cannot be lost.
    *outputs : path or None
        What it will write.

    Raises
    ------
    OutputError
        If an output is one of the inputs, by whatever path, link or name it is called.
    """
    read = [Path(given) for given in inputs if given and os.path.exists(given)]
    for output in (Path(given) for given in outputs if given):
        if any(same(output, given) for given in read):
            raise OutputError(
                f"{output} is read by this command and would be overwritten: choose another place "
                "with -o"
            )


def same(one: Path, other: Path) -> bool:
    """Whether two paths are one file or folder, also where a part of a path is not there yet."""
    try:
        return os.path.samefile(one, other)
    except OSError:  # at least one does not exist
        return one.resolve() == other.resolve()
