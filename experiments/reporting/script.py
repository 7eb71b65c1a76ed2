"""The code of a page: small files of `assets/`, in order, as one script that knows no other."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable
from importlib.resources import files

# Each uses those before it; `start` sets all up.
PARTS = (
    "dom",
    "data",
    "state",
    "scales",
    "dates",
    "look",
    "draw",
    "chart",
    "read",
    "heat",
    "table",
    "save",
    "picture",
    "terms",
    "pick",
    "bar",
    "start",
)


def source(changed: Callable[[str], str] = lambda text: text) -> str:
    """Return the script.

    Parameters
    ----------
    changed : callable, optional
        What is to be done to the text, for a test that wants a feature dead.
    """
    folder = files("flexaxis.experiments.reporting") / "assets"
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in PARTS]
    return "(() => {\n" + '"use strict";\n' + changed("\n".join(parts)) + "\n})();"


def policy(script: str) -> str:
    """Return the Content-Security-Policy of a page with this script: it may ask for nothing.

    Styles stand in the page, pictures are data, no other script runs than this one.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        "default-src 'none'; base-uri 'none'; form-action 'none'; "
        f"img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    )
