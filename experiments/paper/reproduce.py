"""Reproduce the paper: check its claims, draw its figures, and write a page with the results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis.experiments.files import make_folder, write_json, write_text
from flexaxis.experiments.paper.claims import CLAIMS, decide
from flexaxis.experiments.paper.figures import FIGURES
from flexaxis.experiments.paper.measures import Measures
from flexaxis.experiments.reporting import page
from flexaxis.experiments.running.progress import LINE, progress


def reproduce(folder: Path) -> tuple[list[dict[str, Any]], Path]:
    """Check every claim, and write the figures, a page and claims.json to a folder.

    Parameters
    ----------
    folder : Path
        Output folder, which is created if it does not exist.

    Returns
    -------
    claims : list of dict
        Content of claims.json. Each claim has the keys ``id, claim, source, measured, expected,
        holds``.
    page : Path
        Path of the page.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    make_folder(folder)
    e, claims = Measures(), list[dict[str, Any]]()
    with progress("claims", len(CLAIMS)) as advance:
        for name in CLAIMS:
            claims.append(decide(name, e))
            advance(1)
    for name, (draw, *_) in FIGURES.items():
        figure = draw(e)
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
        figure.savefig(folder / f"{name}.png", dpi=200)
    write_json(folder / "claims.json", claims)
    write_text(path := folder / "index.html", render(e, claims))
    return claims, path


def render(e: Measures, claims: Sequence[Mapping[str, Any]]) -> str:
    """Return the page with equations, figures and claims as HTML."""
    return page.render(
        "paper/templates/paper.html",
        looks={},
        title="The paper, reproduced and checked",
        e=e,
        claims=claims,
        figures={n: (page.drawn(draw, title, e), title, text)
                 for n, (draw, title, text) in FIGURES.items()},
        command=LINE.get(),
    )  # fmt: skip
