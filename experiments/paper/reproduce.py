"""Check the claims of the paper, draw its figures, and write a web page with the results."""

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
    """Check all claims of the paper, and write figures, a web page and claims.json to a folder.

    Parameters
    ----------
    folder : Path
        Output folder, which the function creates if necessary.

    Returns
    -------
    claims : list of dict
        Content of the file claims.json. Each claim has the keys ``id``, ``claim``, ``source``,
        ``measured``, ``expected`` and ``holds``.
    page : Path
        Path of the web page.

    Raises
    ------
    OutputError
        If the output folder cannot be written.
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
    """Return the HTML text of a web page with the equations, figures and claims of the paper."""
    return page.render(
        "paper/templates/paper.html",
        looks={},
        title="Reproduction of the paper and check of its claims",
        e=e,
        claims=claims,
        figures={n: (page.drawn(draw, title, e), title, text)
                 for n, (draw, title, text) in FIGURES.items()},
        command=LINE.get(),
    )  # fmt: skip
