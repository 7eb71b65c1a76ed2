"""The page that tells the story of the paper: equations, figures, claims; one offline file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING

from flexaxis.experiments.paper.claims import Claim, Evidence, Measured

if TYPE_CHECKING:
    from rich.table import Table

TEMPLATE, EQUATIONS = "page.html", "equations.html"


def render(e: Evidence, claims: Sequence[Claim], figures: Mapping[str, str], command: str) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    e : Evidence
    claims : sequence of Claim
    figures : mapping of str to str
        SVG of each figure by its name.
    command : str
        The line that makes the page again.
    """
    from jinja2 import DictLoader, Environment, StrictUndefined

    folder = files("flexaxis.experiments.paper")
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in (TEMPLATE, EQUATIONS)}
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, loader=DictLoader(texts), trim_blocks=True
    )
    environment.filters["measured"] = in_words
    return environment.get_template(TEMPLATE).render(
        claims=claims,
        about=lambda *words: [c for c in claims if any(word in c.source for word in words)],
        figures=figures,
        seeds=[record.seed for record in e.data.nominal],
        runs={"long": len(e.data.long), "few": len(e.data.pause)},
        measured={claim.id: claim.measured for claim in claims},
        nominal=e.data.scenario.nominal.as_dict(),
        command=command,
        versions={name: version(name) for name in ("flexaxis", "mujoco", "numpy", "scipy")},
    )


def in_words(measured: Measured) -> str:
    """Return what was measured for a table.

    Examples
    --------
    >>> in_words({"k_T": 0.6123, "f_m": 3.0})
    'k_T 0.612, f_m 3'
    >>> in_words(2.4066)
    '2.41'
    """
    if isinstance(measured, Mapping):
        return ", ".join(f"{name} {value:.3g}" for name, value in measured.items())
    return f"{measured:.3g}"


def claims_table(claims: Sequence[Claim]) -> Table:
    """Return the claims as a table for the terminal."""
    from rich.table import Table

    held = sum(claim.holds for claim in claims)
    table = Table(box=None, padding=(0, 1, 0, 0), caption=f"{held} of {len(claims)} claims hold")
    table.add_column("", no_wrap=True)
    for heading in ("claim", "measured", "expected"):
        table.add_column(heading, ratio=1)
    for claim in claims:
        mark = "✓" if claim.holds else "✗"
        style = None if claim.holds else "bold red"
        table.add_row(mark, claim.claim, in_words(claim.measured), claim.expected, style=style)
    return table
