"""The page that tells the story of the paper: equations, figures, claims; one offline file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

from flexaxis.experiments.paper.claims import Claim, Evidence, Measured
from flexaxis.experiments.reporting import page, tables

if TYPE_CHECKING:
    from rich.table import Table


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
    content = {
        "claims": claims,
        "about": lambda *words, but=None: _about(claims, words, but),
        "figures": figures,
        "seeds": [record.seed for record in e.data.nominal],
        "runs": {"long": len(e.data.long), "few": len(e.data.pause)},
        "measured": {claim.id: claim.measured for claim in claims},
        "nominal": e.data.scenario.nominal.as_dict(),
        "command": command,
        "versions": {name: version(name) for name in ("flexaxis", "mujoco", "numpy", "scipy")},
        "table": _table(claims),
        "symbols": symbols,
        "written": in_words,
    }
    return page.render("paper/templates/paper.html", content)


def _table(claims: Sequence[Claim]) -> tables.Table:
    """Return all claims as a table that sorts, filters, and can be saved."""
    heads = ("holds", "claim", "measured", "to hold", "source")
    rows = [
        ("✓" if c.holds else "✗", c.claim, in_words(c.measured), c.expected, c.source)
        for c in claims
    ]
    return tables.texts("All claims", heads, rows)


def _about(claims: Sequence[Claim], words: Sequence[str], but: str | None) -> list[Claim]:
    """Return the claims whose source has one of the words, and not that other."""
    found = [claim for claim in claims if any(word in claim.source for word in words)]
    return [claim for claim in found if but is None or but not in claim.source]


def symbols(text: str) -> Markup:
    """Return text as HTML, its parameters as symbols with an index.

    Examples
    --------
    >>> str(symbols("1/J_a < 3"))
    '1/<i>J</i><sub>a</sub> &lt; 3'
    """
    return Markup(
        re.sub(r"\b([A-Za-zΔτ])_([A-Za-zθ]+)", r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    )


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


def claims_table(claims: Sequence[Claim]) -> Table:
    """Return the claims as a table for the terminal."""
    from rich.markup import escape as escape_markup  # brackets are mark-up there
    from rich.table import Table

    held = sum(claim.holds for claim in claims)
    table = Table(box=None, padding=(0, 1, 0, 0), caption=f"{held} of {len(claims)} claims hold")
    table.add_column("", no_wrap=True)
    for heading in ("claim", "measured", "expected"):
        table.add_column(heading, ratio=1)
    for claim in claims:
        mark = "✓" if claim.holds else "✗"
        style = None if claim.holds else "bold red"
        cells = (claim.claim, in_words(claim.measured), claim.expected)
        table.add_row(mark, *map(escape_markup, cells), style=style)
    return table
