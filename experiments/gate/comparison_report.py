"""A comparison as text and Markdown, and what goes into its folder."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from flexaxis.experiments.building.code import digest
from flexaxis.experiments.gate.comparison_page import comparison_page
from flexaxis.experiments.gate.comparison_rows import COLUMNS, cells, ordered
from flexaxis.experiments.gate.decide import BETTER, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.words import explanation, headline, knobs, meaning
from flexaxis.experiments.storage.files import write_json, write_text, writing
from flexaxis.experiments.storage.names import REPORT
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import Scenario

JSON, MARKDOWN = "compare.json", "verdict.md"
_STYLE = {WORSE: "red", BETTER: "green", UNDECIDED: "yellow"}


def terminal_table(found: Comparison) -> Table:
    """Return the table for a terminal."""
    table = Table(*COLUMNS, box=None, padding=(0, 1, 0, 0), caption_justify="left")
    for v in ordered(found.verdicts):
        table.add_row(*cells(v), style=_STYLE.get(v.verdict))
    table.caption = explanation(found)
    return table


def markdown(found: Comparison) -> str:
    """Return the table as Markdown, for a comment on a change."""
    lines = [
        f"**flexaxis: {headline(found)}**",
        "",
        meaning(found),
        "",
        f"base {_code(found.base)}, candidate {_code(found.candidate)}",
        *(["", _cell(knobs(found))] if found.equal else []),
        "",
        f"| {' | '.join(COLUMNS)} |",
        f"|{'---|' * len(COLUMNS)}",
        *(f"| {' | '.join(map(_cell, cells(v)))} |" for v in ordered(found.verdicts)),
        "",
        explanation(found),
    ]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Return a text as a cell of a table, as code if anything in it could be taken for markup."""
    plain = re.fullmatch(r"[\w ./+%(),=–…-]*", text) and "www." not in text
    return text if plain else _code(text).replace("|", r"\|")


def _code(text: str) -> str:
    """Return a text as Markdown code, in which nothing is markup, whatever it holds."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    edge = " " if "`" in line else ""
    return f"{fence}{edge}{line}{edge}{fence}"


def write(
    folder: Path,
    found: Comparison,
    scenarios: Sequence[Scenario] = (),
    *,
    sources: Mapping[str, str] | None = None,
    command: str = "",
) -> Path:
    """Write compare.json, verdict.md and report.html to a folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    found : Comparison
    scenarios : sequence of Scenario
        What was run; without them nothing is drawn.
    sources : mapping of str to str
        Path of each scenario that is not in the catalogue.
    command : str
        The line that does all of it again.

    Returns
    -------
    Path
        The report.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / MARKDOWN, markdown(found))
    codes = {text: digest(text) for text in (found.base, found.candidate)}
    text = comparison_page(
        found, scenarios, sources=sources or {}, command=command, traces=Traces(folder, codes)
    )
    write_text(folder / REPORT, text)
    # Last: a folder that has none is not complete.
    write_json(folder / JSON, found.as_dict() | {"command": command})
    return folder / REPORT
