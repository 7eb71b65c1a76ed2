"""What goes into the folder of a comparison: its page, its table as Markdown, its numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import rich.table

from flexaxis.experiments.files import REPORT, write_json, write_text, writing
from flexaxis.experiments.gate.decide import BETTER, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.verdicts import Verdict
from flexaxis.experiments.gate.wording import (
    COLUMNS,
    cells,
    explanation,
    headline,
    knobs,
    meaning,
    ordered,
    row_command,
    worst,
)
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.old_results import Traces
from flexaxis.experiments.reporting.run.over_time import trajectories
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table
from flexaxis.experiments.running.store import ROWS
from flexaxis.experiments.scoring.curves import curve_of
from flexaxis.sim.scenario import Scenario

KINDS = {WORSE: "bad", UNDECIDED: "maybe", BETTER: ""}  # of the box with the verdict
_COLUMNS = (
    Column("scenario", term="scenario", kind="text"),
    Column("score", kind="text"),
    Column("base"),
    Column("candidate"),
    Column("change [%]"),
    Column("interval [%]", kind="text"),
    Column("verdict", kind="text"),
    Column("to look at it", kind="command", more=True),
)


def comparison_page(
    found: Comparison,
    scenarios: Sequence[Scenario],
    *,
    sources: Mapping[str, str],
    command: str,
    traces: Traces,
) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    found : Comparison
    scenarios : sequence of Scenario
        What was run; without them nothing is drawn.
    sources : mapping of str to str
        Path of each scenario that is not in the catalogue.
    command : str
        The line that does all of it again.
    traces : Traces
        Estimates of the runs.
    """
    focus = worst(found)
    chart = _chart(found, focus, {s.name: s for s in scenarios}, traces)
    rows = [_row(v, row_command(found, v, sources)) for v in ordered(found.verdicts)]
    content = {
        "found": found,
        "headline": headline(found),
        "kind": KINDS.get(found.verdict, "neutral"),
        "meaning": meaning(found),
        "knobs": knobs(found),
        "table": Table("All scores", _COLUMNS, rows, explanation(found)),
        "charts": [] if chart is None else [chart],
        "again": row_command(found, focus, sources),
        "command": command,
    }
    return page.render("gate/templates/compare.html", content)


def _row(v: Verdict, again: str) -> Row:
    scenario, score, base, candidate, change, interval, verdict = cells(v)
    size = None if v.change is None else 100 * v.change / (v.scale or 1.0)
    return Row(
        [
            Cell(scenario),
            Cell(score),
            Cell(base, v.base),
            Cell(candidate, v.candidate),
            Cell(change, size),
            Cell(interval),
            Cell(verdict, v.verdict),
            Cell(again),
        ],
        kind=v.verdict,
        group=v.scenario,
    )


def _chart(
    found: Comparison, focus: Verdict, scenarios: Mapping[str, Scenario], traces: Traces
) -> Chart | None:
    """Return both runs on the worst seed over time."""
    scenario = scenarios.get(focus.worst_scenario)
    if scenario is None:
        return None
    curves = []
    for side, text in (("base", found.base), ("candidate", found.candidate)):
        one = traces.find(scenario.hash, text).get(focus.worst_seed or 0)
        if one is None:
            return None
        each = [one.curve], [one.detail.near]
        curves.append(curve_of(scenario, f"{side}: {text}", one.names, *each))
    said = cells(focus)
    where = f"Both runs on {scenario.name}, seed {focus.worst_seed}; truth dashed."
    return replace(
        trajectories(curves, scenario, name="worst"),
        title="Where the candidate compares worst",
        words=f"{said[1]}: {said[-1]}. {where}",
    )


JSON, MARKDOWN = "compare.json", "verdict.md"
_STYLE = {WORSE: "red", BETTER: "green", UNDECIDED: "yellow"}


def terminal_table(found: Comparison) -> rich.table.Table:
    """Return the table for a terminal."""
    table = rich.table.Table(*COLUMNS, box=None, padding=(0, 1, 0, 0), caption_justify="left")
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
    text = comparison_page(
        found,
        scenarios,
        sources=sources or {},
        command=command,
        traces=Traces(folder if (folder / ROWS).exists() else None),
    )
    write_text(folder / REPORT, text)
    # Last: a folder that has none is not complete.
    write_json(folder / JSON, found.as_dict() | {"command": command})
    return folder / REPORT
