"""The HTML page of an import, an identification, a tracked record, or a trend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.reporting.charts import Chart, Heat
from flexaxis.experiments.reporting.page import charted, render
from flexaxis.experiments.reporting.tables import Table
from flexaxis.experiments.running.files import write_text


@dataclass(frozen=True)
class LogPage:
    """What a page shows.

    Attributes
    ----------
    title, command : str
    finding : Finding
        What comes of it, in one sentence.
    remarks : sequence of Finding
        What there is to say besides.
    charts : sequence of Chart or Heat
        The first one stands with the finding, the others behind the tables.
    tables : sequence of Table
    """

    title: str
    command: str
    finding: Finding
    remarks: Sequence[Finding]
    charts: Sequence[Chart | Heat]
    tables: Sequence[Table]


def write_page(page: LogPage, path: Path) -> None:
    """Write a page as one HTML file that needs no network."""
    content = vars(page) | {"version": version("flexaxis"), "charts": charted(page.charts)}
    write_text(path, render("logs/templates/log.html", content))


def capital(text: str) -> str:
    """Return a text as a sentence; a symbol such as f_c at its beginning stays as it is.

    Examples
    --------
    >>> capital("no parameter changed"), capital("f_c has grown")
    ('No parameter changed.', 'f_c has grown.')
    """
    first, *_ = text.split(" ", 1)
    return (text[:1].upper() + text[1:] if first.isalpha() else text).rstrip(".") + "."
