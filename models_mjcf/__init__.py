"""Provide the MJCF models of all plants, and named sets of their parameter values.

Each model has its own folder with an MJCF file and a README. TOML files in the folder of a model
define further parameter sets, and cite a source for each parameter value. The function
`model_files` returns the MJCF text and all files of a model.
"""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from hashlib import sha256
from importlib.resources import files
from xml.etree.ElementTree import canonicalize

DEFAULT = "three_mass"
"""Name of the three-mass axis model, which is the default model of a scenario."""

_FOUND = {f.name for f in files(__package__).iterdir() if (f / f"{f.name}.xml").is_file()}
MODEL_NAMES = (DEFAULT, *sorted(_FOUND - {DEFAULT}))
"""Names of all models; each model has a folder and an MJCF file with the name of the model."""

SHIPPED = {
    "three_mass": "29c0e25cfb28f417",
    "two_mass": "54100381ce3d6dc7",
}
"""Digest of each published MJCF file; a change in the digest changes the hashes of scenarios."""


@cache
def model_digest(name: str) -> str:
    """Return a digest of a model's MJCF file (16 hex digits).

    The digest does not depend on comments, whitespace or line endings. The function raises the same
    errors as `model_files`.
    """
    meant = canonicalize(model_files(name)[0], strip_text=True)
    return sha256(meant.encode()).hexdigest()[:16]


def model_files(name: str) -> tuple[str, dict[str, bytes]]:
    """Return the MJCF text of a model, and the contents of all files in its folder.

    Parameters
    ----------
    name : str
        Name of the model, one of `MODEL_NAMES`.

    Returns
    -------
    xml : str
        Content of the MJCF file ``name/name.xml``.
    assets : dict of str to bytes
        Contents of all files in the model's folder, keyed by file name. The MJCF text can include
        any of these files with ``<include>``.

    Raises
    ------
    ValueError
        If there is no model with the name `name`.

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
    # Read the files with the import system, so that the package also works in a zip file.
    folder = files(__package__) / name
    assets = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    return assets[f"{name}.xml"].decode(), assets
