"""The paper reproduced: simulate and estimate, decide the claims, draw, and tell it on one page."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import matplotlib as mpl

from flexaxis.experiments.files import write_json, write_text, writing
from flexaxis.experiments.paper.claim import SHARES, Claim, Evidence, Measured, gather
from flexaxis.experiments.paper.claims import CHECKS
from flexaxis.experiments.paper.data import Size
from flexaxis.experiments.paper.figures import CAPTIONS, FIGURES
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.tables import Cell, Table
from flexaxis.experiments.running.cache import RecordCache

CLAIMS, PAGE = "claims.json", "index.html"


def reproduce(
    folder: Path,
    *,
    command: str,
    size: Size | None = None,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[float], None] = lambda fraction: None,
) -> list[Claim]:
    """Check every claim, and write figures, page and claims.json to a folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    command : str
        The line that runs this again, for the page.
    size, jobs, store, advance
        As for `gather`.

    Returns
    -------
    list of Claim

    Raises
    ------
    OutputError
        If the folder cannot be written to; that is tried before anything is computed.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    e = gather(size or Size(), jobs=jobs, store=store, advance=advance)
    claims = decide(e)
    for name in FIGURES:
        draw(name, e, folder)
        advance(SHARES["figures"] / len(FIGURES))
    write_json(folder / CLAIMS, [claim.as_json() for claim in claims])
    write_text(folder / PAGE, render(e, claims, command))
    return claims


def decide(e: Evidence) -> list[Claim]:
    """Return every claim with what was measured, and whether it holds."""
    return [check(e) for check in CHECKS]


def draw(name: str, e: Evidence, folder: Path) -> None:
    """Write a figure as SVG and PNG."""
    figure = FIGURES[name](e)
    with mpl.rc_context({"svg.hashsalt": "flexaxis"}):
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    figure.savefig(folder / f"{name}.png", dpi=200)


def render(e: Evidence, claims: Sequence[Claim], command: str) -> str:
    """Return the page that tells the story: equations, figures, claims.

    Parameters
    ----------
    e : Evidence
    claims : sequence of Claim
    command : str
        The line that makes the page again.
    """
    content = {
        "claims": claims,
        "about": lambda *words, but=None: _about(claims, words, but),
        "figures": {n: page.drawn(f, CAPTIONS[n][0], e) for n, f in FIGURES.items()},
        "captions": CAPTIONS,
        "title": "The paper, reproduced and checked",
        "seeds": [record.seed for record in e.data.nominal],
        "runs": {"long": len(e.data.long), "few": len(e.data.pause)},
        "measured": {claim.id: claim.measured for claim in claims},
        "nominal": e.data.scenario.nominal.as_dict(),
        "command": command,
        "versions": {name: version(name) for name in ("flexaxis", "mujoco", "numpy", "scipy")},
        "table": claims_table(claims),
        "in_words": in_words,
    }
    return page.render("paper/templates/paper.html", looks={}, **content)


def claims_table(claims: Sequence[Claim]) -> Table:
    """Return all claims as a table, for the page and for the terminal."""
    heads = ("holds", "claim", "measured", "to hold", "source")
    rows = [
        ("✓" if c.holds else "✗", c.claim, in_words(c.measured), c.expected, c.source)
        for c in claims
    ]
    return Table("All claims", heads, [("", [Cell(text) for text in row]) for row in rows])


def _about(claims: Sequence[Claim], words: Sequence[str], but: str | None) -> list[Claim]:
    """Return the claims whose source has one of the words, and not that other."""
    found = [claim for claim in claims if any(word in claim.source for word in words)]
    return [claim for claim in found if but is None or but not in claim.source]


def in_words(measured: Measured) -> str:
    """Return what was measured for a table.

    Examples
    --------
    >>> in_words({"k_T": 0.6123, "f_m": 3.0})
    'k_T: 0.612, f_m: 3'
    >>> in_words(2.4066)
    '2.41'
    """
    if isinstance(measured, Mapping):
        return ", ".join(f"{name}: {in_words(value)}" for name, value in measured.items())
    return f"{measured:.0f}" if 1e3 <= abs(measured) < 1e5 else f"{measured:.3g}"
