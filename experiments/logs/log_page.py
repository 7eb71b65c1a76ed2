"""The HTML page of an import, an identification or a tracked record: tables and figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from matplotlib.figure import Figure

from flexaxis.experiments.reporting.figures import svg
from flexaxis.experiments.reporting.page import render
from flexaxis.experiments.running.files import write_text


@dataclass(frozen=True)
class LogPage:
    """What a page shows.

    Attributes
    ----------
    title, command : str
    remarks : sequence of (kind, text)
        Kind is ``"ok"``, ``"note"`` or ``"problem"``.
    tables : sequence of (heading, head, rows)
    figures : sequence of (heading, figure, text)
    """

    title: str
    command: str
    remarks: Sequence[tuple[str, str]]
    tables: Sequence[tuple[str, Sequence[str], Sequence[Sequence[str]]]]
    figures: Sequence[tuple[str, Figure, str]]


def write_page(page: LogPage, path: Path) -> None:
    """Write a page as one HTML file that needs no network."""
    content = {
        "title": page.title,
        "command": page.command,
        "version": version("flexaxis"),
        "remarks": page.remarks,
        "tables": page.tables,
        "figures": [(heading, svg(figure), text) for heading, figure, text in page.figures],
    }
    write_text(path, render("logs/templates/log.html", content))
