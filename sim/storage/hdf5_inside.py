"""HDF5 files that hold their data themselves: a file may say that they lie in another one.

External storage, virtual data sets and external links would let a file of somebody else's take
any other file that the user can read into what he makes of it, and shows.
"""

from __future__ import annotations

import os
from typing import Any

import h5py

from flexaxis.sim.storage.reading import Refusal


def only_inside(file: h5py.File, refuse: Refusal) -> None:
    """Refuse a file of which anything lies in another one.

    Parameters
    ----------
    file : h5py.File
        Open; nothing of its data is read.
    refuse : callable
        Makes the error that is raised, from its message.
    """

    def look(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            others = [place for place, *_ in item.external or ()]
            if item.is_virtual:
                sources = (source.file_name for source in item.virtual_sources())
                others += [name for name in sources if not _is_itself(file, name)]
            _refuse(name, others, refuse)
        if not isinstance(item, h5py.Group):  # a type with a name of its own, too
            return
        links = ((each, item.get(each, getlink=True)) for each in item)
        for each, link in links:
            if isinstance(link, h5py.ExternalLink):
                _refuse(f"{name}/{each}".strip("/"), [link.filename], refuse)

    look("", file)
    file.visititems(look)


def _is_itself(file: h5py.File, name: str) -> bool:
    """Whether a source of a virtual data set is the file that it is in; "." says so, too."""
    return name == "." or os.path.abspath(file.filename) == os.path.abspath(
        os.path.join(os.path.dirname(file.filename), name)
    )


def _refuse(name: str, others: list[Any], refuse: Refusal) -> None:
    if others:
        other = others[0].decode(errors="replace") if isinstance(others[0], bytes) else others[0]
        raise refuse(
            f"{name} lies in another file, {other!r}, and such a file is not opened for this one: "
            "copy the values into it"
        )
