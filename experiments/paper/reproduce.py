"""The paper reproduced: decide the claims, draw the figures, and tell it on one page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis.experiments.files import write_json, write_text, writing
from flexaxis.experiments.paper.claims import CHECKS
from flexaxis.experiments.paper.evidence import Evidence
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.reporting import page

CLAIMS, PAGE = "claims.json", "index.html"


def reproduce(
    folder: Path,
    *,
    command: str = "flexaxis paper",
    advance: Callable[[float], None] = lambda fraction: None,
    **options: Any,
) -> list[dict[str, Any]]:
    """Check every claim, and write figures, page and claims.json to a folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    command : str
        The line that runs this again, for the page.
    advance : callable
        Called with the fraction done since the last call.
    **options
        As for `Evidence`.

    Returns
    -------
    list of dict
        Claims, as they stand in claims.json: ``id, claim, source, measured, expected, holds``.

    Raises
    ------
    OutputError
        If the folder cannot be written to.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / CLAIMS, [])  # before anything is computed
    e, claims = Evidence(**options), []
    for check in CHECKS:
        claims.append(check(e))
        advance(1 / len(CHECKS))
    for name, (draw, *_) in FIGURES.items():
        figure = draw(e)
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
        figure.savefig(folder / f"{name}.png", dpi=200)
    write_json(folder / CLAIMS, claims)
    write_text(folder / PAGE, render(e, claims, command))
    return claims


def render(e: Evidence, claims: Sequence[Mapping[str, Any]], command: str) -> str:
    """Return the page that tells the story: equations, figures, claims."""
    return page.render(
        "paper/templates/paper.html",
        looks={},
        title="The paper, reproduced and checked",
        e=e,
        claims=claims,
        figures={n: (page.drawn(draw, title, e), title, text)
                 for n, (draw, title, text) in FIGURES.items()},
        command=command,
    )  # fmt: skip
