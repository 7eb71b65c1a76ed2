"""The plants as data: MJCF models and where their numbers come from.

A folder a model, with its README, and `drives.toml`: published drives, a source for each number.
In comes the name of a model, out go its MJCF text and the files beside it, for `sim.plant.plant`.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib.resources import files

MODEL_NAMES = ("three_mass",)

__all__ = ["MODEL_NAMES", "model_files"]


def model_files(name: str) -> tuple[str, dict[str, bytes]]:
    """Return the MJCF text of a model and the files beside it.

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
    ['README.md', 'scene.xml', 'three_mass.xml', 'wg.md']
    """
    if name not in MODEL_NAMES:
        near = get_close_matches(name, MODEL_NAMES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"unknown model {name!r}; models are {', '.join(MODEL_NAMES)}.{hint}")
    # Read through the import system, so that it also works from a wheel or a zip file.
    folder = files(__package__) / name
    assets = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    return assets[f"{name}.xml"].decode(), assets
