"""What goes into the folder of a comparison: its page, its table as Markdown, its numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
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
from flexaxis.experiments.reporting.compare import render
from flexaxis.experiments.reporting.inputs import estimates, truth
from flexaxis.experiments.reporting.old_results import Traces
from flexaxis.experiments.running.store import ROWS
from flexaxis.sim.scenario import Scenario


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
    focus, verdicts = worst(found), ordered(found.verdicts)
    verdict = found.as_dict() | {
        "headline": headline(found),
        "advice": [text for text in (meaning(found), knobs(found)) if text],
        "columns": COLUMNS,
        "rows": [asdict(v) | {"text": list(cells(v))} for v in verdicts],
        "legend": explanation(found).split("\n"),
        "worst": {
            "scenario": focus.worst_scenario,
            "seed": focus.worst_seed,
            "command": row_command(found, focus, sources),
        },
        "command": command,
    }
    return render(verdict, _worst(found, focus, {s.name: s for s in scenarios}, traces))


def _worst(
    found: Comparison, focus: Verdict, scenarios: Mapping[str, Scenario], traces: Traces
) -> dict[str, Any] | None:
    """Return both runs on the worst seed over time."""
    scenario = scenarios.get(focus.worst_scenario)
    if scenario is None:
        return None
    parameter = focus.parameter or scenario.identify[0]
    runs: dict[str, Any] = {"parameter": parameter}
    for side, text in (("base", found.base), ("candidate", found.candidate)):
        one = traces.find(scenario.hash, text).get(focus.worst_seed or 0)
        if one is None or parameter not in one.names:
            return None
        runs["time"], values = estimates({0: one}, scenario, parameter)
        runs[side] = values[0]
    true = truth(scenario, parameter)
    return runs | {"truth": np.interp(runs["time"], scenario.times, true)}


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
    traces = Traces(folder if (folder / ROWS).exists() else None)
    text = comparison_page(found, scenarios, sources=sources or {}, command=command, traces=traces)
    write_text(folder / REPORT, text)
    # Last: a folder that has none is not complete.
    write_json(folder / JSON, found.as_dict() | {"command": command})
    return folder / REPORT
