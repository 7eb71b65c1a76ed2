"""From nothing to the page: simulate, estimate, check the claims, draw, write."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from flexaxis.experiments.paper import (
    checks_filter,
    checks_further,
    checks_model,
    further_figures,
    paper_figures,
)
from flexaxis.experiments.paper.claims import Claim, Evidence, checks_in
from flexaxis.experiments.paper.convergence import converge
from flexaxis.experiments.paper.data import Size, collect
from flexaxis.experiments.paper.further_work import further_work
from flexaxis.experiments.paper.offline import identify_offline
from flexaxis.experiments.paper.paper_page import render
from flexaxis.experiments.paper.style import RC
from flexaxis.experiments.reporting.figures import svg
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.storage.files import new_file, write_json, write_text, writing

CLAIMS, PAGE = "claims.json", "index.html"

CHECKS = tuple(c for m in (checks_model, checks_filter, checks_further) for c in checks_in(m))
"""All checks, in the order of the paper."""

FIGURES = {
    "fig3": paper_figures.fig3,
    "fig4": paper_figures.fig4,
    "fig5": paper_figures.fig5,
    "fig6": paper_figures.fig6,
    "fig7": paper_figures.fig7,
    "fig8": paper_figures.fig8,
    "fig9": paper_figures.fig9,
    "figA": further_figures.figA,
    "figB": further_figures.figB,
    "figC": further_figures.figC,
}
"""All figures, by the name of their files."""

SHARES = {"data": 0.6, "offline": 0.05, "convergence": 0.05, "further": 0.2, "figures": 0.1}
"""What part of the time a stage takes."""

Advance = Callable[[float], None]


def reproduce(
    folder: Path,
    *,
    command: str,
    size: Size | None = None,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Advance = lambda fraction: None,
) -> list[Claim]:
    """Check every claim, and write figures, page and claims.json to a folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    command : str
        The line that runs this again, for the page.
    size : Size, optional
        Numbers of runs, and their first seed.
    jobs : int
        Processes of the simulations.
    store : RecordCache, optional
        Where records are kept.
    advance : callable, optional
        Called with the fraction done since the last call.

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
    e = evidence(size or Size(), jobs=jobs, store=store, advance=advance)
    claims = decide(e)
    drawn = {}
    for name in FIGURES:
        drawn[name] = draw(e, name, folder)
        advance(SHARES["figures"] / len(FIGURES))
    write_json(folder / CLAIMS, [claim.as_json() for claim in claims])
    write_text(folder / PAGE, render(e, claims, drawn, command))
    return claims


def evidence(
    size: Size,
    *,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Advance = lambda fraction: None,
) -> Evidence:
    """Simulate and estimate everything that the claims are about; see `reproduce`."""
    data = collect(
        size, jobs=jobs, store=store, advance=lambda part: advance(part * SHARES["data"])
    )
    offline = identify_offline(data)
    advance(SHARES["offline"])
    convergence = converge(data)
    advance(SHARES["convergence"])
    further = further_work(data, convergence.Q)
    advance(SHARES["further"])
    return Evidence(data=data, convergence=convergence, offline=offline, further=further)


def decide(e: Evidence) -> list[Claim]:
    """Return every claim with what was measured, and whether it holds."""
    return [check(e) for check in CHECKS]


def draw(e: Evidence, name: str, folder: Path) -> str:
    """Draw a figure, write it as SVG and PNG, and return the SVG."""
    import matplotlib

    with matplotlib.rc_context(RC):
        figure = FIGURES[name](e)
        text = svg(figure)
        write_text(folder / f"{name}.svg", text)
        with new_file(folder / f"{name}.png") as part:
            figure.savefig(part, dpi=200)
    return text
