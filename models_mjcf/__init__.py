"""The plants as data: MJCF models and the sources of their numbers.

Each model has a folder with its MJCF, a README, and other parameter sets as TOML with a source for
each number. `sim` asks for a model by name and gets the MJCF text and the other files.
"""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from hashlib import sha256
from importlib.resources import files
from xml.etree.ElementTree import canonicalize

DEFAULT = "three_mass"
"""The axis of the paper, which a scenario has that names no model."""

_FOUND = {f.name for f in files(__package__).iterdir() if (f / f"{f.name}.xml").is_file()}
MODEL_NAMES = (DEFAULT, *sorted(_FOUND - {DEFAULT}))
"""The models: each a folder beside this file with an MJCF of its name."""

SHIPPED = {
    "three_mass": "29c0e25cfb28f417",
    "two_mass": "54100381ce3d6dc7",
}
"""Digests of the models as they were first published: what was simulated with another is told apart
by the hash of its scenario."""


@cache
def model_digest(name: str) -> str:
    """Return 16 hex digits of what a model's MJCF says; errors as from `model_files`.

    Comments, blanks and ends of lines, which differ between systems, are no part of it.
    """
    meant = canonicalize(model_files(name)[0], strip_text=True)
    return sha256(meant.encode()).hexdigest()[:16]


def model_files(name: str) -> tuple[str, dict[str, bytes]]:
    """Return the MJCF text of a model and its other files.

    Parameters
    ----------
    name : str
        One of `MODEL_NAMES`.

    Returns
    -------
    xml : str
        The MJCF text of ``name/name.xml``.
    assets : dict of str to bytes
        Every file of the model's folder by name, as MuJoCo wants them for an ``<include>``.

    Raises
    ------
    ValueError
        If there is no such model.

    Examples
    --------
    >>> xml, assets = model_files("three_mass")
    >>> sorted(assets)
    ['README.md', 'axes.toml', 'drives.toml', 'scene.xml', 'three_mass.xml', 'wg.md']
    """
    if name not in MODEL_NAMES:
        near = get_close_matches(name, MODEL_NAMES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"unknown model {name!r}; models are {', '.join(MODEL_NAMES)}.{hint}")
    # Read through the import system, so that it also works from a wheel or a zip file.
    folder = files(__package__) / name
    assets = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    return assets[f"{name}.xml"].decode(), assets
